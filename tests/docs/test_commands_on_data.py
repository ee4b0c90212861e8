"""Commands of the documentation that read a recording or the rows of a sweep run on such files."""

from pathlib import Path

import pytest

from pdpatrol.missions.export.ros2_recording import write_ros2_recording
from tests.docs.site import ROOT
from tests.docs.test_commands import DATA_PAGES, PAGES, lines, run
from tests.missions.export.test_round_trip import write_bag
from tests.missions.field.gap_recordings import YARD, Planted, record
from tests.missions.field.surveys import log_of_table
from tests.missions.field.test_turns import write_turns

pytestmark = pytest.mark.whole

EXAMPLE = ROOT / "examples" / "locate" / "strengths.csv"
RESULTS = ROOT / "docs" / "results"
ALIASES = {"before": "noise", "after": "noise"}
"""Stored sweeps that stand for those of the reader."""


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the files that the commands name."""
    folder = tmp_path_factory.mktemp("recordings")
    (folder / "examples").symlink_to(ROOT / "examples")
    record(folder / "survey.csv", 200, Planted(), n_poses=20)
    (folder / "yard.toml").write_bytes(YARD.read_bytes())
    write_turns(folder / "turns.csv")
    write_ros2_recording(log_of_table(EXAMPLE), folder / "survey.mcap")
    write_bag(folder / "rosbag2_folder")
    return folder


@pytest.mark.parametrize("line", [line for name in DATA_PAGES[:2] for line in lines(PAGES[name])])
def test_command_reads_a_recording(line: str, recordings: Path) -> None:
    assert run([line + " --idle-s 1" * ("--follow" in line)], recordings)


@pytest.mark.parametrize(
    "line", sorted({line for name in DATA_PAGES[2:] for line in lines(PAGES[name]) if "pdpatrol results" in line})
)
def test_command_reads_the_rows_of_a_sweep(line: str, tmp_path: Path) -> None:
    for stored in RESULTS.iterdir():
        (tmp_path / stored.name).symlink_to(stored)
    for alias, name in ALIASES.items():
        (tmp_path / alias).symlink_to(RESULTS / name)
    assert run([line], tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("line", [line for line in lines(PAGES["suite.md"]) if line.startswith("pdpatrol run")])
def test_command_runs_a_mission_of_the_suite(line: str, tmp_path: Path) -> None:
    assert run([line], tmp_path)
