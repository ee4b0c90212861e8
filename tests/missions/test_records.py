"""The log of a mission: written, cut short, read back."""

from pathlib import Path

import numpy as np
import pytest

from pdpatrol.missions.record.mission_log import TABLES, MissionLog

AT_REST = {"odometry": np.zeros(3), "battery": 1.0, "command": np.zeros(2)}


def log_of(n_steps: int) -> MissionLog:
    log = MissionLog({"n_elements": 6})
    for k in range(n_steps):
        log.append(
            "step",
            time_s=0.1 * k,
            pose=np.full(3, k),
            true_pose=np.full(3, k),
            **AT_REST,
            phase="patrol",
        )
        log.append("pulse", step=k, strengths_v=np.arange(6.0), mains_phase_rad=0.1, is_clipped=False, is_credible=True)
    return log


def test_a_log_reads_back_as_it_was_written(tmp_path: Path) -> None:
    log = log_of(30)
    log.save(tmp_path)
    back = MissionLog.load(tmp_path)
    assert back.meta == log.meta
    for table in TABLES:
        for name, column in log.table(table).items():
            np.testing.assert_array_equal(back.column(table, name), column)
            assert back.column(table, name).shape == column.shape
    assert [path.name for path in tmp_path.iterdir()] == ["log.npz"]


def test_a_killed_mission_keeps_its_parts_and_a_finished_one_has_none(tmp_path: Path) -> None:
    log = log_of(10)
    log.write_part(tmp_path)
    for k in range(10, 14):
        log.append(
            "step",
            time_s=0.1 * k,
            pose=np.full(3, k),
            true_pose=np.zeros(3),
            **AT_REST,
            phase="dock",
        )
    log.write_part(tmp_path)
    assert MissionLog.load(tmp_path).n_rows("step") == 14
    assert MissionLog.load(tmp_path).n_rows("pulse") == 10
    log.save(tmp_path)
    assert not (tmp_path / "log.parts").exists()


def test_a_row_with_a_column_missing_is_refused_and_leaves_the_table_even() -> None:
    log = log_of(3)
    with pytest.raises(ValueError, match="has the columns"):
        log.append("event", step=0, kind="end")
    assert log.n_rows("event") == 0


def test_a_log_of_another_schema_or_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="no log"):
        MissionLog.load(tmp_path)
    log = log_of(1)
    log.meta["schema"] = 99
    log.save(tmp_path)
    with pytest.raises(ValueError, match="schema 99"):
        MissionLog.load(tmp_path)
