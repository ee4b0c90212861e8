"""report.json keeps to its published schema, is compact, and says no more digits than mean something."""

import json
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path

import jsonschema
import pytest

from pdpatrol.missions.field.field_data import read_field_data
from pdpatrol.missions.field.locate_field_data import array_model, locate_field_data
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.records import Report
from pdpatrol.missions.report.report_file import WIDTH, read_report, report_schema, report_text, schema_text
from tests.missions.field.surveys import EXAMPLE, POSE_ERROR, SPREAD
from tests.missions.report.logs import empty_log
from tests.missions.test_phase_patterns import log_of_two_findings

PUBLISHED = Path(__file__).parents[3] / "docs" / "schemas" / "report.schema.json"
ACCEPTS = jsonschema.Draft202012Validator(json.loads(PUBLISHED.read_text(encoding="utf-8")))


def killed(log: MissionLog) -> MissionLog:
    """What is left of a mission that could not write its association."""
    part = MissionLog(log.meta)
    for table in ("step", "pulse", "bearing", "finding"):
        for row in range(log.n_rows(table)):
            part.append(table, **{name: column[row] for name, column in log.table(table).items()})
    return part


def field_log() -> MissionLog:
    data = read_field_data(EXAMPLE)
    return locate_field_data(data, array_model(data, SPREAD), POSE_ERROR, date="2026-03-02")


LOGS: dict[str, Callable[[], MissionLog]] = {
    "two findings": lambda: log_of_two_findings(1),
    "no mains": lambda: log_of_two_findings(1, mains=False),
    "killed": lambda: killed(log_of_two_findings(1)),
    "nothing": empty_log,
    "field": field_log,
}


def written(report: Report) -> dict:
    return json.loads(report_text(report))


def test_the_published_schema_is_that_of_the_records_and_a_valid_one() -> None:
    assert PUBLISHED.read_text(encoding="utf-8") == schema_text(), "run docs/schemas/make_schema.py"
    jsonschema.Draft202012Validator.check_schema(report_schema())


def test_every_field_is_described() -> None:
    records = [report_schema(), *report_schema()["$defs"].values()]
    assert len(records) > 10
    for record in records:
        assert record["additionalProperties"] is False or record["title"] == "Versions"
        assert set(record["required"]) == set(record["properties"])
        missing = [key for key, field in record["properties"].items() if not field.get("description")]
        assert missing == [], record["title"]


@pytest.mark.parametrize("name", LOGS)
def test_the_schema_accepts_reports_which_read_back_as_they_were_written(name: str) -> None:
    report = make_report(LOGS[name](), 1.5)
    ACCEPTS.validate(written(report))
    text = report_text(report)
    assert report_text(read_report(text)) == text


def changed(*path: str | int, to: object) -> Callable[[dict], None]:
    def change(report: dict) -> None:
        for key in path[:-1]:
            report = report[key]
        report[path[-1]] = to

    return change


def without(*path: str | int) -> Callable[[dict], None]:
    def change(report: dict) -> None:
        for key in path[:-1]:
            report = report[key]
        del report[path[-1]]

    return change


BROKEN = {
    "another schema": changed("schema", to=3),
    "no findings": without("findings"),
    "a key that is none": changed("verdict", to="safe"),
    "a position on plan": changed("findings", 0, "position_m", to=[1.0, 2.0]),
    "a position in words": changed("findings", 0, "position_m", 0, to="10 m"),
    "more than certain": changed("findings", 0, "discharge", "confidence", to=1.2),
    "a kind that is none": changed("findings", 0, "discharge", "kind", to="thunder"),
    "a state that is none": changed("findings", 0, "state", to="probable"),
    "less than no pulses": changed("pulses", "detected", to=-1),
    "half a pulse": changed("findings", 0, "strength", "n_pulses", to=0.5),
    "a negative half-axis": changed("findings", 0, "ellipse95", "semi_minor_m", to=-0.1),
    "a covariance of two rows": without("findings", 0, "covariance_m2", 2),
    "waypoints in words": changed("waypoints", "missed", to="none"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_the_schema_and_the_reader_refuse_what_is_broken(name: str) -> None:
    report = deepcopy(written(make_report(log_of_two_findings(1), 1.5)))
    ACCEPTS.validate(report)
    BROKEN[name](report)
    assert not ACCEPTS.is_valid(report)
    with pytest.raises(ValueError, match="validation error"):
        read_report(json.dumps(report))


def test_a_report_of_two_findings_is_under_ten_kilobytes_and_holds_no_list_of_one_value_a_line() -> None:
    text = report_text(make_report(log_of_two_findings(1), 1.5))
    assert len(text.encode()) < 10_000
    lines = text.splitlines()
    assert not [line for line in lines if line.strip(" ,-.0123456789") == "" and line.strip()]
    counts = [line for line in lines if line.lstrip().startswith("[")]
    assert all(len(line) <= WIDTH or line in counts for line in lines)


def test_numbers_are_exact_in_memory_and_have_few_digits_in_the_file() -> None:
    report = make_report(log_of_two_findings(1), 1.23456)
    assert report.wall_time_s == 1.23456
    told = written(report)
    assert told["wall_time_s"] == 1.23
    first, exact = told["findings"][0], report.findings[0]
    assert exact.strength is not None
    assert first["strength"]["level_db"] == round(exact.strength.level_db, 1)
    for number in (*first["position_m"], *first["ellipse95"].values()):
        assert len(str(number).partition(".")[2]) <= 4
