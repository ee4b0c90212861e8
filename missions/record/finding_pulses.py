"""Pulses of each finding: when, from where and how strong they were, and at which phases of the mains."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from dirmusic.angles import wrap
from dirmusic.locating.confirmation import LEVEL_QUANTILE
from dirmusic.pulses.phase_resolved import PhasePattern, classify
from pdpatrol.missions.record.log_contents import described_manifold
from pdpatrol.missions.record.mission_log import MissionLog

FloatArray = NDArray[np.float64]

LEVEL_WINDOW_PULSES = 41
"""Pulses of the moving median that removes the effect of the place from levels. Assumed; two seconds of a mission."""


class FindingPulses(NamedTuple):
    """Pulses of one finding in order of time, n rows.

    Attributes:
        pulse: Rows of the log's table `pulse`, shape (n,).
        time_s: End of the step of each pulse, shape (n,).
        pose: Estimated pose at detection: x m, y m, yaw rad, world frame, shape (n, 3).
        bearing_rad: Bearing, world frame, shape (n,).
        range_m: Horizontal distance to the last position of the finding, shape (n,).
        level_db: Strength corrected for range and gain, decibels over one volt at 1 m, shape (n,).
        mains_phase_rad: Phase of the receiver's mains, shape (n,); NaN if unknown.
    """

    pulse: NDArray[np.intp]
    time_s: FloatArray
    pose: FloatArray
    bearing_rad: FloatArray
    range_m: FloatArray
    level_db: FloatArray
    mains_phase_rad: FloatArray

    def take(self, rows: NDArray[np.bool_]) -> FindingPulses:
        """Return some rows, by mask (n,)."""
        return FindingPulses(**{name: column[rows] for name, column in self._asdict().items()})


def finding_pulses(log: MissionLog) -> dict[int, FindingPulses]:
    """Return the pulses of each finding by its id; empty for a killed mission, which has no association.

    Pulses from directions in which the array has no gain have no level and are left out.
    """
    table, association, bearing = log.table("finding"), log.table("association"), log.table("bearing")
    pulse, step, manifold = log.table("pulse"), log.table("step"), described_manifold(log.meta["array"])
    found: dict[int, FindingPulses] = {}
    for number in np.unique(association["finding"][association["finding"] > 0]).tolist():
        own = np.flatnonzero(association["finding"] == number)  # association and bearing have the same rows
        rows = association["pulse"][own]
        position_m = table["position_m"][np.flatnonzero(table["id"] == number)[-1]]
        pose = step["pose"][pulse["step"][rows]]
        range_m = np.maximum(np.linalg.norm(position_m[:2] - pose[:, :2], axis=-1), 0.1)  # about the array's size
        chunks = np.array_split(bearing["azimuth_rad"][own], 1 + own.size // 10_000)  # half a kilobyte per pulse
        gain = np.concatenate([np.linalg.norm(manifold.gain(azimuth_rad), axis=0) for azimuth_rad in chunks])
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


@dataclass(frozen=True, kw_only=True)
class PhaseResolved:
    """Phase-resolved pattern of one finding.

    Attributes:
        pulse: Rows of the log's table `pulse`, shape (n,).
        phase_rad: Phase of the receiver's mains at each pulse, shape (n,), in (-pi, pi].
        level_db: Strength corrected for range, gain and place, decibels over one volt at 1 m, shape (n,).
        pattern: Kind of discharge that the pattern resembles.
    """

    pulse: NDArray[np.intp]
    phase_rad: FloatArray
    level_db: FloatArray
    pattern: PhasePattern


def phase_patterns(log: MissionLog) -> dict[int, PhaseResolved]:
    """Return the phase-resolved pattern of each finding with pulses of known mains phase, by its id.

    Levels are corrected for range, gain, and changes while the robot drives: obstruction, reflections, height.

    Args:
        log: A mission that has ended; a killed one has no association.
    """
    patterns: dict[int, PhaseResolved] = {}
    for number, pulses in finding_pulses(log).items():
        own = pulses.take(np.isfinite(pulses.mains_phase_rad))
        if own.time_s.size == 0:
            continue
        usual_db = median_filter(own.level_db, size=LEVEL_WINDOW_PULSES, mode="nearest")
        level_db = own.level_db + np.quantile(usual_db, LEVEL_QUANTILE) - usual_db
        phase_rad = wrap(own.mains_phase_rad)
        pattern = classify(phase_rad, level_db)
        patterns[number] = PhaseResolved(pulse=own.pulse, phase_rad=phase_rad, level_db=level_db, pattern=pattern)
    return patterns
