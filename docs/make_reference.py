"""Write reference/scenario_keys.md from the schema of scenarios, and reference/commands.md from the command line.

uv run python docs/make_reference.py
"""

import os
import re
import textwrap
from collections.abc import Mapping
from contextlib import redirect_stdout, suppress
from importlib import import_module
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

from pdpatrol.envs.scenario.loader import scenario_schema
from pdpatrol.missions.cli import GROUPS, module_of
from pdpatrol.missions.cli.arguments import call_command
from pdpatrol.missions.sweep.tables import markdown

FOLDER = Path(__file__).parent / "reference"
UNITS = {
    "db_per_min": "dB/min", "db_per_week": "dB/week", "deg_per_min": "deg/min", "deg_per_sqrt_min": "deg/sqrt(min)",
    "per_week": "1/week", "per_min": "1/min", "j_per_m": "J/m", "mps": "m/s", "samples": "samples", "dbv": "dBV",
    "db": "dB", "deg": "deg", "hz": "Hz", "kv": "kV", "m": "m", "s": "s", "v": "V", "w": "W", "wh": "Wh",
    "bits": "bit", "bands": "", "weeks": "week",
}  # fmt: skip
"""Units by the end of a key, the longest first."""

KEYS_INTRODUCTION = """# Scenario keys

Every table and key of a scenario file, made from its [JSON Schema](../schemas/scenario.md). *None* means that nothing
is set; the meaning says what follows. [Scenario settings](../scenarios.md) has examples.

"""
COMMANDS_INTRODUCTION = """# Commands

The help texts of all commands, as `pdpatrol COMMAND --help` prints them. In a checkout, begin with `uv run`.

"""


SCHEMA = scenario_schema()


class KeyTable(NamedTuple):
    """Table of a scenario file: its name as in the file, and its JSON Schema."""

    heading: str
    schema: Mapping[str, Any]

    @property
    def anchor(self) -> str:
        """Anchor of the table on the page, such as `nature-receiver`."""
        return re.sub(r"[^a-z_]+", "-", self.heading).strip("-") or "scenario"


def key_tables() -> dict[str, KeyTable]:
    """Return all tables of a scenario file in order, by the name of their model; first the keys outside any table."""
    found = {"Scenario": KeyTable("", SCHEMA)}
    _add_tables("", SCHEMA, found)
    return found


def _add_tables(path: str, schema: Mapping[str, Any], found: dict[str, KeyTable]) -> None:
    """Add the tables within a table, each once: equipment is a table of the yard and of the map."""
    for key, value in schema["properties"].items():
        for name in _models_of(value):
            if name not in found:
                model, own = SCHEMA["$defs"][name], f"{path}.{key}".strip(".")
                shape = model["properties"].get("shape", {}).get("const")
                suffix = "" if shape in (None, "catalogue") else f' with `shape = "{shape}"`'
                found[name] = KeyTable((f"`[[{own}]]`" if _is_list(value) else f"`[{own}]`") + suffix, model)
                _add_tables(own, model, found)


def _models_of(value: Mapping[str, Any]) -> list[str]:
    """Return the names of the models that a key holds, itself or in a list."""
    if "$ref" in value:
        return [value["$ref"].rpartition("/")[2]]
    parts = [*value.get("anyOf", ()), *value.get("oneOf", ()), *filter(None, [value.get("items")])]
    return [name for part in parts for name in _models_of(part)]


def _is_list(value: Mapping[str, Any]) -> bool:
    return "items" in value or any("items" in part for part in value.get("anyOf", ()))


TABLES = key_tables()
"""Tables of a scenario file, by the name of their model."""


def keys_markdown(name: str) -> str:
    """Make the Markdown table of the keys of a model; rows of tables within it link to them."""
    schema = TABLES[name].schema
    lines = [_row(key, value, key in schema.get("required", ())) for key, value in schema["properties"].items()]
    return markdown(["key", "meaning", "unit", "default", "allowed"], lines)


def _row(key: str, value: Mapping[str, Any], is_required: bool) -> list[str]:
    if names := _models_of(value):
        target = TABLES[names[-1]]
        meaning = value.get("description") or target.schema["description"].split("\n\n")[0]
        most = f"at most {value['maxItems']}" if "maxItems" in value else ""
        return [f"[`{key}`](#{target.anchor})", _text(meaning), "", "required" if is_required else "", most]
    unit = next((unit for end, unit in UNITS.items() if f"_{key}".endswith(f"_{end}")), "")
    default = "required" if is_required else _literal(value["default"]) if "default" in value else ""
    return [f"`{key}`", _text(value["description"]), unit, default, _allowed(value)]


def _literal(value: Any) -> str:  # noqa: ANN401 - a value of JSON
    """Return a value as in a scenario file."""
    if isinstance(value, list):
        return f"`[{', '.join(_literal(item).strip('`') for item in value)}]`"
    if value is None:
        return "None"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    return f'`"{value}"`' if isinstance(value, str) else f"`{value:g}`"


def _allowed(value: Mapping[str, Any]) -> str:
    """Describe the values that a schema allows."""
    if options := [part for part in (*value.get("anyOf", ()), *value.get("oneOf", ())) if part.get("type") != "null"]:
        return " or ".join(_allowed(part) for part in options)
    if "const" in value:
        return _literal(value["const"])
    if "enum" in value:
        return ", ".join(map(_literal, value["enum"]))
    if value["type"] == "boolean":
        return "`true`, `false`"
    if value["type"] in ("number", "integer"):
        low, high = value.get("minimum", value.get("exclusiveMinimum")), value.get("maximum")
        above = "above " if "exclusiveMinimum" in value else ""
        return f"{above}{low:g} to {high:g}" if high < 2**62 else f"{low:g} or more"
    if value["type"] == "array" and "prefixItems" in value:
        parts = list(dict.fromkeys(_allowed(part) for part in value["prefixItems"]))
        return f"{len(value['prefixItems'])} numbers, {parts[0] if len(parts) == 1 else '; '.join(parts)}"
    if value["type"] == "array":
        low, high = value.get("minItems", 0), value["maxItems"]
        return f"list of {low} to {high}: {_allowed(value['items'])}"
    if value["type"] == "object":
        return f"up to {value['maxProperties']} entries `name = [x, y, z]`"
    return "date" if "20[0-9]" in value.get("pattern", "") else "text"


def _text(description: str) -> str:
    """Return a description on one line, safe in a cell of a table."""
    return " ".join(description.split()).replace("|", "\\|")


def keys_page() -> str:
    """Return the page of all keys of a scenario."""
    parts = [KEYS_INTRODUCTION]
    for name, table in TABLES.items():
        heading = table.heading or "Outside any table"
        about = "\n\n".join(map(_text, table.schema["description"].split("\n\n")))
        parts.append(f"## {heading} {{ #{table.anchor} }}\n\n{about}\n\n{keys_markdown(name)}\n")
    return "".join(parts).rstrip() + "\n"


def commands_page() -> str:
    """Return the page of the help texts of all commands."""
    os.environ |= {"COLUMNS": "110", "NO_COLOR": "1", "TERM": "dumb"}
    parts = [COMMANDS_INTRODUCTION]
    for command, about in (item for commands in GROUPS.values() for item in commands.items()):
        parts.append(f"\n## {command}\n\n{about[0].upper()}{about[1:]}.\n\n```text\n{_help(command)}```\n")
    return "".join(parts)


def _help(command: str) -> str:
    """Return the help text of a command, without the frames that a terminal shows."""
    module = import_module(f"pdpatrol.missions.cli.{module_of(command)}")
    with redirect_stdout(StringIO()) as shown, suppress(SystemExit):
        call_command(getattr(module, module_of(command)), ["--help"])
    lines = [re.sub(r"^[│╭╰][ ─]?|[ ─]*[│╮╯]?$", "", line).rstrip() for line in shown.getvalue().splitlines()]
    lines = [part for line in lines for part in ([line] if line[:1] in ("", " ") else textwrap.wrap(line, 110))]
    return "\n".join(lines).strip() + "\n"


PAGES = {"scenario_keys.md": keys_page, "commands.md": commands_page}

if __name__ == "__main__":
    for name, page in PAGES.items():
        (FOLDER / name).write_text(page(), encoding="utf-8")
