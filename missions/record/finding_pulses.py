"""Pulses of each finding: when, from where and how strong they were, and at which phases of the mains."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.ndimage import median_filter

from dirmusic.angles import wrap
from dirmusic.array.manifold import GainManifold
from dirmusic.arrays import BoolArray, FloatArray, IntArray
from dirmusic.pulses.mains_offset import mains_offset_hz
from dirmusic.pulses.phase_resolved import PhasePattern, classify
from pdpatrol.missions.record.log_contents import array_height_of, described_manifold
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
        level_db: Strength corrected for distance and gain, decibels relative to one volt at 1 m, shape (n,). The map is
            not used: pulses out of sight have a lower level.
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


def loss_db(manifold: GainManifold, array_height_m: float, position_m: FloatArray, pose: FloatArray) -> FloatArray:
    """Compute the loss of strength due to distance and array gain, relative to 1 m, decibels, shape (n,).

    Args:
        manifold: Manifold of the array.
        array_height_m: Height of the array above the ground.
        position_m: Position of the source, world frame, shape (3,).
        pose: Poses of the robot, shape (n, 3).
    """
    x, y = (position_m[:2] - pose[:, :2]).T
    distance_m, rise_m = np.maximum(np.hypot(x, y), 0.1), position_m[2] - array_height_m  # about the size of the array
    off_rad = (np.arctan2(y, x) - pose[:, 2])[:, np.newaxis] - manifold.boresights_rad
    gain = manifold.response_in_space(off_rad, np.arctan2(rise_m, distance_m)[:, np.newaxis]).gain
    return 20 * np.log10(np.hypot(distance_m, rise_m) / np.linalg.norm(gain, axis=-1))


def finding_pulses(log: MissionLog) -> dict[int, FindingPulses]:
    """Return the pulses of each finding by its id; empty for a killed mission, which has no association.

    Pulses from directions in which the array has no gain have no level and are omitted.
    """
    table, association = log.table("finding"), log.table("association")
    pulse, step, manifold = log.table("pulse"), log.table("step"), described_manifold(log.meta["array"])
    found: dict[int, FindingPulses] = {}
    for number in np.unique(association["finding"][association["finding"] > 0]).tolist():
        rows = association["pulse"][association["finding"] == number]
        steps, at = np.unique(pulse["step"][rows], return_inverse=True)
        position_m, pose = table["position_m"][table["id"] == number][-1], step["pose"][steps]
        strength_v = np.linalg.norm(pulse["strengths_v"][rows], axis=-1)
        with np.errstate(divide="ignore"):
            level_db = 20 * np.log10(strength_v) + loss_db(manifold, array_height_of(log), position_m, pose)[at]
        pulses = FindingPulses(
            pulse=rows,
            time_s=step["time_s"][steps][at],
            range_m=np.linalg.norm(position_m[:2] - pose[:, :2], axis=-1)[at],
            level_db=level_db,
            phase_rad=wrap(pulse["mains_phase_rad"][rows]),
        )
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
            level_db = own.level_db + np.median(usual_db) - usual_db
            phase_rad = wrap(own.phase_rad + 2 * np.pi * offset_hz * own.time_s)
            own = own._replace(level_db=level_db, phase_rad=phase_rad)
            patterns[number] = own, classify(own.phase_rad, own.level_db)
    return patterns, offset_hz
