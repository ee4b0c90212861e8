"""What is wrong with a file in words: pydantic's errors as one line per fault, without the names of code."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from datetime import date, time
from typing import Any, get_args

from pydantic import BaseModel, Tag, ValidationError

from pdpatrol.envs.scenario.base import DAY, MISSION_NAME, SITE_CHOICE
from pdpatrol.robot_models.yard.quantities import NAME_PATTERN
from pdpatrol.sensing.quantities import PATH_PATTERN

MOST_SHOWN = 60
"""Letters of a value, or of a key."""

MOST_FAULTS = 50
"""Lines; a file with more is told how many there are."""

FORMS = {
    NAME_PATTERN: "a small letter, and then small letters, digits and _",
    MISSION_NAME: "a letter or digit, and then letters, digits, _, - and .",
    SITE_CHOICE: "equipment/site, or equipment/* for all of it",
    PATH_PATTERN: "a name or path on one line",
    DAY: "a day of this century as 2026-03-02",
}
"""What a pattern of the schema means."""

TYPES = {
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "bool_type": "true or false",
    "string_type": "text in quotes",
    "tuple_type": "an array in [ ]",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "mapping_type": "a table",
    "dict_type": "a table",
    "string_unicode": "text",
}
"""What is allowed where something of another type came."""


def fault_lines(error: ValidationError, model: type[BaseModel]) -> list[str]:
    """One line per fault: key path, what came, what is allowed.

    Args:
        error: Of a validation.
        model: Which was validated.
    """
    lines = [line for item in error.errors(include_url=False) for line in _lines(item, model)]
    more = len(lines) - MOST_FAULTS
    return [*lines[:MOST_FAULTS], f"{more} more faults"] if more > 0 else lines


def on_one_line(text: str) -> str:
    """A text with control characters, line breaks and what cannot be printed as escapes."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def shown(value: object) -> str:
    """A value as a fault shows it: on one line, and not too long."""
    try:
        text = value.isoformat() if isinstance(value, date | time) else repr(value)
    except ValueError:  # Python does not write whole numbers of more than 4300 digits
        text = "a whole number of thousands of digits"
    return _cut(on_one_line(text))


def _cut(text: str) -> str:
    return text if len(text) <= MOST_SHOWN else f"{text[: MOST_SHOWN - 3]}..."


def _lines(item: Any, model: type[BaseModel]) -> Iterator[str]:  # noqa: ANN401 - a dictionary of pydantic
    kind, context = item["type"], item.get("ctx", {})
    key = _key(item["loc"])
    if kind == "value_error":  # our own checks, each line `key: what came; allowed is ...`
        for line in str(context.get("error", item["msg"])).splitlines():
            yield on_one_line(
                f"{key}.{line}" if key and not line.startswith("got ") else f"{key}: {line}" if key else line
            )
    elif kind == "missing":
        yield f"{key}: missing; it is required"
    elif kind == "extra_forbidden":
        yield f"{key}: unknown key; allowed are {', '.join(_known_keys(item['loc'], model))}"
    else:
        yield f"{key}: {_mismatch(kind, context, item)}"


def _mismatch(kind: str, context: Mapping[str, Any], item: Any) -> str:  # noqa: ANN401 - a dictionary of pydantic
    """What came, and what is allowed, of a value that is not as the schema has it."""
    came = shown(item["input"])
    if kind == "union_tag_invalid":
        tag, known = str(context["tag"]).strip("[]"), str(context["expected_tags"])
        allowed = ", ".join(word.strip(" '[]") for word in known.split(","))
        return f"got shape {shown(tag)}; allowed are {allowed}"
    if kind == "string_pattern_mismatch":
        return f"got {came}; allowed is {FORMS.get(context['pattern'], 'text of another form')}"
    if kind == "too_long" or kind == "too_short":
        bound = f"at most {context['max_length']}" if kind == "too_long" else f"at least {context['min_length']}"
        return (
            f"got too {kind.removeprefix('too_').replace('long', 'many').replace('short', 'few')}; allowed are {bound}"
        )
    if kind == "string_too_long":
        return f"got {came}, {len(item['input'])} letters; allowed are at most {context['max_length']}"
    if kind == "greater_than_equal" and item["input"] <= 0 < context["ge"]:
        return f"got {came}; input should be greater than 0"
    if kind in TYPES:
        return f"got {came}; allowed is {TYPES[kind]}"
    return f"got {came}; {item['msg'][0].lower()}{item['msg'][1:]}"


def _is_tag(part: object) -> bool:
    """Whether a part of a location is no key of the file: tags of unions, and what stands for the key of a table."""
    return isinstance(part, str) and part.startswith("[") and part.endswith("]")


def _key(location: tuple[int | str, ...]) -> str:
    return ".".join(_cut(on_one_line(str(part))) for part in location if not _is_tag(part))


def _known_keys(location: tuple[int | str, ...], model: type[BaseModel]) -> list[str]:
    """Fields of the model in which the last part of `location` is unknown."""
    inner: Any = model
    for part in location[:-1]:
        inner = _step_into(inner, part)
    fields: Mapping[str, Any] = getattr(inner, "model_fields", {})
    return [name for name in fields if not (inner is model and name == "name")]


def _step_into(annotation: Any, part: int | str) -> Any:  # noqa: ANN401 - walks type annotations
    """The type of a part of what a type describes; None if there is none."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        field = annotation.model_fields.get(str(part))
        return None if field is None else field.annotation
    options = [option for option in get_args(annotation) if option is not Ellipsis]
    if _is_tag(part):
        tagged = [option for option in options if Tag(str(part)) in getattr(option, "__metadata__", ())]
        found = [tagged[0].__origin__] if tagged else [_step_into(option, part) for option in options]
    else:
        models = [o for o in options if isinstance(o, type) and issubclass(o, BaseModel)]
        if isinstance(part, int):
            found = [option for option in options if get_args(option) or option in models][:1]
        else:
            found = [_step_into(option, part) for option in options]
    return next((each for each in found if each is not None), None)
