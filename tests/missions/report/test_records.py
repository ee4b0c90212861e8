"""report.json and its schema."""

import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.records import Report, report_text, schema_text
from tests.missions.report.logs import LOGS, two_findings

PUBLISHED = Path(__file__).parents[3] / "docs" / "schemas" / "report.schema.json"


@pytest.fixture(scope="module")
def validator() -> jsonschema.Draft202012Validator:
    return jsonschema.Draft202012Validator(json.loads(PUBLISHED.read_text(encoding="utf-8")))


def test_published_schema_requires_and_describes_every_field() -> None:
    assert PUBLISHED.read_text(encoding="utf-8") == schema_text(), "run docs/schemas/make_schema.py"
    schema = json.loads(schema_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    for record in (schema, *schema["$defs"].values()):
        assert record["additionalProperties"] is False
        assert set(record["required"]) == set(record["properties"])
        assert all(field.get("description") for field in record["properties"].values())


@pytest.mark.parametrize("name", LOGS)
def test_report_is_valid_and_reads_back(name: str, validator: jsonschema.Draft202012Validator) -> None:
    text = report_text(make_report(LOGS[name](), 1.5))
    validator.validate(json.loads(text))
    assert report_text(Report.model_validate_json(text)) == text


def test_schema_and_reader_refuse_broken_reports(validator: jsonschema.Draft202012Validator) -> None:
    report = json.loads(report_text(make_report(two_findings(), 1.5)))
    finding = report["findings"][0]
    for change in ({"schema": 6}, {"verdict": "safe"}, {"findings": [finding | {"position_m": [1.0, 2.0]}]}):
        broken = report | change
        assert not validator.is_valid(broken)
        with pytest.raises(ValueError, match="validation error"):
            Report.model_validate_json(json.dumps(broken))


def test_distance_does_not_use_the_true_pose() -> None:
    """Everything that an operator reads is computed from the estimated pose, not from the true one."""
    log = two_findings()
    other, step = MissionLog(log.meta), log.table("step")
    for row in range(log.n_rows("step")):
        values = {name: column[row] for name, column in step.items()}
        other.append("step", **values | {"true_pose": np.array([3.0 * row, 0.0, 0.0])})
    assert make_report(other, 0.0).distance_m == make_report(log, 0.0).distance_m
