"""Base classes, types and error messages that all tables of a scenario file share."""

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from datetime import date
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, Field, ValidationError

from dirmusic import InputFileError
from dirmusic.input_file import read_whole
from pdpatrol.robot_models.yard.quantities import MOST_LETTERS

MissionName = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$", max_length=MOST_LETTERS)]
"""Name of a scenario, safe as the name of a folder and on a terminal."""

SiteChoice = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*/([a-z][a-z0-9_]*|\*)$", max_length=2 * MOST_LETTERS + 1)]
"""`equipment/site`, or `equipment/*` for all sites of a piece of equipment."""

Number = Annotated[float, Field(ge=-1000.0, le=1000.0)]
"""Error of an array element, or component of a direction."""

STEP_S = 0.1
"""Control step, s."""

MAX_FILE_BYTES = 4_000_000
"""Maximum size of a scenario file. Assumed; the largest valid yard takes less."""

MAX_ERRORS_SHOWN = 50

DayAsText = BeforeValidator(lambda value: value.isoformat()[:10] if isinstance(value, date) else value)
"""Conversion of TOML dates to text, as in logs and reports."""

IS_NAME = re.compile(rf"[\w-]{{1,{MOST_LETTERS}}}")
"""Pattern of names by which errors call items; other texts are no names, or would not be readable."""

Day = Annotated[
    str,
    Field(pattern=r"^20[0-9]{2}-[0-9]{2}-[0-9]{2}$", max_length=10),
    DayAsText,
    AfterValidator(lambda text: str(date.fromisoformat(text))),
]
"""Date such as 2026-03-02, as text or as a date of TOML."""


def weeks_between(first: str, last: str) -> float:
    """Return the number of weeks from one `Day` to another, negative if `last` is before `first`."""
    return (date.fromisoformat(last) - date.fromisoformat(first)).days / 7


class ScenarioError(InputFileError):
    """Error raised for a scenario that cannot be used, with one line per error found."""


def as_tuples(value: Any) -> Any:  # noqa: ANN401 - TOML and JSON values have many types
    """Convert TOML or JSON arrays to tuples, which the strict models require, and -0.0 to 0.

    Random generators reject a standard deviation of -0.0.
    """
    if isinstance(value, list | tuple):
        return tuple(as_tuples(item) for item in value)
    if isinstance(value, Mapping):
        return {key: as_tuples(item) for key, item in value.items()}
    return value + 0.0 if isinstance(value, float) else value


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file, with or without a byte order mark.

    Raises:
        InputFileError: If the file cannot be read, is too large, or is not valid TOML in UTF-8.
    """
    return parse_toml(read_whole(path, MAX_FILE_BYTES), path)


def parse_toml(content: bytes, path: Path) -> dict[str, Any]:
    """Parse the content of a TOML file, with or without a byte order mark.

    Raises:
        InputFileError: If it is not valid TOML in UTF-8; the message names the path.
    """
    try:
        return tomllib.loads(content.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:  # also raised for huge integers and deep nesting
        raise InputFileError([f"{path}: is not valid TOML: {error}"]) from None


def error_lines(error: ValidationError, model: type[BaseModel], data: object = None) -> list[str]:
    """Format validation errors as lines of the form `key: message`.

    Args:
        error: Errors that pydantic found.
        model: Model that was validated; the closest of its keys is suggested for an unknown key.
        data: Data that was validated, from which items of arrays are named.
    """
    lines = [on_one_line(with_names(line, data)) for item in error.errors() for line in _lines_of(item, model)]
    n_more = len(lines) - MAX_ERRORS_SHOWN
    return [*lines[:MAX_ERRORS_SHOWN], f"{n_more} more errors"] if n_more > 0 else lines


def with_names(line: str, data: object) -> str:
    """Replace indices in the key of an error by names: `yard.equipment.2` by `yard.equipment "T1"`.

    An index is kept where the item has no name, or shares it with another item.

    Args:
        line: `key: message`.
        data: Data in which the key is.
    """
    key, colon, message = line.partition(": ")
    parts = list[str]()
    for part in key.split("."):
        if isinstance(data, list | tuple) and part.isdecimal() and int(part) < len(data):
            names = [item.get("name") if isinstance(item, Mapping) else None for item in data]
            name, data = names[int(part)], data[int(part)]
            if parts and isinstance(name, str) and IS_NAME.fullmatch(name) and names.count(name) == 1:
                parts[-1] += f' "{name}"'
                continue
        else:
            data = data.get(part) if isinstance(data, Mapping) else None
        parts.append(part)
    return f"{'.'.join(parts)}{colon}{message}"


def _lines_of(item: Any, model: type[BaseModel]) -> Iterator[str]:  # noqa: ANN401 - an error dictionary of pydantic
    if item["type"] == "too_short" and len(item["input"]) >= item["ctx"]["min_length"]:
        return  # only because other items are invalid, each with its own error
    keys = [str(part) for part in item["loc"]]
    key = ".".join(f"{part:.60}" for part in keys if not part.startswith("["))  # tags of unions stand in brackets
    if item["type"] == "value_error":
        is_table = isinstance(item["input"], Mapping)  # such messages begin with a key of the table
        for line in str(item["ctx"]["error"]).splitlines():
            yield f"{key}{'.' if is_table else ': '}{line}" if key else line
    elif item["type"] == "missing":
        yield f"{key}: is required"
    elif item["type"] == "extra_forbidden":
        near = get_close_matches(keys[-1], _all_keys(model), n=1)
        is_elsewhere = near == [keys[-1]]
        hint = "; it is a key of another table" if is_elsewhere else f"; did you mean `{near[0]}`?" if near else ""
        yield f"{key}: unknown key{hint}"
    elif item["type"] == "union_tag_invalid":
        shapes = str(item["ctx"]["expected_tags"]).replace("[", "").replace("]", "")
        yield f"{key}: must have the shape {shapes}, got {item['ctx']['tag'].strip('[]')!r:.60}"
    else:
        must = re.sub("^(Input|String|Tuple|List|Dictionary) should", "must", item["msg"]).partition(
            " after validation"
        )[0]
        must = must.replace("a valid tuple", "an array")
        must = "must be a table" if item["type"].startswith(("model", "dict")) else must
        yield f"{key}: {must}, got {item['input']!r:.60}"


def _all_keys(model: type[BaseModel]) -> list[str]:
    schema = model.model_json_schema()
    tables = [schema, *schema.get("$defs", {}).values()]
    return sorted({key for table in tables for key in table.get("properties", {})})


def known_names(names: tuple[str, ...], wanted: str) -> str:
    """List the names closest to a wrong one, or the first few if none is close."""
    return ", ".join(get_close_matches(wanted, names, n=3) or names[:12]) or "none"


def meant(names: Iterable[str], wanted: str) -> str:
    """Return `; did you mean NAME?` with the name closest to a wrong one, or nothing if none is close."""
    near = get_close_matches(wanted, names, n=1)
    return f"; did you mean {near[0]}?" if near else ""


def on_one_line(text: str) -> str:
    """Escape line breaks and all other characters that cannot be printed."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
