"""Steps of logs made without a mission."""

import numpy as np

from pdpatrol.missions.record.mission_log import MissionLog


def append_step(log: MissionLog, time_s: float, pose: np.ndarray, **changed: object) -> None:
    """Append a step of a robot at rest, whose true pose is unknown unless it is given."""
    unknown = np.full(3, np.nan)
    known: dict[str, object] = {
        "true_pose": unknown, "odometry": unknown, "battery": 1.0, "command": np.zeros(2), "phase": "patrol",
        "phase_target": 0,
    }  # fmt: skip
    log.append("step", time_s=time_s, pose=pose, **{**known, **changed})
