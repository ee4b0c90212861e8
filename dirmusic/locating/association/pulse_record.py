"""All credible pulses of a mission, and where they were detected."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.bounds import manifold_error, manifold_error_std
from dirmusic.array.element_errors import ElementErrors
from dirmusic.array.model import ArrayModel
from dirmusic.locating.joint_fix import PoseError
from dirmusic.locating.rules import AssignmentRules
from dirmusic.locating.triangulation import triangulate
from dirmusic.pulses.batch import PulseBatch

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Rows = NDArray[np.intp]

InSight = Callable[[FloatArray, FloatArray, float], NDArray[np.bool_]]
"""(points (n, 2), target (2,), metres at the target's end that do not count) -> whether known equipment leaves the
target in sight, (n,)."""

FARTHEST_CROSSING_M = 60.0
"""Lines of sight that cross further away are taken to cross here (assumed)."""


class Measurements(NamedTuple):
    """What the pulses of a record say, with the errors of the array that are known by now taken out.

    Attributes:
        bearing_rad: World frame, shape (n,).
        std_rad: Standard deviation of the bearings: noise, unknown errors of the array, and heading, shape (n,).
        local_level_db: Median strength of the pulses of the same time and direction, shape (n,), dB over 1 V.
    """

    bearing_rad: FloatArray
    std_rad: FloatArray
    local_level_db: FloatArray


class PulseRecord:
    """All credible pulses so far.

    Args:
        array: The array's data sheet and spread.
        pose_error: How wrong the poses are.
        in_sight: What the map says; None without a map.

    Attributes:
        pulses: The pulses, n rows, in the order in which they were added.
        pose: Believed x m, y m, yaw rad at each pulse, world frame, shape (n, 3).
        places_m: Positions from which pulses were detected, shape (n_places, 2).
        place: Row in `places_m` of each pulse, shape (n,).
        aperture_m: Radius of the ring of elements.
    """

    def __init__(self, array: ArrayModel, pose_error: PoseError, in_sight: InSight | None) -> None:
        self.array = array
        self.pose_error = pose_error
        self.pulses = PulseBatch.none(array.manifold.n_elements)
        self.pose = np.empty((0, 3))
        self.places_m = np.empty((0, 2))
        self.place = np.empty(0, dtype=np.intp)
        self.aperture_m = float(np.linalg.norm(array.positions_m[:, :2], axis=-1).max())
        self._in_sight = in_sight
        self._level_db = np.empty(0)

    @property
    def has_map(self) -> bool:
        """Whether anything is known of what obstructs."""
        return self._in_sight is not None

    def add(self, time_s: float, pose: FloatArray, pulses: PulseBatch) -> None:
        """Add credible pulses that were detected at one pose (3,); they get the time of the pose."""
        n = pulses.n_pulses
        norm_v = np.linalg.norm(pulses.strengths_v * pulses.is_usable, axis=-1)
        self.pulses = PulseBatch.join([self.pulses, pulses._replace(time_s=np.full(n, time_s))])
        self.pose = np.concatenate([self.pose, np.tile(pose, (n, 1))])
        self.place = np.concatenate([self.place, np.full(n, len(self.places_m))])
        self.places_m = np.concatenate([self.places_m, pose[np.newaxis, :2]])
        self._level_db = np.concatenate([self._level_db, 20 * np.log10(norm_v)])

    def bearings(self, rows: Rows, errors: ElementErrors) -> tuple[FloatArray, FloatArray]:
        """World bearings of some pulses with known errors of the array taken out, and their deviation with the rest."""
        azimuth, manifold = self.pulses.azimuth_rad[rows], self.array.manifold
        common = manifold_error_std(manifold, azimuth, self.array.spread)
        variance = self.pulses.std_rad[rows] ** 2 + common**2 + self.pose_error.heading_rad**2
        world = azimuth - manifold_error(manifold, azimuth, errors) + self.pose[rows, 2]
        return world, np.sqrt(variance)

    def measurements(self, errors: ElementErrors, rules: AssignmentRules) -> Measurements:
        """Bearings and levels of all pulses."""
        bearing, std = self.bearings(np.arange(self.pulses.n_pulses), errors)
        return Measurements(bearing, std, self._local_level_db(bearing, rules))

    def in_sight(self, target_m: FloatArray, ignore_m: float, places: BoolArray | None = None) -> BoolArray:
        """Whether the map leaves a target (2,) in sight from the places, or from some of them; all without a map."""
        points_m = self.places_m if places is None else self.places_m[places]
        if self._in_sight is None:
            return np.ones(len(points_m), dtype=np.bool_)
        return self._in_sight(points_m, target_m, ignore_m)

    def crossing(self, rows: Rows, errors: ElementErrors) -> tuple[FloatArray, FloatArray]:
        """Where the lines of sight of some pulses cross, (2,), and its covariance (2, 2), infinite if they do not."""
        bearing, std = self.bearings(rows, errors)
        from_m = self.pose[rows, :2]
        fix = triangulate(from_m, bearing, std)
        sight = fix.position_m - from_m[-1]
        return from_m[-1] + sight * min(1.0, FARTHEST_CROSSING_M / np.linalg.norm(sight)), fix.covariance_m2

    def _local_level_db(self, bearing_rad: FloatArray, rules: AssignmentRules) -> FloatArray:
        """Median strength of the pulses of one time and one direction, shape (n,), dB over 1 V."""
        window = np.floor(self.pulses.time_s / rules.level_window_s)
        sector = np.floor(np.mod(bearing_rad, 2 * np.pi) / rules.level_arc_rad)
        order = np.lexsort((self._level_db, sector, window))
        is_new = np.diff(window[order], prepend=-np.inf) + np.abs(np.diff(sector[order], prepend=-1.0)) > 0
        starts = np.flatnonzero(is_new)
        counts = np.diff(np.append(starts, order.size))
        level_db = np.empty(order.size)
        level_db[order] = np.repeat(self._level_db[order[starts + counts // 2]], counts)
        return level_db


def thinned(rows: Rows, most: int) -> Rows:
    """At most so many of some rows, evenly chosen."""
    if rows.size <= most:
        return rows
    return rows[np.linspace(0, rows.size - 1, most).astype(np.intp)]
