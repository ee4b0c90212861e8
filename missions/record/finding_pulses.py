"""Pulses of each finding: when, from where and how strong they were, and at which phases of the mains."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.ndimage import median_filter

from dirmusic.angles import wrap
from dirmusic.arrays import BoolArray, FloatArray, IntArray
from dirmusic.locating.confirmation import LEVEL_QUANTILE
from dirmusic.pulses.mains_offset import mains_offset_hz
from dirmusic.pulses.phase_resolved import PhasePattern, classify
from pdpatrol.missions.record.log_contents import described_manifold
from pdpatrol.missions.record.mission_log import MissionLog

LEVEL_WINDOW_PULSES = 41
"""Pulses in the moving median that removes the effect of the robot's position from levels. Assumed; two seconds of a
mission."""


class FindingPulses(NamedTuple):
    """Pulses of one finding in order of time, n rows.

    Attributes:
        pulse: Rows of the log's table `pulse`, shape (n,).
        time_s: End of the step of each pulse, shape (n,).
        range_m: Horizontal distance to the last position of the finding, shape (n,).
        level_db: Strength corrected for range and gain, decibels relative to one volt at 1 m, shape (n,).
        phase_rad: Phase of the receiver's mains, shape (n,), in (-pi, pi]; NaN if unknown.
    """

    pulse: IntArray
    time_s: FloatArray
    range_m: FloatArray
    level_db: FloatArray
    phase_rad: FloatArray

    def take(self, rows: BoolArray) -> FindingPulses:
        """Return some rows, by mask (n,)."""
        return FindingPulses._make(column[rows] for column in self)


def finding_pulses(log: MissionLog) -> dict[int, FindingPulses]:
    """Return the pulses of each finding by its id; empty for a killed mission, which has no association.

    Pulses from directions in which the array has no gain have no level and are omitted.
    """
    table, association, azimuth = log.table("finding"), log.table("association"), log.column("bearing", "azimuth_rad")
    pulse, step, manifold = log.table("pulse"), log.table("step"), described_manifold(log.meta["array"])
    found: dict[int, FindingPulses] = {}
    for number in np.unique(association["finding"][association["finding"] > 0]).tolist():
        own = association["finding"] == number  # association and bearing have the same rows
        rows = association["pulse"][own]
        at = pulse["step"][rows]
        position_m = table["position_m"][table["id"] == number][-1]
        offset_m = position_m[:2] - step["pose"][at, :2]
        range_m = np.maximum(np.linalg.norm(offset_m, axis=-1), 0.1)  # about the size of the array
        chunks = np.array_split(azimuth[own], 1 + rows.size // 10_000)  # half a kilobyte per pulse
        gain = np.concatenate([np.linalg.norm(manifold.gain(chunk), axis=0) for chunk in chunks])
        strength_v = np.linalg.norm(pulse["strengths_v"][rows], axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            level_db = 20 * np.log10(strength_v / gain * range_m)
        pulses = FindingPulses(rows, step["time_s"][at], range_m, level_db, wrap(pulse["mains_phase_rad"][rows]))
        found[number] = pulses.take(np.isfinite(level_db))
    return found


def phase_patterns(log: MissionLog) -> tuple[dict[int, tuple[FindingPulses, PhasePattern]], float]:
    """Return, by id, the pulses of each finding that have a known mains phase, and the pattern that they resemble.

    Their phases are corrected for an offset of the receiver's reference, and their levels also for changes while the
    robot drives: obstruction, reflections, height.

    Args:
        log: A mission that has ended; a killed one has no association.

    Returns:
        The patterns, and the frequency of the mains minus that of the reference, Hz; 0 if it is not significant.
    """
    patterns: dict[int, tuple[FindingPulses, PhasePattern]] = {}
    found = {number: pulses.take(np.isfinite(pulses.phase_rad)) for number, pulses in finding_pulses(log).items()}
    offset_hz = mains_offset_hz([own.time_s for own in found.values()], [own.phase_rad for own in found.values()])
    for number, own in found.items():
        if own.time_s.size:
            usual_db = median_filter(own.level_db, size=LEVEL_WINDOW_PULSES, mode="nearest")
            level_db = own.level_db + np.quantile(usual_db, LEVEL_QUANTILE) - usual_db
            phase_rad = wrap(own.phase_rad + 2 * np.pi * offset_hz * own.time_s)
            own = own._replace(level_db=level_db, phase_rad=phase_rad)
            patterns[number] = own, classify(own.phase_rad, own.level_db)
    return patterns, offset_hz
