"""Logs of missions made without running one."""

import math
from collections.abc import Callable

import numpy as np

from dirmusic import GainManifold
from pdpatrol.missions.record.mission_log import MissionLog
from tests.missions.field.surveys import EXAMPLE, log_of_table
from tests.missions.replay.short_mission import copy_of
from tests.missions.test_phase_patterns import log_of_two_findings


def empty_log() -> MissionLog:
    """Return the log of a mission without scenario in which nothing has happened."""
    ring = GainManifold.ring(6)
    array = {"boresights_rad": ring.boresights_rad.tolist(), "positions_m": np.zeros((6, 3)).tolist()}
    return MissionLog(
        {"name": "yard", "seed": 1, "policy": "seek", "n_elements": 6, "array": array, "bounds_m": [[0, 0], [20, 20]]}
    )


def two_findings(*, mains_hz: float = 50.0) -> MissionLog:
    """Return the log of a mission with two findings."""
    log = log_of_two_findings(1, mains_hz)
    log.meta["bounds_m"] = [[-5.0, -5.0], [20.0, 20.0]]
    return log


def killed_log() -> MissionLog:
    """Return the log of a mission that was killed before it could write its associations."""
    return copy_of(two_findings(), "step", "pulse", "bearing", "finding")


def add_finding(
    log: MissionLog, step: int, number: int, state: str, position_m: tuple[float, ...], **row: object
) -> None:
    """Append a finding to a log."""
    known: dict[str, object] = {
        "covariance_m2": 0.01 * np.eye(3), "existence": 0.9, "possibly_two": False, "n_bearings": 30,
        "first_detected_s": 0.0, "confirmed_s": np.nan, "aperture_rad": 0.3, "level_db": -10.0,
    }  # fmt: skip
    log.append("finding", step=step, id=number, state=state, position_m=np.array(position_m), **{**known, **row})


LOGS: dict[str, Callable[[], MissionLog]] = {
    "two_findings": two_findings,
    "no_mains": lambda: two_findings(mains_hz=math.nan),
    "killed": killed_log,
    "empty": empty_log,
    "field": lambda: log_of_table(EXAMPLE, date="2026-03-02"),
}
