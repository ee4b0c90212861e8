"""What the phases of the pulses of each finding say of the kind of discharge."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dirmusic.angles import wrap
from dirmusic.locating.confirmation import LEVEL_QUANTILE
from dirmusic.pulses.phase_resolved import PhasePattern, classify
from pdpatrol.missions.record.finding_pulses import finding_pulses
from pdpatrol.missions.record.mission_log import MissionLog

FloatArray = NDArray[np.float64]

NEIGHBOURS = 41
"""Pulses about one, in order of time, whose median is what the place takes away (assumed; two seconds of a mission)."""


@dataclass(frozen=True, kw_only=True)
class PhaseResolved:
    """Pulse phase against level for one finding.

    Attributes:
        pulse: Rows in the table of pulses, shape (n,).
        phase_rad: Of the receiver's own mains at each pulse, shape (n,), in (-pi, pi].
        level_db: Strength with range and gain taken out: decibels over one volt at 1 m, shape (n,).
        pattern: What kind of discharge that is like.
    """

    pulse: NDArray[np.intp]
    phase_rad: FloatArray
    level_db: FloatArray
    pattern: PhasePattern


def phase_patterns(log: MissionLog) -> dict[int, PhaseResolved]:
    """Phase and level of the pulses that the Locator associated with each finding, by its id.

    The level takes out range and gain, and what comes and goes as the robot drives: obstruction, reflections, height.

    Args:
        log: A mission that has ended; one that was killed has no association.

    Returns:
        Nothing for a finding without pulses of known mains phase.
    """
    from scipy.ndimage import median_filter  # here, so that a command line help need not wait for it

    patterns: dict[int, PhaseResolved] = {}
    for number, pulses in finding_pulses(log).items():
        own = pulses.take(np.isfinite(pulses.mains_phase_rad))
        if own.time_s.size == 0:
            continue
        usual_db = median_filter(own.level_db, size=NEIGHBOURS, mode="nearest")
        level_db = own.level_db + np.quantile(usual_db, LEVEL_QUANTILE) - usual_db
        phase_rad = wrap(own.mains_phase_rad)
        pattern = classify(phase_rad, level_db)
        patterns[number] = PhaseResolved(pulse=own.pulse, phase_rad=phase_rad, level_db=level_db, pattern=pattern)
    return patterns
