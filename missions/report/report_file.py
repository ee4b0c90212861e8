"""report.json: compact rows that a person can read, and the JSON Schema that it keeps to."""

from __future__ import annotations

import json
from typing import Any

from pdpatrol.missions.report.records import Report

WIDTH = 120
"""Of a line; a longer one holds a single value or a row of numbers."""


def report_text(report: Report) -> str:
    """The text of report.json."""
    return laid_out(report.model_dump(mode="json", by_alias=True)) + "\n"


def read_report(text: str) -> Report:
    """The report that `report_text` wrote.

    Raises:
        ValueError: If it is none, or of another schema.
    """
    return Report.model_validate_json(text)


def report_schema() -> dict[str, Any]:
    """JSON Schema of report.json, draft 2020-12."""
    schema = Report.model_json_schema(by_alias=True)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def schema_text() -> str:
    """The text of docs/schemas/report.schema.json."""
    return json.dumps(report_schema(), indent=2) + "\n"


def laid_out(value: Any, indent: str = "") -> str:  # noqa: ANN401 - JSON holds values of many types
    """JSON on one line where it fits; else a key or an item a line, or as many plain items as fit."""
    text = json.dumps(value, ensure_ascii=False)
    if len(indent) + len(text) <= WIDTH or not isinstance(value, dict | list):
        return text
    deeper = indent + " "
    if isinstance(value, dict):
        items = [f"{json.dumps(key, ensure_ascii=False)}: {laid_out(item, deeper)}" for key, item in value.items()]
        return _between("{}", ",\n".join(deeper + item for item in items), indent)
    if any(isinstance(item, dict | list) for item in value):
        items = [laid_out(item, deeper) for item in value]
        return _between("[]", ",\n".join(deeper + item for item in items), indent)
    if all(isinstance(item, int) for item in value):
        return text
    lines = [deeper]
    for item in (json.dumps(item, ensure_ascii=False) for item in value):
        if len(lines[-1]) + len(item) >= WIDTH and lines[-1] != deeper:
            lines.append(deeper)
        lines[-1] += item + ", "
    return _between("[]", "\n".join(line.rstrip() for line in lines).removesuffix(","), indent)


def _between(brackets: str, inner: str, indent: str) -> str:
    return f"{brackets[0]}\n{inner}\n{indent}{brackets[1]}"
