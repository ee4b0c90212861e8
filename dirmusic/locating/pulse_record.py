"""Record of all pulses of a mission that fit a plane wave, and of the places where they were detected."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from dirmusic.angles import difference
from dirmusic.array.element_errors import ElementErrors
from dirmusic.array.manifold import SEARCH_AZIMUTHS_RAD, GainManifold
from dirmusic.array.model import ArrayModel
from dirmusic.arrays import BoolArray, FloatArray, IntArray
from dirmusic.locating.bearing_fit import rough_crossing, triangulate
from dirmusic.locating.finding import Finding
from dirmusic.locating.joint_fit import with_height, with_height_covariance
from dirmusic.locating.plane_wave import (
    ELEVATIONS_RAD,
    BearingErrors,
    bearing_error_table,
    interpolate,
    misfits_in_space,
)
from dirmusic.locating.protocol import LineOfSight, PoseError
from dirmusic.locating.rules import AssignmentRules
from dirmusic.pulses.batch import PulseBatch

Rows = IntArray

PLACE_M = 0.25
"""Side of the grid cells of the ground; poses in one cell count as one place. Assumed: about the pose error, and less
than `AssignmentRules.edge_margin_m`."""

LEAST_RANGE_M = 0.3
"""Smallest horizontal range that is used. Assumed: at shorter ranges the pose error alone can turn the line of sight by
any angle."""

FROM_ABOVE_RAD = np.radians(40.0)
"""Elevation above which a pulse can initiate only the first candidate. Assumed: two simultaneous waves look like one
wave from above, and errors of the array look like a wave from a lower elevation than this."""

HEIGHTS_SIGMAS = (-1.0, 0.0, 1.0, 2.0)
"""Trial heights of a finding: offsets from its estimate, in standard deviations. Assumed: more offsets are positive
because obstacles are more often below a finding than above it."""

LIKELIEST_HEIGHT = HEIGHTS_SIGMAS.index(0.0)


class PulsesAtPose(NamedTuple):
    """Pulses that were detected at one pose.

    Attributes:
        time_s: Time of the pose.
        pose: Estimated x m, y m, yaw rad, world frame, shape (3,).
        pulses: Pulses that fit a plane wave, with their directions; may be empty.
    """

    time_s: float
    pose: FloatArray
    pulses: PulseBatch


class PulseRecord:
    """All pulses so far that fit a plane wave, in the order in which they were added.

    Pulses and places are only ever appended, so that row numbers stay valid and results for the first rows can be kept.

    Args:
        array: The array's data sheet and spread.
        pose_error: Error of the poses.
        sight: Transmission along lines of sight according to the map; None without a map.
        rules: Rules that determine which pulses share a local level.

    Attributes:
        pulses: The pulses, n rows, without sub-bands.
        pose: Estimated x m, y m, yaw rad at each pulse, world frame, shape (n, 3).
        place: Row in `places_m` of each pulse, shape (n,).
        elevation_rad: Member of `ELEVATIONS_RAD` that fits each pulse best; 0 if a wave in the plane fits; shape (n,).
        places_m: Places of the array, one for each visited grid cell, shape (n_places, 3), world frame.
        listened: Row in `places_m` of the array's place in each second, with or without pulses, shape (n_seconds,).
        listened_s: Start of those seconds, shape (n_seconds,).
        aperture_m: Radius of the ring of elements.
    """

    def __init__(
        self, array: ArrayModel, pose_error: PoseError, sight: LineOfSight | None, rules: AssignmentRules
    ) -> None:
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
        self._sight = sight
        self._transmission: dict[tuple[float, ...], FloatArray] = {}
        self._origin_s: float | None = None
        self._std_rad: FloatArray = np.empty(0)
        self._group: Rows = np.empty(0, dtype=np.intp)
        self._repeat: Rows = np.empty(0, dtype=np.intp)
        self._levels = LocalLevels(rules)
        self._bearing_errors = BearingErrors(array)
        self._cells: dict[tuple[int, int], int] = {}
        self._groups: dict[tuple[int, ...], int] = {}
        self._n_in_group: list[int] = []
        self._elevation_db = _elevation_db(array.manifold)

    @property
    def n_pulses(self) -> int:
        """Number of pulses so far."""
        return self.pulses.n_pulses

    @property
    def n_settled(self) -> int:
        """Number of leading pulses whose local level later pulses cannot change; see `LocalLevels`."""
        return self._levels.n_settled

    @property
    def elapsed_s(self) -> FloatArray:
        """Time of each pulse, shape (n,), from the start of the second of the first pose, where time windows begin."""
        return self.pulses.time_s - (self._origin_s or 0.0)

    @property
    def is_from_above(self) -> BoolArray:
        """True where a pulse fits best at an elevation above `FROM_ABOVE_RAD`, shape (n,)."""
        return self.elevation_rad > FROM_ABOVE_RAD

    @property
    def has_map(self) -> bool:
        """True if a map of obstacles is known."""
        return self._sight is not None

    def extend(self, detections: Sequence[PulsesAtPose]) -> None:
        """Append the pulses of some poses, in order, and give each pulse the time of its pose."""
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
        bearing_rad = pulses.azimuth_rad + pose[:, 2]
        group, repeat = self._grouped(time_s - origin_s, place, pose[:, 2], bearing_rad)
        # The in-plane model leaves at most 0.01 of the energy of a wave unexplained up to 30 degrees of elevation in a
        # ring of helices, and 0.03 at `FROM_ABOVE_RAD`.
        elevation_rad, off_plane = np.zeros(time_s.size), np.flatnonzero(pulses.misfit > 0.01)
        if off_plane.size:
            misfits = misfits_in_space(pulses.take(off_plane), self.array.manifold)
            elevation_rad[off_plane] = ELEVATIONS_RAD[misfits.argmin(axis=0)]
        self.pulses = PulseBatch.join([self.pulses, pulses])
        self.pose = np.concatenate([self.pose, pose])
        self.place = np.concatenate([self.place, place])
        self.elevation_rad = np.concatenate([self.elevation_rad, elevation_rad])
        self._group = np.concatenate([self._group, group])
        self._repeat = np.concatenate([self._repeat, repeat])
        self._std_rad = np.concatenate([self._std_rad, np.sqrt(variance + self.pose_error.heading_rad**2)])
        norm_v = np.linalg.norm(pulses.strengths_v * pulses.is_usable, axis=-1)
        self._levels.extend(time_s - origin_s, bearing_rad, 20 * np.log10(norm_v))

    def _listen(self, times_s: Sequence[float], places: Sequence[int], origin_s: float) -> None:
        """Record one place of the array for each second."""
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
        """Return the row in `places_m` of the cell of a pose, and add the cell if it is new."""
        cell = int(pose[0] // PLACE_M), int(pose[1] // PLACE_M)
        if cell not in self._cells:
            self._cells[cell] = len(self.places_m)
            self.places_m = np.concatenate([self.places_m, [[pose[0], pose[1], self.array.height_m]]])
        return self._cells[cell]

    def _grouped(
        self, elapsed_s: FloatArray, place: Rows, yaw_rad: FloatArray, bearing_rad: FloatArray
    ) -> tuple[Rows, Rows]:
        """Return the group number of each pulse, and how many pulses precede it in that group; both of shape (n,).

        The pulses of a group share a place, a heading and a direction, within the correlation time of the pose. The
        widths are assumed: gains are nearly linear over 5 degrees, 10 degrees are a few standard deviations of a
        bearing, and the robot does not reach another place within a second.
        """
        window = elapsed_s // max(self.pose_error.correlation_s, 1.0)
        sector = bearing_rad % (2 * np.pi) // np.radians(10.0)
        keys: list[list[int]] = (
            np.stack([window, place, yaw_rad // np.radians(5.0), sector], axis=-1).astype(int).tolist()
        )
        group, repeat = np.empty((2, elapsed_s.size), dtype=np.intp)
        for k, key in enumerate(keys):
            number = self._groups.setdefault(tuple(key), len(self._groups))
            if number == len(self._n_in_group):
                self._n_in_group.append(0)
            group[k], repeat[k] = number, self._n_in_group[number]
            self._n_in_group[number] += 1
        return group, repeat

    def pooled(self, rows: Rows, most: int) -> tuple[PulseBatch, FloatArray]:
        """Average pulses that share a place, a heading and a direction.

        At most `most` groups, evenly chosen, and at most 32 pulses of each group are used. Assumed: with 32 pulses the
        errors that they share exceed the noise. The choice hardly changes when a few rows are added.

        Returns:
            One pulse for each group, and their poses.
        """
        rows = rows[self._repeat[rows] < 32]
        groups = np.flatnonzero(np.bincount(self._group[rows]))
        rows = rows[np.isin(self._group[rows], choose_evenly(groups, most))]
        return pool_pulses(self.pulses.take(rows), self.pose[rows], self._group[rows])

    def error_table(self, errors: ElementErrors) -> FloatArray:
        """Tabulate bearing errors for `bearings`; see `bearing_error_table`."""
        return bearing_error_table(self.array.manifold, errors)

    def bearings(self, rows: Rows | slice, error_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the corrected world bearings of some pulses and their standard deviations, both of shape (n,).

        Args:
            rows: Rows of the pulses.
            error_rad: Table of known bearing errors, see `error_table`.
        """
        azimuth = self.pulses.azimuth_rad[rows]
        return azimuth - interpolate(azimuth, error_rad) + self.pose[rows, 2], self._std_rad[rows]

    def local_level_db(self, rows: slice) -> FloatArray:
        """Return the local level of some pulses, shape (n,), dB relative to 1 V; see `LocalLevels`."""
        return self._levels.local_db()[rows]

    def errors_by_elevation(self, azimuth_rad: FloatArray, elevation_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the bearing errors due to elevation, and the variance after their correction; both of shape (n,).

        Assumed: half of the error is unknown, because a helix does not have the same pattern in every plane.
        """
        error_rad = self._bearing_errors.by_elevation(azimuth_rad, elevation_rad)
        remaining_rad2 = np.square(0.5 * error_rad)
        if self.array.spread.pattern > 0.0:
            remaining_rad2 += self._bearing_errors.variance_off_plane(azimuth_rad, elevation_rad)
        return error_rad, remaining_rad2

    def level_at_one_metre(self, sight_m: FloatArray) -> FloatArray:
        """Return the dB to add to a level at the array to get the level at 1 m, for lines of sight (n, 3)."""
        plan_m = np.maximum(np.hypot(sight_m[:, 0], sight_m[:, 1]), LEAST_RANGE_M)
        elevation_deg = np.degrees(np.arctan2(np.abs(sight_m[:, 2]), plan_m))
        by_elevation_db = np.interp(elevation_deg, np.arange(self._elevation_db.size), self._elevation_db)
        return 20 * np.log10(np.hypot(plan_m, sight_m[:, 2])) - by_elevation_db

    def crossing(self, rows: Rows, error_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the point where the lines of sight of some pulses cross, shape (3,), and its covariance (3, 3).

        The covariance is infinite if the lines do not cross. The height is its prior mean. Assumed: a crossing more
        than 60 m from the last pose is moved to 60 m.
        """
        bearing, std = self.bearings(rows, error_rad)
        from_m = self.pose[rows, :2]
        crossed = triangulate(from_m, bearing, std)
        sight = crossed.position_m - from_m[-1]
        place_m = from_m[-1] + sight * min(1.0, 60.0 / np.linalg.norm(sight))
        return with_height(place_m), with_height_covariance(crossed.covariance_m2)

    def rough_crossing(self, rows: Rows, error_rad: FloatArray) -> FloatArray:
        """Return an approximate crossing of the lines of sight of some pulses, shape (3,), to start a fit from."""
        return with_height(rough_crossing(self.pose[rows, :2], *self.bearings(rows, error_rad)))

    def transmission(self, target_m: FloatArray, within_m: float) -> FloatArray:
        """Return the transmission factor from every place to a target (3,), shape (n_places,); see `LineOfSight`.

        Targets are rounded to 0.1 m. Assumed: findings that are already located move less. The results for the last
        1000 targets are cached, enough for about ten findings with their trial heights and sideways offsets. For places
        added later, only the missing entries are computed.
        """
        if self._sight is None:
            return np.ones(len(self.places_m))
        steps = np.rint(target_m / 0.1).astype(np.intp).tolist()
        key = (*steps, within_m)
        known = self._transmission.get(key, np.empty(0))
        if known.size < len(self.places_m):
            more = self._sight(self.places_m[known.size :], np.array(steps) * 0.1, within_m)
            known = self._transmission[key] = np.concatenate([known, more])
            if len(self._transmission) > 1000:
                del self._transmission[next(iter(self._transmission))]
        return known

    def transmission_at_heights(self, finding: Finding, within_m: float) -> FloatArray:
        """Return the transmission factor for each trial height of a finding, shape (n_heights, n_places).

        Assumed: nothing discharges below 0.1 m.
        """
        targets_m = np.tile(finding.position_m, (len(HEIGHTS_SIGMAS), 1))
        targets_m[:, 2] = np.maximum(targets_m[:, 2] + finding.height_std_m * np.array(HEIGHTS_SIGMAS), 0.1)
        return np.array([self.transmission(target_m, within_m) for target_m in targets_m])


class LocalLevels:
    """Local level of each pulse: the median level of the pulses of the same time window and sector.

    Args:
        rules: Widths of the window and the sector.

    Attributes:
        n_settled: Number of leading pulses whose local level is final, because their window has passed.
    """

    def __init__(self, rules: AssignmentRules) -> None:
        self._window_s, self._arc_rad = rules.level_window_s, rules.level_arc_rad
        self._window, self._sector, self._level_db = np.empty(0), np.empty(0), np.empty(0)
        self._local_db = np.empty(0)
        self._is_known = True
        self._last_window = -np.inf
        self._first_of_last_window = 0
        self.n_settled = 0

    def extend(self, time_s: FloatArray, bearing_rad: FloatArray, level_db: FloatArray) -> None:
        """Append the times, world bearings and levels of pulses, each of shape (n,); levels in dB, any reference."""
        window = np.floor(time_s / self._window_s)
        sector = np.floor(np.mod(bearing_rad, 2 * np.pi) / self._arc_rad)
        for row in np.flatnonzero(np.diff(window, prepend=self._last_window)).tolist():
            is_later = window[row] > self._last_window
            self._first_of_last_window = self._window.size + row if is_later else 0
            self.n_settled = min(self.n_settled, self._first_of_last_window)
            self._last_window = max(self._last_window, float(window[row]))
        self._window = np.concatenate([self._window, window])
        self._sector = np.concatenate([self._sector, sector])
        self._level_db = np.concatenate([self._level_db, level_db])
        self._is_known = False

    def local_db(self) -> FloatArray:
        """Return the local level of each pulse so far, shape (n_pulses,), dB of the reference used in `extend`."""
        if self._is_known:
            return self._local_db
        first, self.n_settled = self.n_settled, self._first_of_last_window
        window, sector, level_db = self._window[first:], self._sector[first:], self._level_db[first:]
        order = np.lexsort((level_db, sector, window))
        is_new = np.diff(window[order], prepend=-np.inf) + np.abs(np.diff(sector[order], prepend=-1.0)) > 0
        starts = np.flatnonzero(is_new)
        counts = np.diff(np.append(starts, order.size))
        median_db = np.empty(order.size)
        median_db[order] = np.repeat(level_db[order[starts + counts // 2]], counts)
        self._local_db, self._is_known = np.concatenate([self._local_db[:first], median_db]), True
        return self._local_db


def _elevation_db(manifold: GainManifold) -> FloatArray:
    """Return the summed power gain at elevations of 0, 1 ... 90 degrees relative to the plane, dB."""
    elevation_rad = np.radians(np.arange(91.0))
    off_rad = SEARCH_AZIMUTHS_RAD[:, np.newaxis] - manifold.boresights_rad
    gain = manifold.response_in_space(off_rad, elevation_rad[:, np.newaxis, np.newaxis]).gain
    power = np.square(gain).sum(axis=-1).mean(axis=-1)
    return np.asarray(10 * np.log10(power / power[0]), dtype=np.float64)


def pool_pulses(pulses: PulseBatch, pose: FloatArray, group: IntArray) -> tuple[PulseBatch, FloatArray]:
    """Average the pulses of each group, weighted by their noise.

    The amplitudes of pulses differ, so strengths are divided by their norm first. Each channel is averaged over the
    pulses in which it is usable.

    Args:
        pulses: Pulses with their directions, n rows.
        pose: Estimated x m, y m, yaw rad at each pulse, world frame, shape (n, 3); nearly equal within a group.
        group: Number of the group of each pulse, shape (n,).

    Returns:
        The averaged pulses, of unit strength and without sub-bands, and their poses; one row for each group, in
        ascending order.
    """
    order = np.argsort(group, kind="stable")
    starts = np.flatnonzero(np.diff(group[order], prepend=group.min(initial=0) - 1))
    row = np.repeat(np.arange(starts.size), np.diff(starts, append=order.size))
    pulses, pose = pulses.take(order), pose[order]
    first_rad, first_yaw_rad = pulses.azimuth_rad[starts][row], pose[starts, 2][row]

    def total(values: FloatArray) -> FloatArray:
        return np.add.reduceat(values, starts, axis=0)

    usable_v = pulses.strengths_v * pulses.is_usable
    norm_v = np.linalg.norm(usable_v, axis=-1, keepdims=True)
    weight = pulses.is_usable * norm_v**2 / np.maximum(pulses.variance_v2, np.finfo(np.float64).tiny)
    of_channel = total(weight)
    is_usable = of_channel > 0.0
    of_channel = np.where(is_usable, of_channel, 1.0)
    precision = 1.0 / np.square(pulses.std_rad)
    of_bearing = total(precision)

    def mean(values: FloatArray) -> FloatArray:
        return total(precision * values) / of_bearing

    azimuth_rad = pulses.azimuth_rad[starts] + mean(difference(pulses.azimuth_rad, first_rad))
    yaw_rad = pose[starts, 2] + mean(difference(pose[:, 2], first_yaw_rad))
    one_each = PulseBatch.detected(
        time_s=mean(pulses.time_s),
        strengths_v=total(weight * usable_v / norm_v) / of_channel,
        variance_v2=1.0 / of_channel,
    )
    return one_each._replace(
        azimuth_rad=difference(azimuth_rad, 0.0),
        std_rad=1.0 / np.sqrt(of_bearing),
        misfit=mean(pulses.misfit),
        is_usable=is_usable,
    ), np.column_stack([mean(pose[:, 0]), mean(pose[:, 1]), yaw_rad])


def choose_evenly(numbers: Rows, most: int) -> Rows:
    """Choose at most `most` of the given numbers (n,), evenly spread.

    The numbers with the smallest reversed bits are chosen (van der Corput sequence, 1935), so that the choice hardly
    changes when a few numbers are added.
    """
    if numbers.size <= most:
        return numbers
    reversed_bits = _van_der_corput(int(numbers.max()).bit_length())[numbers]
    return numbers[np.sort(np.argpartition(reversed_bits, most)[:most])]


@lru_cache(maxsize=2)
def _van_der_corput(n_bits: int) -> Rows:
    """Return every number of `n_bits` bits with its bits reversed, shape (2 ** n_bits,)."""
    reversed_bits = np.zeros(1, dtype=np.intp)
    for _ in range(n_bits):
        reversed_bits = np.concatenate([2 * reversed_bits, 2 * reversed_bits + 1])
    return reversed_bits
