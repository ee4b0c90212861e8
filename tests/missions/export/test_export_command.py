"""`pdpatrol export`."""

from pathlib import Path

import pytest

from pdpatrol.envs import load_scenario
from pdpatrol.missions.runner import run_mission
from tests.processes import pdpatrol

pytestmark = pytest.mark.whole


@pytest.fixture(scope="module")
def mission(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("a mission ü")
    run_mission(load_scenario("one_source", {"task.time_limit_s": 10.0}), "patrol").save(folder)
    return folder


def test_export_writes_all_files_and_notes_the_missing_map(mission: Path, tmp_path: Path) -> None:
    done = pdpatrol("export", mission, "--out", "out", cwd=tmp_path)
    assert done.returncode == 0
    names = {"findings.csv", "steps.parquet", "pulses.parquet", "mission.mcap"}
    assert {path.name for path in (tmp_path / "out").iterdir()} == names
    assert all(name in done.stdout for name in names)
    assert done.stderr == "note: no findings.geojson, as the scenario has no table [georeference]\n"
