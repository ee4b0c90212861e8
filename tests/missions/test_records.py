"""The log of a mission is written and read back."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pdpatrol.missions.record.mission_log import TABLES, MissionLog
from tests.missions.steps import append_step


def log_of(n_steps: int) -> MissionLog:
    log = MissionLog({"n_elements": 6})
    for k in range(n_steps):
        append_step(log, 0.1 * k, np.full(3, k))
        values = {"strengths_v": np.arange(6.0), "std_v": np.ones(6), "mains_phase_rad": 0.1}
        log.append("pulse", step=k, is_clipped=False, is_used=True, **values)
    return log


def test_log_is_read_back_as_written(tmp_path: Path) -> None:
    log = log_of(30)
    log.save(tmp_path)
    back = MissionLog.load(tmp_path)
    assert back.meta == log.meta
    for table in TABLES:
        for name, column in log.table(table).items():
            np.testing.assert_array_equal(back.column(table, name), column)
            assert back.column(table, name).shape == column.shape
    assert [path.name for path in tmp_path.iterdir()] == ["log.npz"]


@pytest.mark.whole
@settings(deadline=None, max_examples=40)
@given(st.text(max_size=300), st.text(max_size=3000), st.text(max_size=100), st.integers(0, 9))
def test_logged_texts_are_read_back_complete(phase: str, text: str, subject: str, number: int) -> None:
    """No text is cut, in the log file as in its parts; NumPy drops NUL characters at the end of a text."""
    log = MissionLog({"n_elements": 6})
    with TemporaryDirectory() as name:
        for part in range(2):
            append_step(log, 0.1 * part, np.zeros(3), phase=phase, phase_target=number)
            log.event("error", text, number, subject)
            log.write_part(Path(name))
            back = MissionLog.load(Path(name))
            assert back.column("step", "phase").tolist() == [phase.rstrip("\0")] * (part + 1)
            event = {column: values[-1] for column, values in back.table("event").items()}
            texts = {"subject": subject.rstrip("\0"), "text": text.rstrip("\0")}
            assert event == {"step": part, "kind": "error", "number": number, **texts}


def test_parts_of_a_killed_mission_are_read_back(tmp_path: Path) -> None:
    log = log_of(10)
    log.write_part(tmp_path)
    for k in range(10, 14):
        append_step(log, 0.1 * k, np.full(3, k))
    log.write_part(tmp_path)
    assert MissionLog.load(tmp_path).n_rows("step") == 14
    assert MissionLog.load(tmp_path).n_rows("pulse") == 10
    log.save(tmp_path)
    assert not (tmp_path / "log.parts").exists()
