"""Births: unassigned pulses that make a new candidate."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.angles import difference
from dirmusic.array.element_errors import ElementErrors
from dirmusic.locating.association.assignment import NoOwner
from dirmusic.locating.association.pulse_record import PulseRecord, Rows, evenly
from dirmusic.locating.finding import Finding
from dirmusic.locating.fitting.joint_fix import with_height_covariance
from dirmusic.locating.fitting.triangulation import triangulate
from dirmusic.locating.rules import LocatingRules

FloatArray = NDArray[np.float64]

UNKNOWN_M = 10.0
"""Range of a position of which only the bearing is known, and its standard deviation, until the first fit (assumed):
it may be close by."""


MOST_CROSSED = 4096
"""Lines of sight; of more, so many are evenly chosen."""


class Birth(NamedTuple):
    """Pulses that make a candidate.

    Attributes:
        rows: Rows of the pulses in their record.
        first_detected_s: When the first of them came.
        last_detected_s: When the last of them came.
        position_m: Where their lines of sight cross, at the height of which nothing is known, shape (3,).
        covariance_m2: Shape (3, 3).
    """

    rows: Rows
    first_detected_s: float
    last_detected_s: float
    position_m: FloatArray
    covariance_m2: FloatArray

    def candidate(self, number: int) -> Finding:
        """A finding of its own."""
        return Finding(
            id=number,
            state="candidate",
            position_m=self.position_m,
            covariance_m2=self.covariance_m2,
            n_bearings=self.rows.size,
            first_detected_s=self.first_detected_s,
            last_detected_s=self.last_detected_s,
            confirmed_s=None,
            aperture_rad=0.0,
            nearest_m=np.inf,
            level_db=np.nan,
        )


def find_birth(
    record: PulseRecord, owner: Rows, errors: ElementErrors, rules: LocatingRules, time_s: float, *, is_first: bool
) -> Birth | None:
    """The largest group of recent unassigned pulses from one direction, if it is large enough to make a candidate.

    Pulses from above make the first candidate alone: two waves at a time look like one from above.

    Args:
        record: All pulses.
        owner: Finding of each pulse or a code of `NoOwner`, shape (n,).
        errors: Errors of the array's elements as known by now.
        rules: How many pulses, from how wide an arc, in how long a time.
        time_s: Now.
        is_first: Whether there is neither a candidate nor a confirmed finding.
    """
    unassigned = np.flatnonzero((owner == NoOwner.UNASSIGNED) & (is_first | ~record.is_from_above))
    recent = unassigned[record.pulses.time_s[unassigned] > time_s - rules.birth_s]
    if recent.size < rules.birth_pulses:
        return None
    bearing, _ = record.bearings(recent, errors)
    n_near = _neighbours(bearing, rules.birth_arc_rad)
    rows = recent[np.abs(difference(bearing[n_near.argmax()], bearing)) < rules.birth_arc_rad]
    if rows.size < rules.birth_pulses and rules.birth_by_crossing:
        rows = _crossing_rows(record, evenly(recent, rules.max_pulses), errors)
    if rows.size < rules.birth_pulses:
        return None
    position_m, covariance_m2 = record.crossing(evenly(rows, MOST_CROSSED), errors)
    if not np.isfinite(covariance_m2).all():
        sight_m = position_m[:2] - record.pose[rows[-1], :2]
        position_m[:2] -= sight_m * (1.0 - UNKNOWN_M / max(float(np.linalg.norm(sight_m)), UNKNOWN_M))
        covariance_m2 = with_height_covariance(np.eye(2) * UNKNOWN_M**2)
    first_s, last_s = record.pulses.time_s[rows[[0, -1]]].tolist()
    return Birth(rows, first_s, last_s, position_m, covariance_m2)


def _neighbours(bearing_rad: FloatArray, arc_rad: float) -> NDArray[np.intp]:
    """How many of some bearings (n,) lie within an arc to either side of each, shape (n,)."""
    turned_rad = np.mod(bearing_rad, 2 * np.pi)
    sorted_rad = np.sort(turned_rad)
    around_rad = np.concatenate([sorted_rad - 2 * np.pi, sorted_rad, sorted_rad + 2 * np.pi])
    above = np.searchsorted(around_rad, turned_rad + arc_rad, side="left")
    return above - np.searchsorted(around_rad, turned_rad - arc_rad, side="right")


def _crossing_rows(record: PulseRecord, rows: Rows, errors: ElementErrors) -> Rows:
    """Those of some pulses whose lines of sight cross at one place."""
    return rows[triangulate(record.pose[rows, :2], *record.bearings(rows, errors)).is_inlier]
