"""Surveys on a map: sites and all-clear from a yard, position on Earth, numbers of findings, and dates."""

import json
from pathlib import Path

import numpy as np
import pytest
from pyproj import Geod

from pdpatrol.missions.export.export_mission import export_mission
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.inspection import inspect_sites
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.page import report_page
from tests.missions.conftest import Refused
from tests.missions.field.surveys import EXAMPLE, log_of_table, orbit, survey, write
from tests.processes import pdpatrol

TRUTH_M = json.loads(EXAMPLE.with_name("truth.json").read_text())["position_m"]

YARD = """
[yard]
size_m = [40.0, 30.0]

[[yard.equipment]]
name = "arrester"
kind = "surge_arrester"
shape = "cylinder"
position_m = [14.0, 9.0]
radius_m = 0.1
height_m = 1.9
sites = { top = [0.0, 0.0, 1.9] }

[[yard.equipment]]
name = "far"
kind = "surge_arrester"
shape = "cylinder"
position_m = [38.0, 28.0]
radius_m = 0.1
height_m = 1.9
sites = { top = [0.0, 0.0, 1.9] }

[route]
dock_m = [2.0, 2.0]

[array]
"""


@pytest.fixture(scope="module")
def yard(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("yard") / "yard.toml"
    path.write_text(YARD)
    return path


@pytest.fixture(scope="module")
def log(yard: Path) -> MissionLog:
    return log_of_table(EXAMPLE, yard=yard, georeference=(47.0, 8.0, 90.0))


def test_yard_names_the_site_and_states_what_is_inspected(log: MissionLog) -> None:
    inspection = inspect_sites(log)
    assert inspection is not None
    report = make_report(log, 0.0, inspection)
    (finding,) = report.findings
    assert finding.sites[0].name == "arrester/top"
    assert {site.name: site.state for site in inspection.sites} == {
        "arrester/top": "finding",
        "far/top": "not_inspected",
    }
    assert report.evaluation is None
    assert "far/top" in report_page(log, report).replace("<wbr>", "")


def test_georeference_places_the_findings_on_earth(tmp_path: Path, log: MissionLog) -> None:
    """The y axis points east: the source is `y` metres east and `x` metres south of the origin."""
    assert "findings.geojson" in export_mission(log, tmp_path)
    features = json.loads((tmp_path / "findings.geojson").read_text())["features"]
    longitude_deg, latitude_deg, _ = features[0]["geometry"]["coordinates"]
    azimuth_deg, _, range_m = Geod(ellps="WGS84").inv(8.0, 47.0, longitude_deg, latitude_deg)
    east_m, north_m = range_m * np.sin(np.radians(azimuth_deg)), range_m * np.cos(np.radians(azimuth_deg))
    assert np.hypot(east_m - TRUTH_M[1], north_m + TRUTH_M[0]) < 0.3


def test_survey_without_options_has_neither_map_nor_date(tmp_path: Path) -> None:
    log = log_of_table(EXAMPLE)
    assert "findings.geojson" not in export_mission(log, tmp_path)
    assert make_report(log, 0.0).date is None
    assert inspect_sites(log) is None


@pytest.mark.whole
def test_findings_are_numbered_from_1(tmp_path: Path) -> None:
    """Confirmed findings have the first numbers, and the texts of events have the numbers of their findings."""
    rows = survey(np.repeat(orbit(16, 7.0, (11.0, 10.5)), 5, axis=0), (8.0, 12.0, 1.5), (14.0, 9.0, 1.5), seed=1)
    log = log_of_table(write(tmp_path / "s.csv", rows), noise_v=1e-3)
    report = make_report(log, 0.0)
    shown = [finding.id for finding in (*report.findings, *report.candidates)]
    assert shown == list(range(1, len(shown) + 1))
    events = log.table("event")
    for kind, number, text in zip(events["kind"], events["number"], events["text"], strict=True):
        if kind in ("candidate", "confirmed", "dropped"):
            assert text.split()[1] == str(number)
    assert set(np.unique(log.column("association", "finding"))) <= {0, *shown}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--yard none.toml", "none.toml: cannot be read"),
        ("--yard t.toml --yard-m 5 5", "--yard-m: must not be given with --yard"),
        ("--georeference 91 0 0", "--georeference: must be less than or equal to 85"),
    ],
)
def test_wrong_places_are_one_line(tmp_path: Path, options: str, message: str, refused: Refused) -> None:
    (tmp_path / "t.toml").write_text(YARD)
    (line,) = refused("locate", EXAMPLE, *options.split(), cwd=tmp_path)
    assert message in line


@pytest.mark.whole
def test_located_survey_is_exported_for_maps(tmp_path: Path, yard: Path) -> None:
    options = ["--yard", str(yard), "--georeference", "47", "8", "0", "--out", "survey"]
    done = pdpatrol("locate", EXAMPLE, *options, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "arrester" in done.stdout
    assert "arrester/top" in (tmp_path / "survey" / "report.json").read_text()
    done = pdpatrol("export", "survey", "--out", "maps", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "maps" / "findings.geojson").exists()
