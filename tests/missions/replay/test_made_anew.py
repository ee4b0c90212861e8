"""A recording that is missing, of another Rerun or damaged is made anew from the log, wherever the folder is."""

from collections.abc import Callable
from pathlib import Path

import pytest
import rerun as rr

from dirmusic import InputFileError
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.recording import check_recording, ready_recording, write_recording
from tests.missions.replay.short_mission import pdpatrol, short_mission


@pytest.fixture(scope="module")
def log() -> MissionLog:
    return short_mission()


@pytest.fixture
def folder(log: MissionLog, tmp_path: Path) -> Path:
    folder = tmp_path / "Prüffeld 1, [süd] €"
    folder.mkdir()
    log.save(folder)
    write_recording(log, folder / "mission.rrd")
    return folder


def by_another_rerun(data: bytes) -> bytes:
    return data[:4] + bytes([0, 40, 3]) + data[7:]


BROKEN = [
    (by_another_rerun, f"was written by Rerun 0.40.3, and this is Rerun {rr.__version__}"),
    (lambda data: b"", "is empty"),
    (lambda data: data[:5], "is cut short"),
    (lambda data: data[: len(data) // 2], "is cut short"),
    (lambda data: data[:64] + bytes(2000) + data[2064:], "is damaged"),
]


def test_a_whole_recording_of_this_rerun_is_left_as_it_is(folder: Path) -> None:
    before = (folder / "mission.rrd").stat()
    told: list[str] = []
    assert ready_recording(folder, told.append) == folder / "mission.rrd"
    assert (folder / "mission.rrd").stat().st_mtime_ns == before.st_mtime_ns
    assert not told


@pytest.mark.parametrize(("change", "why"), BROKEN)
def test_a_recording_of_another_rerun_or_a_damaged_one_is_made_anew(
    folder: Path, change: Callable[[bytes], bytes], why: str
) -> None:
    path, log = folder / "mission.rrd", (folder / "log.npz").read_bytes()
    path.write_bytes(change(path.read_bytes()))
    told: list[str] = []
    check_recording(ready_recording(folder, told.append))
    assert told == [f"{path}: {why}; it is made anew from the log"]
    assert (folder / "log.npz").read_bytes() == log
    assert {each.name for each in folder.iterdir()} == {"log.npz", "mission.rrd"}


@pytest.mark.parametrize(("change", "why"), BROKEN)
def test_without_a_log_one_line_says_what_is_wrong_and_the_file_stays(
    folder: Path, change: Callable[[bytes], bytes], why: str
) -> None:
    path = folder / "mission.rrd"
    path.write_bytes(broken := change(path.read_bytes()))
    (folder / "log.npz").unlink()
    with pytest.raises(InputFileError) as refused:
        ready_recording(folder, lambda fault: None)
    assert refused.value.faults == (f"{path}: {why}; there is no log beside it to make it anew from",)
    assert path.read_bytes() == broken


@pytest.mark.parametrize("is_full", [True, False])
def test_a_full_disk_or_a_place_that_cannot_be_written_is_one_line_and_the_log_stays(
    folder: Path, is_full: bool
) -> None:
    log = (folder / "log.npz").read_bytes()
    (folder / "mission.rrd").unlink()
    if not is_full:  # a test may run as one who may write anywhere, but nobody can write a file over a folder
        (folder / "mission.rrd").mkdir()
    done = pdpatrol("replay", folder.name, "--web", cwd=folder.parent, most_bytes=2000 if is_full else None)
    assert done.returncode == 1
    (line,) = done.stderr.strip().splitlines()[-1:]
    assert ("File too large" if is_full else "Is a directory") in line
    assert "Traceback" not in done.stderr
    assert (folder / "log.npz").read_bytes() == log
    assert not list(folder.glob(".*"))
