"""The pulses that the Locator associated with each finding: when, from where and how strong."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdpatrol.missions.record.array_description import described_manifold
from pdpatrol.missions.record.mission_log import MissionLog

FloatArray = NDArray[np.float64]

NEAREST_M = 0.1
"""Ranges are taken as no less (assumed): an array has a size."""


AT_ONCE = 10_000
"""Gains of so many pulses are worked out at a time, for they take half a kilobyte each."""


class FindingPulses(NamedTuple):
    """Pulses of one finding in order of time, n rows.

    Attributes:
        pulse: Rows of the log's table `pulse`, shape (n,).
        time_s: Of the end of the step in which each came, shape (n,).
        pose: Believed x m, y m, yaw rad, world frame, from which it was detected, shape (n, 3).
        bearing_rad: World frame, shape (n,).
        range_m: Distance on plan to where the finding was last taken to be, shape (n,).
        level_db: Strength with range and gain taken out: decibels over one volt at 1 m, shape (n,).
        mains_phase_rad: Of the receiver's own mains at each pulse, shape (n,); NaN where it is not known.
    """

    pulse: NDArray[np.intp]
    time_s: FloatArray
    pose: FloatArray
    bearing_rad: FloatArray
    range_m: FloatArray
    level_db: FloatArray
    mains_phase_rad: FloatArray

    def take(self, rows: NDArray[np.bool_]) -> FindingPulses:
        """Those at some rows, by mask (n,)."""
        return FindingPulses(**{name: column[rows] for name, column in self._asdict().items()})


def finding_pulses(log: MissionLog) -> dict[int, FindingPulses]:
    """The pulses of each finding by its id; nothing of a mission that was killed, which has no association.

    Pulses that came from where the pattern of the array has no gain have no level, and are left out.
    """
    table, association, bearing = log.table("finding"), log.table("association"), log.table("bearing")
    pulse, step, manifold = log.table("pulse"), log.table("step"), described_manifold(log.meta["array"])
    found: dict[int, FindingPulses] = {}
    for number in np.unique(association["finding"][association["finding"] > 0]).tolist():
        own = np.flatnonzero(association["finding"] == number)  # a bearing for each row of the association
        rows = association["pulse"][own]
        position_m = table["position_m"][np.flatnonzero(table["id"] == number)[-1]]
        pose = step["pose"][pulse["step"][rows]]
        range_m = np.maximum(np.linalg.norm(position_m[:2] - pose[:, :2], axis=-1), NEAREST_M)
        pieces = np.array_split(bearing["azimuth_rad"][own], 1 + own.size // AT_ONCE)
        gain = np.concatenate([np.linalg.norm(manifold.gain(azimuth_rad), axis=0) for azimuth_rad in pieces])
        strength_v = np.linalg.norm(pulse["strengths_v"][rows], axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            level_db = 20 * np.log10(strength_v / gain * range_m)
        found[number] = FindingPulses(
            pulse=rows,
            time_s=step["time_s"][pulse["step"][rows]],
            pose=pose,
            bearing_rad=bearing["bearing_rad"][own],
            range_m=range_m,
            level_db=level_db,
            mains_phase_rad=pulse["mains_phase_rad"][rows],
        ).take(np.isfinite(level_db))
    return found
