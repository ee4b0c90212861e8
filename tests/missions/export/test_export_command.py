"""`pdpatrol export`."""

import subprocess
import sys
from pathlib import Path

import pytest

from pdpatrol.envs import load_scenario
from pdpatrol.missions.runner import run_mission

pytestmark = pytest.mark.whole

PDPATROL = str(Path(sys.executable).with_name("pdpatrol"))


@pytest.fixture(scope="module")
def mission(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("a mission ü")
    run_mission(load_scenario("one_source", {"task.time_limit_s": 10.0}), "patrol").save(folder)
    return folder


def export(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([PDPATROL, "export", *arguments], cwd=cwd, capture_output=True, text=True, timeout=120)


def test_all_is_written_and_a_map_asked_for_where_it_can_be(mission: Path, tmp_path: Path) -> None:
    done = export(str(mission), "--out", "out", cwd=tmp_path)
    assert done.returncode == 0
    names = {"findings.csv", "steps.parquet", "pulses.parquet", "mission.mcap"}
    assert {path.name for path in (tmp_path / "out").iterdir()} == names
    assert all(name in done.stdout for name in names)
    (line,) = done.stderr.strip().splitlines()
    assert line == "note: no findings.geojson, for the scenario has no table [georeference]"


def test_nothing_is_overwritten_and_what_is_no_mission_is_refused(mission: Path, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine").touch()
    for arguments in ((str(mission), "--out", "out"), ("out",), ("nowhere",)):
        done = export(*arguments, cwd=tmp_path)
        assert done.returncode == 2
        assert len(done.stderr.strip().splitlines()) == 1
    assert [path.name for path in tmp_path.rglob("*")] == ["out", "mine"]
