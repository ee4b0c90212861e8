"""Steps of logs, and findings, made without a mission."""

from typing import Any

import numpy as np

from dirmusic import Finding
from pdpatrol.missions.record.mission_log import MissionLog


def append_step(log: MissionLog, time_s: float, pose: np.ndarray, **changed: object) -> None:
    """Append a step of a robot at rest, whose true pose is unknown unless it is given."""
    unknown = np.full(3, np.nan)
    known: dict[str, object] = {
        "true_pose": unknown, "odometry": unknown, "battery": 1.0, "command": np.zeros(2), "phase": "patrol",
        "phase_target": 0,
    }  # fmt: skip
    log.append("step", time_s=time_s, pose=pose, **{**known, **changed})


def candidate(position_m: tuple[float, ...], covariance_m2: np.ndarray, **changed: Any) -> Finding:  # noqa: ANN401
    """Return a candidate with the id 1."""
    known: dict[str, Any] = {
        "id": 1, "state": "candidate", "existence": 0.5, "n_bearings": 50, "first_detected_s": 0.0,
        "last_detected_s": 0.0, "confirmed_s": None, "aperture_rad": 0.3, "nearest_m": 6.0, "level_db": -10.0,
    }  # fmt: skip
    return Finding(position_m=np.array(position_m), covariance_m2=covariance_m2, **{**known, **changed})
