"""Track initiation: a hypothetical source where lines of sight of unexplained pulses cross."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import rel_entr

from dirmusic.angles import difference, unit_vector
from dirmusic.arrays import BoolArray, FloatArray, IntArray
from dirmusic.locating.bearing_fit import INLIER_SIGMAS, triangulate
from dirmusic.locating.finding import ellipse95
from dirmusic.locating.joint_fit import with_height, with_height_covariance
from dirmusic.locating.pulse_pool import Groups, choose_evenly

LARGEST_STD_RAD, EXTRA_STD_RAD = np.radians(25.0), np.radians(4.0)
"""Largest standard deviation of a direction that initiates a track, and standard deviation of the errors of array and
method that is added for the crossing and for the weights of levels (assumed)."""

RECENT_S, SECTOR_RAD, SECTOR_PULSES = 10.0, np.radians(10.0), 6
"""Age, half the width of a sector, and number of pulses in it that initiate a track at once (assumed)."""

LEAST_PULSES, LEAST_WINDOWS = 4, 4
"""Number of pulses and of windows with pulses that initiate a track where the lines of sight cross, whatever their age
(assumed)."""

INITIATION_S, MAX_ROWS = 60.0, 200
"""Time over which the latest groups are searched, longer if they are few, and number that is searched, evenly spread
(assumed)."""

MAX_ATTEMPTS = 5
"""Number of crossings that are tried if the first ones are positions of known sources (assumed)."""

INITIAL_RANGE_M, LEAST_RANGE_M = 10.0, 0.5
"""Largest initial range of a source of which only the direction is known, and least range of a crossing (assumed)."""

APART_M, CANDIDATE_APART_M = 2.0, 0.3
"""Least horizontal distance of a new track from confirmed ones and from candidates (assumed). Closer to a confirmed
one, reflections cause crossings, and `compare_with_two` finds second sources."""

OF_UNEXPLAINED, OF_MULTIPATH = 5.0, 15.0
"""Least log likelihood ratio of a crossing against chance, for pulses that no source explains, and for those that
multipath explains (assumed)."""


class Crossing(NamedTuple):
    """Initial position of a source.

    Attributes:
        rows: Groups whose lines of sight cross there.
        position_m: Position, world frame, shape (3,).
        covariance_m2: Covariance, shape (3, 3).
    """

    rows: IntArray
    position_m: FloatArray
    covariance_m2: FloatArray


class Search(NamedTuple):
    """Groups that may initiate a track.

    Attributes:
        is_unexplained: True for groups that may initiate a track, shape (n,).
        may_be_multipath: True for those that need to cross, because they may be multipath of a known source.
        window: Number of the window of each group, shape (n,).
        time_s: Time of the latest pose.
        significant: Least log likelihood ratio of a crossing against chance.
    """

    is_unexplained: BoolArray
    may_be_multipath: BoolArray
    window: IntArray
    time_s: float
    significant: float


class Occupied(NamedTuple):
    """Positions of tracks.

    Attributes:
        positions_m: Positions, world frame, shape (n_tracks, 3).
        apart_m: Least horizontal distance of a new track from each, shape (n_tracks,).
    """

    positions_m: FloatArray
    apart_m: FloatArray

    def holds(self, position_m: FloatArray) -> bool:
        """Return whether a position (3,) is too close to a track."""
        off_m = np.linalg.norm((self.positions_m - position_m)[:, :2], axis=-1)
        return bool((off_m < self.apart_m).any())


def find_crossing(groups: Groups, search: Search, occupied: Occupied) -> Crossing | None:
    """Find a position that explains groups which no direct path explains; None without one."""
    free = np.flatnonzero(search.is_unexplained & (groups.std_rad < LARGEST_STD_RAD))
    for _ in range(MAX_ATTEMPTS):
        crossing = _crossing(groups, free, search)
        if crossing is None or not occupied.holds(crossing.position_m):
            return crossing
        free = np.setdiff1d(free, crossing.rows)
    return None


def _crossing(groups: Groups, rows: IntArray, search: Search) -> Crossing | None:
    """Find where most of the lines of sight of some groups cross."""
    window, time_s = search.window, search.time_s
    recent = rows[(groups.time_s[rows] > time_s - RECENT_S) & ~search.may_be_multipath[rows]]
    bearing = groups.azimuth_rad[recent] + groups.pose[recent, 2]
    is_near = np.abs(difference(bearing[:, np.newaxis], bearing)) < SECTOR_RAD
    in_sector = is_near @ groups.n_pulses[recent]
    is_sector = bool(in_sector.max(initial=0.0) >= SECTOR_PULSES)
    if is_sector:
        rows = recent[is_near[in_sector.argmax()]]
    else:
        n_recent = int(np.count_nonzero(groups.time_s[rows] > time_s - INITIATION_S))
        rows = choose_evenly(rows[-max(n_recent, MAX_ROWS) :], MAX_ROWS)
        if np.unique(window[rows]).size < LEAST_WINDOWS:
            return None
    if groups.n_pulses[rows].sum() < LEAST_PULSES:
        return None
    bearing = groups.azimuth_rad[rows] + groups.pose[rows, 2]
    own, last_m = rows, groups.pose[rows[-1], :2]
    sight_m = INITIAL_RANGE_M * unit_vector(bearing[-1])
    if rows.size > 1:
        std_rad = np.hypot(groups.std_rad[rows], EXTRA_STD_RAD)
        crossed = triangulate(groups.pose[rows, :2], bearing, std_rad)
        own = rows[crossed.is_inlier]
        is_chance = not is_sector and significance(window[rows], std_rad, crossed.is_inlier) < search.significant
        if groups.n_pulses[own].sum() < LEAST_PULSES or is_chance:
            return None
        last_m = groups.pose[own[-1], :2]
        sight_m = crossed.position_m - last_m
        is_crossing = bool(np.isfinite(crossed.covariance_m2).all())
        range_m = float(np.linalg.norm(sight_m))
        if range_m < LEAST_RANGE_M:  # lines of sight from one place cross there
            sight_m = INITIAL_RANGE_M * unit_vector(bearing[-1])
        elif is_crossing and ellipse95(crossed.covariance_m2).semi_major_m <= range_m:
            return Crossing(own, with_height(crossed.position_m), with_height_covariance(crossed.covariance_m2))
    range_m = float(np.linalg.norm(sight_m))
    initial_m = min(range_m, INITIAL_RANGE_M)
    position_m = last_m + sight_m * initial_m / max(range_m, 1e-9)
    return Crossing(own, with_height(position_m), with_height_covariance(0.25 * initial_m**2 * np.eye(2)))


def significance(window: IntArray, std_rad: FloatArray, is_inlier: BoolArray) -> float:
    r"""Return the log likelihood ratio of a crossing against lines of sight in random directions.

    In each window, the share m of the lines of sight that cross there is compared with the share e of those that pass
    any point in random directions. A window counts once:
    :math:`\sum m \ln(m / e) + (1 - m) \ln((1 - m) / (1 - e))` over m > e.

    Args:
        window: Number of the window of each line of sight, shape (n,).
        std_rad: Standard deviation of its direction, shape (n,).
        is_inlier: True for those that cross, shape (n,).
    """
    _, number, count = np.unique(window, return_inverse=True, return_counts=True)
    share = np.bincount(number, is_inlier, minlength=count.size) / count
    by_chance = np.bincount(number, np.minimum(INLIER_SIGMAS * std_rad / np.pi, 0.9), minlength=count.size) / count
    ratio = rel_entr(share, by_chance) + rel_entr(1.0 - share, 1.0 - by_chance)
    return float(ratio[share > by_chance].sum())
