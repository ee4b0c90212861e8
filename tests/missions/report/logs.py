"""Logs of missions, made in a moment."""

import numpy as np

from dirmusic import GainManifold
from pdpatrol.missions.record.mission_log import MissionLog


def empty_log() -> MissionLog:
    """Of a mission without scenario, in which nothing has happened."""
    ring = GainManifold.ring(6)
    array = {"boresights_rad": ring.boresights_rad.tolist(), "positions_m": np.zeros((6, 3)).tolist()}
    return MissionLog(
        {"name": "yard", "seed": 1, "policy": "seek", "n_elements": 6, "array": array, "bounds_m": [[0, 0], [20, 20]]}
    )
