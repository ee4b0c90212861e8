"""All credible pulses of a mission, and where they were detected."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.element_errors import ElementErrors
from dirmusic.array.manifold import SEARCH_AZIMUTHS_RAD, GainManifold
from dirmusic.array.model import ArrayModel
from dirmusic.locating.association.bearing_errors import BearingErrors
from dirmusic.locating.association.growing_columns import GrowingColumns
from dirmusic.locating.association.local_levels import LocalLevels
from dirmusic.locating.association.pooling import pooled
from dirmusic.locating.association.sight_lines import Sight, SightLines
from dirmusic.locating.elevation import ELEVATIONS_RAD, misfits_in_space
from dirmusic.locating.fitting.joint_fix import PoseError, with_height, with_height_covariance
from dirmusic.locating.fitting.triangulation import rough_crossing, triangulate
from dirmusic.locating.rules import AssignmentRules
from dirmusic.pulses.batch import PulseBatch

FloatArray = NDArray[np.float64]
Rows = NDArray[np.intp]

PLACE_M = 0.25
"""Side of the cells of the ground that count as one place (assumed): about the error of the pose, and less than the
margin that is left to edges."""

DIRECTION_RAD = np.radians(10.0)
"""Width of the sectors of the world that count as one direction (assumed): a few deviations of a bearing."""

HEADING_RAD = np.radians(5.0)
"""Width of the headings that count as one (assumed): gains are straight lines over so much."""

LEAST_CORRELATION_S = 1.0
"""Poses are taken to err alike for so long at least (assumed): in less the robot gets to another place."""

MOST_POOLED = 32
"""Further pulses of one group are not worth their time (assumed): what they have in common limits, not the noise."""

LEAST_RANGE_M = 0.3
"""Shorter ranges on plan count as this one (assumed): so close by, a pose error alone turns the line of sight round."""

FROM_ABOVE_RAD = np.radians(40.0)
"""Pulses that fit best at elevations beyond this one are those of known findings or of none: two waves at a time look
like one from above, and errors of the array like less than this (assumed)."""

MOST_IN_PLANE = 0.01
"""Share of the energy that waves from the plane, or from little above it, leave unexplained: from 30 degrees of
elevation no more in a ring of helices; from `FROM_ABOVE_RAD`, 0.03."""

ALIKE_RAD = np.radians(0.2)
"""Bearings that differ by no more say the same (assumed): their own deviations are larger by far."""

FARTHEST_CROSSING_M = 60.0
"""Lines of sight that cross further away are taken to cross here (assumed)."""


ELEVATION_SHARE = 0.5
"""Share of the bearing error by elevation that is not known (assumed): helices are not alike in all planes."""


class Measurements(NamedTuple):
    """What the pulses of a record say, with the errors of the array that are known by now taken out.

    Attributes:
        bearing_rad: World frame, shape (n,).
        std_rad: Standard deviation of the bearings: noise, unknown errors of the array, and heading, shape (n,).
        local_level_db: Median strength of the pulses of the same time and direction, shape (n,), dB over 1 V; see
            `LocalLevels`.
    """

    bearing_rad: FloatArray
    std_rad: FloatArray
    local_level_db: FloatArray


class Detections(NamedTuple):
    """What was detected from one pose.

    Attributes:
        time_s: When.
        pose: Believed x m, y m, yaw rad, world frame, shape (3,).
        pulses: Credible pulses with their directions, none or more.
    """

    time_s: float
    pose: FloatArray
    pulses: PulseBatch


class PulseRecord:
    """All credible pulses so far.

    Args:
        array: The array's data sheet and spread.
        pose_error: How wrong the poses are.
        sight: What the map says; None without a map.
        rules: Which pulses are judged together.

    Attributes:
        pulses: The pulses, n rows, in the order in which they were added, without sub-bands.
        pose: Believed x m, y m, yaw rad at each pulse, world frame, shape (n, 3).
        place: Row in `places_m` of each pulse, shape (n,).
        elevation_rad: That of `ELEVATIONS_RAD` at which each pulse fits best, 0 where it fits in the plane, shape (n,).
        places_m: Places where the array was, one of each cell of the ground, shape (n_places, 3), world frame.
        listened: Row in `places_m` of where the array was in each second, one second a row, whether anything was
            detected or not, shape (n_seconds,).
        listened_s: Those seconds, shape (n_seconds,).
        aperture_m: Radius of the ring of elements.
    """

    def __init__(self, array: ArrayModel, pose_error: PoseError, sight: Sight | None, rules: AssignmentRules) -> None:
        self.array = array
        self.pose_error = pose_error
        self.pulses = PulseBatch.none(array.manifold.n_elements)
        self.pose: FloatArray = np.empty((0, 3))
        self.place: Rows = np.empty(0, dtype=np.intp)
        self.elevation_rad: FloatArray = np.empty(0)
        self.places_m = np.empty((0, 3))
        self.listened = np.empty(0, dtype=np.intp)
        self.listened_s = np.empty(0)
        self.aperture_m = float(np.linalg.norm(array.positions_m[:, :2], axis=-1).max())
        self.sight = SightLines(sight)
        self._origin_s: float | None = None
        self._std_rad: FloatArray = np.empty(0)
        self._group: Rows = np.empty(0, dtype=np.intp)
        self._repeat: Rows = np.empty(0, dtype=np.intp)
        self._columns = GrowingColumns(
            [self.pose, self.place, self.elevation_rad, self._group, self._repeat, self._std_rad, *self.pulses]
        )
        self._levels = LocalLevels(rules)
        self._bearing_errors = BearingErrors(array)
        self._cells: dict[tuple[int, int], int] = {}
        self._groups: dict[tuple[int, ...], int] = {}
        self._n_in_group: list[int] = []
        self._elevation_db = _elevation_db(array.manifold)

    @property
    def n_settled(self) -> int:
        """So many of the first pulses are measured as they were when they were last asked for; see `LocalLevels`."""
        return self._levels.n_settled

    @property
    def elapsed_s(self) -> FloatArray:
        """Time of each pulse since the whole second of the first detection, shape (n,); windows are counted from it."""
        return self.pulses.time_s - (self._origin_s or 0.0)

    def extend(self, detections: Sequence[Detections]) -> None:
        """Add what was detected from some poses, in their order; pulses get the time of their pose."""
        if not detections:
            return
        if self._origin_s is None:
            self._origin_s = float(np.floor(detections[0].time_s))
        origin_s = self._origin_s
        places = [self._place_of(pose) for _, pose, _ in detections]
        self._listen([detected.time_s for detected in detections], places, origin_s)
        n_each = [detected.pulses.n_pulses for detected in detections]
        if not any(n_each):
            return
        time_s = np.repeat([detected.time_s for detected in detections], n_each)
        pose = np.repeat([detected.pose for detected in detections], n_each, axis=0)
        place = np.repeat(np.array(places, dtype=np.intp), n_each)
        pulses = PulseBatch.join([detected.pulses.without_bands() for detected in detections])._replace(time_s=time_s)
        variance = pulses.std_rad**2 + self._bearing_errors.std(pulses.azimuth_rad) ** 2
        std_rad = np.sqrt(variance + self.pose_error.heading_rad**2)
        bearing_rad = pulses.azimuth_rad + pose[:, 2]
        group, repeat = self._grouped(time_s - origin_s, place, pose[:, 2], bearing_rad)
        elevation_rad, off_plane = np.zeros(time_s.size), np.flatnonzero(pulses.misfit > MOST_IN_PLANE)
        if off_plane.size:
            misfits = misfits_in_space(pulses.take(off_plane), self.array.manifold)
            elevation_rad[off_plane] = ELEVATIONS_RAD[misfits.argmin(axis=0)]
        self._columns.extend([pose, place, elevation_rad, group, repeat, std_rad, *pulses])
        columns = self._columns.columns()
        self.pose, self.place, self.elevation_rad, self._group, self._repeat, self._std_rad = columns[:6]
        self.pulses = PulseBatch(*columns[6:])
        norm_v = np.linalg.norm(pulses.strengths_v * pulses.is_usable, axis=-1)
        self._levels.extend(time_s - origin_s, bearing_rad, 20 * np.log10(norm_v))

    def _listen(self, times_s: Sequence[float], places: Sequence[int], origin_s: float) -> None:
        """Note one place of the array for each second."""
        last_s = float(self.listened_s[-1]) if self.listened_s.size else -np.inf
        seconds, listened = list[float](), list[int]()
        for time_s, place in zip(times_s, places, strict=True):
            if time_s >= last_s + 1.0:
                last_s = origin_s + float(np.floor(time_s - origin_s))
                seconds.append(last_s)
                listened.append(place)
        self.listened = np.append(self.listened, np.array(listened, dtype=np.intp))
        self.listened_s = np.append(self.listened_s, seconds)

    def _place_of(self, pose: FloatArray) -> int:
        """Row in `places_m` of the cell in which a pose lies; a new one where the array has not been yet."""
        cell = int(pose[0] // PLACE_M), int(pose[1] // PLACE_M)
        if cell not in self._cells:
            self._cells[cell] = len(self.places_m)
            self.places_m = np.concatenate([self.places_m, [[pose[0], pose[1], self.array.height_m]]])
        return self._cells[cell]

    def _grouped(
        self, elapsed_s: FloatArray, place: Rows, yaw_rad: FloatArray, bearing_rad: FloatArray
    ) -> tuple[Rows, Rows]:
        """The group of each pulse, and how many were in it before; arguments and results of shape (n,).

        The pulses of a group came from one place, heading and direction, within the time in which poses err alike.
        """
        window = elapsed_s // max(self.pose_error.correlation_s, LEAST_CORRELATION_S)
        sector = bearing_rad % (2 * np.pi) // DIRECTION_RAD
        keys: list[list[int]] = np.stack([window, place, yaw_rad // HEADING_RAD, sector], axis=-1).astype(int).tolist()
        group, repeat = np.empty((2, elapsed_s.size), dtype=np.intp)
        for k, key in enumerate(keys):
            number = self._groups.setdefault(tuple(key), len(self._groups))
            if number == len(self._n_in_group):
                self._n_in_group.append(0)
            group[k], repeat[k] = number, self._n_in_group[number]
            self._n_in_group[number] += 1
        return group, repeat

    def pooled(self, rows: Rows, most: int) -> tuple[PulseBatch, FloatArray]:
        """Some pulses, pooled by place, heading and direction, and their poses; at most so many, evenly chosen.

        Nearly the same ones when a few rows have been added.
        """
        rows = rows[self._repeat[rows] < MOST_POOLED]
        groups = np.flatnonzero(np.bincount(self._group[rows]))
        rows = rows[np.isin(self._group[rows], evenly(groups, most))]
        return pooled(self.pulses.take(rows), self.pose[rows], self._group[rows])

    def bearings(self, rows: Rows | slice, errors: ElementErrors) -> tuple[FloatArray, FloatArray]:
        """World bearings of some pulses with known errors of the array taken out, and their deviation with the rest."""
        azimuth = self.pulses.azimuth_rad[rows]
        return azimuth - self._bearing_errors.of(errors, azimuth) + self.pose[rows, 2], self._std_rad[rows]

    @property
    def is_from_above(self) -> NDArray[np.bool_]:
        """Whether each pulse fits best at an elevation beyond `FROM_ABOVE_RAD`, shape (n,)."""
        return self.elevation_rad > FROM_ABOVE_RAD

    def errors_by_elevation(self, azimuth_rad: FloatArray, elevation_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Bearing errors by elevation, and the variance that is left when they are taken out; both of shape (n,)."""
        error_rad = self._bearing_errors.by_elevation(azimuth_rad, elevation_rad)
        left_rad2 = np.square(ELEVATION_SHARE * error_rad)
        if self.array.spread.pattern > 0.0:
            left_rad2 += self._bearing_errors.variance_off_plane(azimuth_rad, elevation_rad)
        return error_rad, left_rad2

    def reads_alike(self, first: ElementErrors, second: ElementErrors) -> bool:
        """Whether bearings are the same to `ALIKE_RAD` with either errors of the array taken out."""
        return first is second or self._bearing_errors.most_apart(first, second) <= ALIKE_RAD

    def measurements(self, rows: slice, errors: ElementErrors) -> Measurements:
        """Bearings and levels of some pulses."""
        return Measurements(*self.bearings(rows, errors), self._levels.local_db()[rows])

    def level_at_one_metre(self, sight_m: FloatArray) -> FloatArray:
        """What distance and elevation take from a level, dB, for lines of sight (n, 3) from the array."""
        plan_m = np.maximum(np.linalg.norm(sight_m[:, :2], axis=-1), LEAST_RANGE_M)
        elevation_deg = np.degrees(np.arctan2(np.abs(sight_m[:, 2]), plan_m))
        by_elevation_db = np.interp(elevation_deg, np.arange(self._elevation_db.size), self._elevation_db)
        return 20 * np.log10(np.hypot(plan_m, sight_m[:, 2])) - by_elevation_db

    def crossing(self, rows: Rows, errors: ElementErrors) -> tuple[FloatArray, FloatArray]:
        """Where the lines of sight of some pulses cross, (3,), and its covariance (3, 3), infinite if they do not.

        On plan: the height is that of which nothing is known.
        """
        bearing, std = self.bearings(rows, errors)
        from_m = self.pose[rows, :2]
        fix = triangulate(from_m, bearing, std)
        sight = fix.position_m - from_m[-1]
        place_m = from_m[-1] + sight * min(1.0, FARTHEST_CROSSING_M / np.linalg.norm(sight))
        return with_height(place_m), with_height_covariance(fix.covariance_m2)

    def rough_crossing(self, rows: Rows, errors: ElementErrors) -> FloatArray:
        """About where the lines of sight of some pulses cross, (3,), for a fit to start from."""
        return with_height(rough_crossing(self.pose[rows, :2], *self.bearings(rows, errors)))


def _elevation_db(manifold: GainManifold) -> FloatArray:
    """Sum of the gains towards elevations of 0, 1 ... 90 degrees, over that in the plane, dB."""
    elevation_rad = np.radians(np.arange(91.0))
    off_rad = SEARCH_AZIMUTHS_RAD[:, np.newaxis] - manifold.boresights_rad
    gain = manifold.response_in_space(off_rad, elevation_rad[:, np.newaxis, np.newaxis]).gain
    power = np.square(gain).sum(axis=-1).mean(axis=-1)
    return np.asarray(10 * np.log10(power / power[0]), dtype=np.float64)


def evenly(numbers: Rows, most: int) -> Rows:
    """At most so many of some numbers (n,), evenly spread; nearly the same ones when a few have been added.

    The least when read backwards bit by bit: the sequence of van der Corput, 1935.
    """
    if numbers.size <= most:
        return numbers
    backwards = _van_der_corput(int(numbers.max()).bit_length())[numbers]
    return numbers[np.sort(np.argpartition(backwards, most)[:most])]


@lru_cache(maxsize=2)
def _van_der_corput(n_bits: int) -> Rows:
    """Every number of so many bits, read backwards bit by bit, shape (2 ** n_bits,)."""
    backwards = np.zeros(1, dtype=np.intp)
    for _ in range(n_bits):
        backwards = np.concatenate([2 * backwards, 2 * backwards + 1])
    return backwards
