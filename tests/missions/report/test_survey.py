"""Asset, severity, action and due date of findings, and the statements of a survey."""

import json
import re
from datetime import date, timedelta
from pathlib import Path

import pandas as pd
import pytest

from pdpatrol.envs import load_scenario
from pdpatrol.envs.scenario import ScenarioError
from pdpatrol.envs.scenario.severity import DEFAULT, default_severity
from pdpatrol.missions.export.export_mission import export_mission
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.page import report_page
from pdpatrol.missions.report.records import Report, Survey
from tests.envs.helpers import replaced
from tests.missions.field.surveys import EXAMPLE, log_of_table
from tests.missions.report.logs import two_findings
from tests.missions.report.page_reader import PageReader

DOCS = Path(__file__).parents[3] / "docs" / "schemas" / "report.md"

YARD = """
[yard]
size_m = [20.0, 20.0]

[[yard.equipment]]
name = "vt_3"
kind = "voltage_transformer"
shape = "cylinder"
position_m = [10.0, 10.3]
radius_m = 0.3
height_m = 2.6
asset_id = "DE-4711/3"
kv = 33
phase = "L2"

[[yard.equipment]]
name = "breaker"
kind = "circuit_breaker"
kv = 220
position_m = [1.5, 14.0]
yaw_deg = 90.0
asset_id = "CB 9"

[route]
dock_m = [5.0, 3.0]

[array]
serial_number = 12

[georeference]
latitude_deg = 51.0
longitude_deg = 7.0
"""

SURVEY = """
[survey]
site = "Northfield"
owner = "Grid Ltd"
voltage = "220/33 kV"
report_number = "PD-1"
revision = "B"
inspector = "J. Doe, level 2"
weather = "rain"
load = "60 %"
background_noise = "a radar"
array_calibrated = 2025-05-05
previous_survey = 2025-06-30
next_survey = "2026-06-30"
trend = "trends/may.html"
"""


def yard_file(folder: Path, tables: str = SURVEY) -> Path:
    file = folder / "site.toml"
    file.write_text(YARD + tables, encoding="utf-8")
    return file


def surveyed(file: Path, day: str | None = "2026-03-02") -> MissionLog:
    """Return the log of a mission with two findings, of which the scenario is in a file."""
    log = two_findings()
    log.meta |= {"scenario": load_scenario(file).model_dump(mode="json"), "date": day}
    return log


def actions(log: MissionLog, report: Report) -> list[str]:
    """Return the text of each row of the table of actions."""
    found = re.search(r'<table id="actions".*?</table>', report_page(log, report), re.DOTALL)
    assert found
    return [PageReader(row).text for row in re.findall(r"<tr>.*?</tr>", found[0], re.DOTALL)[1:]]


@pytest.mark.parametrize("day", ["2026-03-02", None])
def test_first_table_has_asset_severity_action_and_due(day: str | None, tmp_path: Path) -> None:
    log = surveyed(yard_file(tmp_path), day)
    report = make_report(log, 0.0)
    rows = actions(log, report)
    assert len(rows) == len(report.findings) == 2
    for finding in report.findings:
        (row,) = [row for row in rows if row.startswith(f"{finding.id} ")]
        advice, days = finding.assessment, default_severity().classes
        assert advice is not None
        assert advice.within_days == days[advice.severity]
        if day is None:
            assert advice.due is None
            due = f"within {advice.within_days} days"
        else:
            due = str(date(2026, 3, 2) + timedelta(days=advice.within_days))
            assert advice.due == due
        facts = ("vt_3", "DE-4711/3", "33 kV", "phase L2") if finding.id == 1 else ()
        for text in (*facts, advice.severity, advice.action, due):
            assert text in row, text


def test_first_table_comes_before_all_others(tmp_path: Path) -> None:
    log = surveyed(yard_file(tmp_path))
    assert report_page(log, make_report(log, 0.0)).partition("<table")[2].startswith(' id="actions"')


def test_most_urgent_action_comes_first(tmp_path: Path) -> None:
    log = surveyed(yard_file(tmp_path))
    report = make_report(log, 0.0)
    due = [re.findall(r"\d{4}-\d\d-\d\d", row)[-1] for row in actions(log, report)]
    assert due == sorted(due)
    assert due[0] != due[1]


def own_severity(folder: Path, *changes: tuple[str, str]) -> Path:
    (folder / "own.toml").write_text(replaced(DEFAULT.read_text(encoding="utf-8"), changes), encoding="utf-8")
    return yard_file(folder, '[survey]\nseverity = "own.toml"\n')


def test_table_of_the_user_is_followed_and_kept_in_the_log(tmp_path: Path) -> None:
    changes = [("low = 365", "blue = 5\nlow = 365"), ('class_strong = "critical"', 'class_strong = "blue"')]
    changes += [('"pdpatrol default"', '"Rule 7"'), ("Confirm on the asset itself", "Call the owner")]
    file = own_severity(tmp_path, *changes)
    log = surveyed(file)
    (tmp_path / "own.toml").unlink()
    report = make_report(log, 0.0)
    void = report.findings[1]
    assert void.discharge is not None
    assert void.discharge.kind == "void"
    advice = void.assessment
    assert advice is not None
    assert (advice.severity, advice.due) == ("blue", "2026-03-07")
    assert advice.action.startswith("Call the owner")
    assert "Rule 7" in advice.rule
    page = PageReader(report_page(log, report)).text
    assert "Rule 7" in page
    assert "pdpatrol default" not in page


def test_level_and_confidence_decide_the_row(tmp_path: Path) -> None:
    """A weak discharge gets the lower class, and a kind below the least confidence counts as unknown."""
    weak = make_report(surveyed(own_severity(tmp_path, ("strong_dbv = 0.0", "strong_dbv = 30.0"))), 0.0).findings[1]
    unsure = make_report(
        surveyed(own_severity(tmp_path, ("least_confidence = 0.8", "least_confidence = 1.0"))), 0.0
    ).findings[1]
    rows = default_severity().kinds
    assert weak.assessment is not None
    assert unsure.assessment is not None
    assert weak.assessment.severity == rows.void.class_weak
    assert unsure.assessment.action == rows.unknown.action


def test_invalid_table_gives_one_line_per_error(tmp_path: Path) -> None:
    file = own_severity(
        tmp_path,
        ("low = 365", "low = -1"),
        ("[kinds.void]", "[kinds.viod]"),
        ("strong_dbv = 0.0", 'strong_dbv = "loud"'),
    )
    with pytest.raises(ScenarioError) as refused:
        load_scenario(file)
    own = f"{file}: survey.severity: {tmp_path / 'own.toml'}: "
    lines = [line.removeprefix(own) for line in refused.value.faults]
    assert sorted(line.partition(":")[0] for line in lines) == ["classes.low", "kinds.viod", "kinds.void", "strong_dbv"]
    with pytest.raises(ScenarioError) as refused:
        load_scenario(own_severity(tmp_path, ("low = 365", "lowest = 365")))
    assert [line.removeprefix(own) for line in refused.value.faults] == [
        "kinds.corona.class_weak: must be a class of [classes] (lowest, moderate, high, critical), got `low`"
    ]


@pytest.mark.parametrize("line", ['previous_survey = "last year"', 'next_survey = "soon"', 'weather = "a\\nb"'])
def test_invalid_statement_is_refused_in_one_line(line: str, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError) as refused:
        load_scenario(yard_file(tmp_path, f"[survey]\n{line}\n"))
    (fault,) = refused.value.faults
    assert f"survey.{line.partition(' ')[0]}: must" in fault.replace("String should", "must")


def test_statements_and_asset_keys_reach_all_outputs(tmp_path: Path) -> None:
    file = yard_file(tmp_path)
    log, out = surveyed(file), tmp_path / "out"
    out.mkdir()
    report = make_report(log, 0.0)
    stated = report.survey.model_dump()
    assert None not in stated.values()
    assert stated["trend"] == str(tmp_path / "trends" / "may.html")
    export_mission(log, out)
    table = pd.read_csv(out / "findings.csv", dtype=str)
    features = json.loads((out / "findings.geojson").read_text())["features"]
    page = PageReader(report_page(log, report)).text
    for row, finding in zip(table.to_dict("records"), report.findings, strict=True):
        (on_map,) = [one["properties"] for one in features if one["id"] == f"finding-{finding.id}"]
        assert finding.assessment is not None
        for name, value in stated.items():
            assert row[f"survey_{name}"] == str(on_map[f"survey_{name}"]) == str(value)
            assert name == "trend" or str(value) in page
        assert row["survey_date"] == on_map["survey_date"] == "2026-03-02"
        for name in ("severity", "action", "due"):
            assert row[name] == on_map[name] == getattr(finding.assessment, name)
        if finding.asset is not None:
            for name in ("asset_id", "kv", "phase"):
                value = getattr(finding.asset, name)
                assert on_map[name] == value
                assert value is None or row[name] == str(value)
    assert (tmp_path / "trends" / "may.html").as_uri() in report_page(log, report)
    assert set(Survey.model_fields) == stated.keys()


def test_survey_of_a_yard_states_its_table(tmp_path: Path) -> None:
    """A survey with a yard file carries the statements of the file, one without has none."""
    file = yard_file(tmp_path)
    with_yard = make_report(log_of_table(EXAMPLE, yard=file, date="2026-03-02"), 0.0)
    assert (with_yard.survey.site, with_yard.survey.serial_number) == ("Northfield", 12)
    alone = make_report(log_of_table(EXAMPLE), 0.0)
    assert alone.survey.site is None
    assert [finding.id for finding in alone.findings] == [1]
    assert [finding.assessment and finding.assessment.due for finding in alone.findings] == [None]


def test_documented_table_of_severity_is_the_default() -> None:
    page, table = DOCS.read_text(encoding="utf-8"), default_severity()
    for kind, row in table.kinds:
        classes = (f"{name}, {table.classes[name]} days" for name in (row.class_weak, row.class_strong))
        assert f"| {kind} | {' | '.join(classes)} | {row.action} |" in page
    assert f"strong from {table.strong_dbv:g} dBV" in page
    assert f"less than {100 * table.least_confidence:.0f} % confidence" in page
