"""Damaged logs, recordings, datasets and calibrations are refused in one line each."""

import json
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dirmusic import InputFileError
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.recording import write_recording
from pdpatrol.missions.sweep.dataset import Dataset
from tests.missions.conftest import Refused
from tests.missions.field.surveys import EXAMPLE, log_of_table
from tests.missions.files import hostile


@pytest.fixture(scope="module")
def mission(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("mission")
    log = log_of_table(EXAMPLE)
    log.save(folder)
    write_recording(log, folder / "mission.rrd")
    return folder


def arrays_of(folder: Path) -> dict[str, np.ndarray]:
    """Read all columns and the metadata of a log."""
    with np.load(folder / "log.npz") as archive:
        return dict(archive)


def is_refused(folder: Path, data: bytes) -> bool:
    """Return True if a log is refused in one line that names it, False if it can be read."""
    (folder / "log.npz").write_bytes(data)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            MissionLog.load(folder)
        except ValueError as error:
            fault = str(error)
        else:
            return False
    assert fault.startswith(f"{folder / 'log.npz'}: ")
    assert "\n" not in fault
    return True


def test_damaged_log_is_refused_or_unchanged(mission: Path, tmp_path: Path) -> None:
    whole = (mission / "log.npz").read_bytes()
    assert not is_refused(tmp_path, whole)
    rng = np.random.default_rng(1)
    refused = sum(is_refused(tmp_path, hostile.mutated(whole, rng)) for _ in range(100))
    assert refused > 50


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"meta": np.array("{}")}, "is not the log of a mission .no metadata of schema 8"),
        ({"meta": np.array({"schema": 7})}, "Object arrays cannot be loaded"),
        ({"meta": np.array('{"schema": 3}')}, "no metadata of schema 8, which this version reads"),
        ({"x": np.array(1)}, "meta is not a file in the archive"),
    ],
)
def test_archive_that_is_not_a_log_is_refused(tmp_path: Path, arrays: dict[str, np.ndarray], message: str) -> None:
    (tmp_path / "log.npz").write_bytes(hostile.packed(arrays))
    with pytest.raises(ValueError, match=message):
        MissionLog.load(tmp_path)


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("pulse.step", lambda x: x + 1000, "refers to missing rows of table step"),
        ("pulse.step", lambda x: x[1:], "the columns of table pulse have different lengths"),
        ("step.pose", lambda x: x[:, :2], "step.pose holds float64 in rows of shape"),
        ("step.time_s", lambda x: x.astype(str), "step.time_s holds <U"),
    ],
)
def test_log_with_inconsistent_tables_is_refused(
    mission: Path, tmp_path: Path, name: str, change: Callable[[np.ndarray], np.ndarray], message: str
) -> None:
    arrays = arrays_of(mission)
    (tmp_path / "log.npz").write_bytes(hostile.packed({**arrays, name: change(arrays[name])}))
    with pytest.raises(ValueError, match=message):
        MissionLog.load(tmp_path)


@pytest.mark.whole
def test_replay_refuses_a_log_with_damaged_metadata(mission: Path, tmp_path: Path, refused: Refused) -> None:
    damaged = np.array(json.dumps({"schema": 8, "array": 7}))
    (tmp_path / "log.npz").write_bytes(hostile.packed({**arrays_of(mission), "meta": damaged}))
    (line,) = refused("replay", ".", cwd=tmp_path)
    assert "the metadata in its log are damaged" in line
    assert [path.name for path in tmp_path.iterdir()] == ["log.npz"]


@pytest.mark.whole
def test_replay_refuses_a_recording_without_log(tmp_path: Path, refused: Refused) -> None:
    (tmp_path / "mission.rrd").write_bytes(b"junk")
    (line,) = refused("replay", "--web", ".", cwd=tmp_path)
    assert "holds no log.npz" in line


MANIFEST = {"version": 2, "plan": "p", "code": "c", "n_missions": 1, "suite": ""}


@pytest.mark.parametrize(
    ("manifest", "message"),
    [
        ("", "sweep.json: Invalid JSON"),
        ("[" * 9000, "sweep.json: Invalid JSON"),
        (json.dumps({**MANIFEST, "n_missions": "3"}), "sweep.json: n_missions: Input should be a valid integer"),
        (
            json.dumps({**MANIFEST, "version": 9}),
            "must be of format 2, got 9, whose scores differ",
        ),
    ],
)
def test_damaged_manifest_of_a_sweep_is_refused(tmp_path: Path, manifest: str, message: str) -> None:
    (tmp_path / "sweep.json").write_text(manifest)
    with pytest.raises(InputFileError, match=message):
        Dataset(tmp_path)


@pytest.mark.parametrize("data", [b"", b"PAR1", b"junk" * 100])
def test_damaged_rows_of_a_sweep_are_refused(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "sweep.json").write_text(json.dumps(MANIFEST))
    (tmp_path / "rows.parquet").write_bytes(data)
    dataset = Dataset(tmp_path)
    for read in (dataset.read, lambda: dataset.job(0)):
        with pytest.raises(InputFileError, match=r"rows.parquet: cannot be read"):
            read()
