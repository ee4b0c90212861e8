"""Edits of the text of a scenario file, which keep its comments and layout.

Existing values are replaced by tomlkit. New keys and tables are written as lines, because tomlkit writes them below the
comments that belong to the next table. Each edit is checked: parsed again, the text must have changed as requested.
"""

import re
import tomllib
from collections.abc import Iterator, Sequence
from typing import Any, Literal

import tomlkit
from pydantic import BaseModel, ConfigDict
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import AoT, Array, InlineTable, Item, Table

Keys = tuple[str | int, ...]
"""Keys and indices from the top of a file to a value, such as ("yard", "equipment", 3, "kv")."""

BOM = "\ufeff"
"""Byte order mark, with which some editors begin a file."""

HEADER = re.compile(r"^\s*\[\[?([^\[\]#,]+)\]\]?\s*(#.*)?$")
"""Line that begins a table."""

NEW_YARD = """\
# A yard drawn with pdpatrol edit.

[yard]
size_m = [40.0, 30.0]
equipment = [
]

[route]
dock_m = [3.0, 3.0]
waypoints_m = "planned"

[array]
"""
"""Text of a new file: an empty yard."""


class EditError(ValueError):
    """Error for an edit that cannot be made in a text."""


class Edit(BaseModel):
    """One change of a scenario file.

    Attributes:
        operation: `set` gives the key at `path` a value, and `remove` removes it. `insert` inserts the value into a
            list, before the index that ends `path`; tables can only be appended. `rename` changes the name of the
            piece of equipment at `path`, also where sources and map use it.
        path: Keys and indices from the top of the file.
        value: Value in TOML; text that is not TOML is a string.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    operation: Literal["set", "remove", "insert", "rename"]
    path: Keys
    value: str = ""


def edited(text: str, edits: Sequence[Edit]) -> str:
    """Make edits one after the other in the text of a file, and return the new text.

    Line ends and byte order mark are kept.

    Raises:
        EditError: If an edit cannot be made.
    """
    plain = text.removeprefix(BOM).replace("\r\n", "\n")
    for edit in edits:
        steps = list(_renaming(plain, edit)) if edit.operation == "rename" else [edit]
        for step in steps:
            plain = _edited(plain, step)
    return BOM * text.startswith(BOM) + (plain.replace("\n", "\r\n") if "\r\n" in text else plain)


def toml_text(value: Any) -> str:  # noqa: ANN401 - TOML values have many types
    """Write plain data as a TOML value on one line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{tomlkit.key(key).as_string()} = {toml_text(v)}" for key, v in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml_text, value)) + "]"
    return tomlkit.item(value).as_string()


def strings_in(data: Any, path: Keys = ()) -> Iterator[tuple[Keys, str]]:  # noqa: ANN401 - as above
    """Find all strings in plain data, with their paths."""
    if isinstance(data, str):
        yield path, data
    elif isinstance(data, dict | list):
        for key, value in data.items() if isinstance(data, dict) else enumerate(data):
            yield from strings_in(value, (*path, key))


def _parsed(text: str) -> Item:
    """Return a TOML value; text that is not TOML is a string."""
    try:
        return tomlkit.value(text)
    except TOMLKitError:
        return tomlkit.string(text)


def _renaming(text: str, edit: Edit) -> Iterator[Edit]:
    """Yield the edits that rename a piece of equipment and change all that refers to it."""
    data, name = tomllib.loads(text), (*edit.path, "name")
    old, new = dict(strings_in(data)).get(name), _parsed(edit.value).unwrap()
    yield Edit(operation="set", path=name, value=edit.value)
    for path, value in strings_in(data):
        piece, slash, site = value.partition("/")
        is_site = path[:1] == ("sources",) and path[2:3] == ("sites",)
        is_on_map = path[:2] == ("map", "missing") or (path[:2] == ("map", "moved") and path[-1] == "name")
        if piece == old and (is_site or is_on_map):
            yield Edit(operation="set", path=path, value=toml_text(f"{new}{slash}{site}"))


def _edited(text: str, edit: Edit) -> str:
    value = _parsed(edit.value)
    try:
        expected = tomllib.loads(text)
        _apply(expected, edit, value.unwrap())
        new = _rewritten(text, edit, value)
        outcome = tomllib.loads(new)
        if edit.operation == "remove" and isinstance(edit.path[-1], int):
            _add_empty_list(outcome, edit.path[:-1])  # the last table of its name may be gone
        is_done = outcome == expected
    except (LookupError, TypeError, AttributeError, TOMLKitError, tomllib.TOMLDecodeError):
        new, is_done = text, False
    if not is_done:
        place = ".".join(map(str, edit.path))
        raise EditError(f"{place}: cannot be changed in the layout of this file; change it in a text editor")
    return new


def _rewritten(text: str, edit: Edit, value: Item) -> str:
    """Make an edit in a text: by lines if it adds a key, or adds or removes a table, and otherwise with tomlkit."""
    document, (*parents, key) = tomlkit.parse(text), edit.path
    parent = _at(document, parents)
    if edit.operation == "insert" and (isinstance(parent, AoT) or (parent is None and isinstance(value, InlineTable))):
        return _with_table(text, edit, value.unwrap())
    if edit.operation == "remove" and isinstance(parent, AoT):
        return _without_table(text, edit)
    if edit.operation == "set" and isinstance(parent, Table) and key not in parent:
        return _with_line(text, parents, f"{tomlkit.key(str(key)).as_string()} = {value.as_string()}")
    has_other_keys = isinstance(parent, InlineTable) and (edit.operation == "remove" or key not in parent)
    _apply(document, edit, value)
    if has_other_keys:  # tomlkit leaves the spaces of removed keys, and sets none before the bracket
        *tables, index = parents
        _at(document, tables)[index] = tomlkit.value(toml_text(parent.unwrap()))
    return tomlkit.dumps(document)


def _at(data: Any, path: Sequence[str | int]) -> Any:  # noqa: ANN401 - TOML values have many types
    """Return the value at a path, or None if its last key is missing."""
    for depth, key in enumerate(path, start=1):
        data = data.get(key) if depth == len(path) and isinstance(key, str) else data[key]
    return data


def _add_empty_list(data: Any, path: Keys) -> None:  # noqa: ANN401 - as above
    """Add an empty list at a path of plain data, with the tables that lead there, unless there is a value."""
    *tables, name = path
    for key in tables:
        data = data.setdefault(key, {}) if isinstance(key, str) else data[key]
    data.setdefault(name, [])


def _apply(data: Any, edit: Edit, value: Any) -> None:  # noqa: ANN401 - a document of tomlkit, or plain data
    """Make an edit in a document or in plain data, except for a rename."""
    *parents, key = edit.path
    if edit.operation == "insert":
        *tables, name = parents
        _at(data, tables).setdefault(name, []).insert(key, value)
    elif edit.operation == "remove":
        del _at(data, parents)[key]
    else:
        _replace(_at(data, parents), key, value)


def _replace(parent: Any, key: str | int, value: Any) -> None:  # noqa: ANN401 - as above
    """Replace a value; of an array of the same length, replace the items, so that its layout stays."""
    old = parent[key] if isinstance(key, int) or key in parent else None
    if isinstance(old, Array) and isinstance(value, Array) and len(old) == len(value):
        for index, item in enumerate(value):
            _replace(old, index, item)
    else:
        parent[key] = value


def _span(lines: Sequence[str], path: Sequence[str | int], with_inner: bool) -> tuple[int, int]:
    """Find the lines of a table: from its header to its last line that is neither empty nor a comment, exclusive.

    Args:
        lines: Lines of the file.
        path: Keys of the table, and its index among tables of this name, if there are several.
        with_inner: Whether tables within the table are part of it.
    """
    name, index = _name(path), next((key for key in path if isinstance(key, int)), 0)
    headers = [(match[1], row) for row, line in enumerate(lines) if (match := HEADER.match(line))]
    headers = [(".".join(part.strip(" \t\"'") for part in header.split(".")), row) for header, row in headers]
    number = [k for k, (header, _) in enumerate(headers) if header == name][index]
    after = number + 1
    while with_inner and after < len(headers) and headers[after][0].startswith(f"{name}."):
        after += 1
    stop = headers[after][1] if after < len(headers) else len(lines)
    while not lines[stop - 1].strip() or lines[stop - 1].lstrip().startswith("#"):
        stop -= 1
    return headers[number][1], stop


def _name(path: Sequence[str | int]) -> str:
    return ".".join(key for key in path if isinstance(key, str))


def _with_line(text: str, table: Sequence[str | int], line: str) -> str:
    """Add a key at the end of a table."""
    lines = text.split("\n")
    _, stop = _span(lines, table, with_inner=False)
    return "\n".join([*lines[:stop], line, *lines[stop:]])


def _with_table(text: str, edit: Edit, row: dict[str, Any]) -> str:
    """Append a table to those of its name, or to the file if it is the first one."""
    lines, (*names, index) = text.rstrip("\n").split("\n"), edit.path
    is_first = index == 0
    stop = len(lines) if is_first else _span(lines, (*names, int(index) - 1), with_inner=True)[1]
    table = ["", f"[[{_name(names)}]]", *(f"{key} = {toml_text(value)}" for key, value in row.items())]
    return "\n".join([*lines[:stop], *table, *lines[stop:], ""])


def _without_table(text: str, edit: Edit) -> str:
    """Remove a table and the empty lines above it; comments above and below stay."""
    lines = text.split("\n")
    start, stop = _span(lines, edit.path, with_inner=True)
    while start > 0 and not lines[start - 1].strip():
        start -= 1
    return "\n".join([*lines[:start], *lines[stop:]])
