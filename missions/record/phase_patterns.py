"""Which pulses belong to which finding, and what their phases say of its kind."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dirmusic import GainManifold, GaussianPattern, TabulatedPattern
from dirmusic.angles import difference, wrap
from dirmusic.locating.confirmation import LEVEL_QUANTILE
from dirmusic.pulses.phase_resolved import PhasePattern, classify
from missions.record.mission_log import MissionLog

FloatArray = NDArray[np.float64]

GATE_RAD = np.radians(8.0)
"""A bearing belongs to the finding that lies within this of it, if no other does (assumed)."""

NEIGHBOURS = 41
"""Pulses about one, in order of time, whose median is what the place takes away (assumed; two seconds of a mission)."""

HIDDEN_DB = 10.0
"""Where so much is taken away, something stands in between, and what is heard came round a corner (assumed)."""


@dataclass(frozen=True, kw_only=True)
class PhaseResolved:
    """Pulse phase against level for one finding.

    Attributes:
        phase_rad: Of the receiver's own mains at each pulse, shape (n,), in (-pi, pi].
        level_db: Strength with range and gain taken out: decibels over one volt at 1 m, shape (n,).
        pattern: What kind of discharge that is like.
    """

    phase_rad: FloatArray
    level_db: FloatArray
    pattern: PhasePattern


def nominal_manifold(log: MissionLog) -> GainManifold:
    """The data sheet of the array that a log tells of."""
    array = log.meta["array"]
    pattern = TabulatedPattern(**array["pattern"]) if array.get("pattern") else GaussianPattern()
    return GainManifold(pattern, array["boresights_rad"])


def phase_patterns(log: MissionLog) -> dict[int, PhaseResolved]:
    """Phase and level of the pulses of each finding that is there at the end, by its id; none without mains phase.

    The level takes out range and gain, and what comes and goes as the robot drives: obstruction, reflections, height.
    """
    from scipy.ndimage import median_filter  # here, so that a command line help need not wait for it

    finding, bearing, pulse = log.table("finding"), log.table("bearing"), log.table("pulse")
    if finding["step"].size == 0 or bearing["pulse"].size == 0:
        return {}
    last = np.flatnonzero((finding["step"] == finding["step"][-1]) & (finding["state"] != "dropped"))
    phase = pulse["mains_phase_rad"][bearing["pulse"]]
    pose = log.column("step", "pose")[pulse["step"][bearing["pulse"]]]
    sight = finding["position_m"][last][:, np.newaxis] - pose[:, :2]  # (n_findings, n_bearings, 2)
    off = np.abs(difference(np.arctan2(sight[..., 1], sight[..., 0]), bearing["bearing_rad"]))
    is_near = (off < GATE_RAD) & ((off < GATE_RAD).sum(axis=0) == 1) & np.isfinite(phase)
    gain = np.linalg.norm(nominal_manifold(log).gain(bearing["azimuth_rad"]), axis=0)
    strength = np.linalg.norm(pulse["strengths_v"][bearing["pulse"]], axis=-1) / gain
    patterns: dict[int, PhaseResolved] = {}
    for k, row in enumerate(last):
        own = np.flatnonzero(is_near[k])
        if own.size:
            range_m = np.linalg.norm(sight[k, own], axis=-1)
            level_db = 20 * np.log10(strength[own] * range_m)
            usual_db = median_filter(level_db, size=NEIGHBOURS, mode="nearest")
            in_sight_db = np.quantile(usual_db, LEVEL_QUANTILE)
            level_db += in_sight_db - usual_db
            seen = usual_db > in_sight_db - HIDDEN_DB
            own, level_db = own[seen], level_db[seen]
            patterns[int(finding["id"][row])] = PhaseResolved(
                phase_rad=wrap(phase[own]), level_db=level_db, pattern=classify(phase[own], level_db)
            )
    return patterns
