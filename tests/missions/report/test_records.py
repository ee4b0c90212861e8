"""report.json and its schema."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.records import read_report, report_text, schema_text
from tests.missions.report.logs import LOGS, two_findings

PUBLISHED = Path(__file__).parents[3] / "docs" / "schemas" / "report.schema.json"


@pytest.fixture(scope="module")
def validator() -> jsonschema.Draft202012Validator:
    return jsonschema.Draft202012Validator(json.loads(PUBLISHED.read_text(encoding="utf-8")))


def test_published_schema_matches_the_records() -> None:
    assert PUBLISHED.read_text(encoding="utf-8") == schema_text(), "run docs/schemas/make_schema.py"
    jsonschema.Draft202012Validator.check_schema(json.loads(schema_text()))


def test_schema_requires_and_describes_every_field() -> None:
    schema = json.loads(schema_text())
    records = [schema, *schema["$defs"].values()]
    assert len(records) > 10
    for record in records:
        assert record["additionalProperties"] is False
        assert set(record["required"]) == set(record["properties"])
        assert not [key for key, field in record["properties"].items() if not field.get("description")]


@pytest.mark.parametrize("name", LOGS)
def test_report_is_valid_and_reads_back(name: str, validator: jsonschema.Draft202012Validator) -> None:
    text = report_text(make_report(LOGS[name](), 1.5))
    validator.validate(json.loads(text))
    assert report_text(read_report(text)) == text


def changed(*path: str | int, to: object) -> Callable[[Any], None]:
    def change(report: Any) -> None:  # noqa: ANN401 - nested JSON
        for key in path[:-1]:
            report = report[key]
        if to is None:
            del report[path[-1]]
        else:
            report[path[-1]] = to

    return change


BROKEN = {
    "other_schema": changed("schema", to=3),
    "no_findings": changed("findings", to=None),
    "unknown_key": changed("verdict", to="safe"),
    "position_on_plan": changed("findings", 0, "position_m", to=[1.0, 2.0]),
    "position_as_text": changed("findings", 0, "position_m", 0, to="10 m"),
    "confidence_above_one": changed("findings", 0, "discharge", "confidence", to=1.2),
    "unknown_kind": changed("findings", 0, "discharge", "kind", to="thunder"),
    "unknown_state": changed("findings", 0, "state", to="probable"),
    "negative_count": changed("pulses", "detected", to=-1),
    "half_a_pulse": changed("findings", 0, "strength", "n_pulses", to=0.5),
    "negative_half_axis": changed("findings", 0, "ellipse95", "semi_minor_m", to=-0.1),
    "covariance_of_two_rows": changed("findings", 0, "covariance_m2", 2, to=None),
    "waypoints_as_text": changed("waypoints", "missed", to="none"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_schema_and_reader_refuse_broken_reports(name: str, validator: jsonschema.Draft202012Validator) -> None:
    report = json.loads(report_text(make_report(two_findings(), 1.5)))
    BROKEN[name](report)
    assert not validator.is_valid(report)
    with pytest.raises(ValueError, match="validation error"):
        read_report(json.dumps(report))


def test_numbers_are_exact_in_memory_and_rounded_in_the_file() -> None:
    report = make_report(two_findings(), 1.23456)
    assert report.wall_time_s == 1.23456
    written = json.loads(report_text(report))
    assert written["wall_time_s"] == 1.23
    first, exact = written["findings"][0], report.findings[0]
    assert exact.strength is not None
    assert first["strength"]["level_db"] == round(exact.strength.level_db, 1)
    for number in (*first["position_m"], *first["ellipse95"].values()):
        assert len(str(number).partition(".")[2]) <= 4


def test_distance_does_not_use_the_true_pose() -> None:
    """Everything an operator reads comes from the estimated pose, whatever the simulator knows."""
    log = two_findings()
    other, step = MissionLog(log.meta), log.table("step")
    for row in range(log.n_rows("step")):
        values = {name: column[row] for name, column in step.items()}
        other.append("step", **values | {"true_pose": np.array([3.0 * row, 0.0, 0.0])})
    assert make_report(other, 0.0).distance_m == make_report(log, 0.0).distance_m
