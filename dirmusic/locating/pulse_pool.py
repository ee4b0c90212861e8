"""Pool of all pulses of a mission: averages of pulses of one place, heading and direction, and where the array was."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dirmusic.angles import difference
from dirmusic.array.model import ArrayModel
from dirmusic.arrays import BoolArray, FloatArray, IntArray
from dirmusic.bearing.maximum_likelihood import in_plane_likelihood
from dirmusic.locating.protocol import LineOfSight, PoseError
from dirmusic.pulses.batch import Bearings, PulseBatch

PLACE_M = 0.5
"""Side of the grid cells of the ground; poses in one cell count as one place. Assumed: several pose errors."""

WINDOW_S = 5.0
"""Length of the time windows within which pulses are pooled, and in which a source is on or off (assumed)."""

LEVEL_STEP_DB, HEADING_STEP_RAD, BEARING_STEP_RAD = 6.0, np.radians(10.0), np.radians(6.0)
"""Widths of the sectors of level, heading and direction whose pulses are pooled. Assumed: 6 dB separate most sources of
different level, and gains are nearly linear over 5 degrees."""

ACCURATE_RAD = np.radians(2.0)
"""Standard deviation of the direction above which its sector is 2, 4, ... 32 times as wide (assumed)."""

PAIR_RAD = np.radians(20.0)
"""Largest gap between directions of pulses that are compared in pairs (assumed): half a metre at a range of 1.4 m."""

WITHIN_M, EDGE_BELOW_M = 0.6, 1.5
"""Depth in front of a source within which equipment is ignored, and how far below a source a point must be hidden so
that paths to the source are close to an edge (assumed)."""

ROUNDING = 1e-6
"""Share of a window or second by which a time may be rounded down."""


class Groups(NamedTuple):
    """Groups of pulses, one per row.

    Attributes:
        time_s: Mean time, shape (n,).
        pose: Mean pose, shape (n, 3).
        place: Row in `PulsePool.places_m`, shape (n,).
        strengths: Mean strengths scaled to unit norm, 0 for channels that are not usable, shape (n, n_elements).
        variance: Noise variance of the mean, shape (n, n_elements).
        is_usable: True for usable channels, shape (n, n_elements).
        level_db: Mean level at the array, dB relative to 1 V, shape (n,).
        azimuth_rad: Mean direction as estimated in the plane, array frame, shape (n,).
        std_rad: Standard deviation of this direction by noise, shape (n,).
        n_pulses: Number of pulses, shape (n,).
    """

    time_s: FloatArray
    pose: FloatArray
    place: IntArray
    strengths: FloatArray
    variance: FloatArray
    is_usable: BoolArray
    level_db: FloatArray
    azimuth_rad: FloatArray
    std_rad: FloatArray
    n_pulses: FloatArray

    def take(self, rows: IntArray | BoolArray | slice) -> Groups:
        """Select groups."""
        return Groups._make(column[rows] for column in self)

    def followed_by(self, later: Groups) -> Groups:
        """Append groups."""
        return Groups._make(np.concatenate(pair) for pair in zip(self, later, strict=True))


class PulsePairs(NamedTuple):
    """Pairs of pulses that were detected at one pose from similar directions, one per row; no pulse is in two pairs.

    Attributes:
        group: Row in `PulsePool.groups` of each pulse, shape (n, 2).
        difference: Difference of their strengths, which are scaled to unit norm, shape (n, n_elements).
        variance: Noise variance of the difference, shape (n, n_elements).
    """

    group: IntArray
    difference: FloatArray
    variance: FloatArray

    def take(self, rows: IntArray | slice) -> PulsePairs:
        """Select pairs."""
        return PulsePairs._make(column[rows] for column in self)

    def followed_by(self, later: PulsePairs) -> PulsePairs:
        """Append pairs."""
        return PulsePairs._make(np.concatenate(pair) for pair in zip(self, later, strict=True))


class PulsePool:
    """All pulses so far, pooled, in the order in which they were added.

    Windows and seconds are counted from the first pose. The groups of a window are settled when a pulse of a later
    window has been pooled.

    A channel that ceases to be usable was probably faulty for some time. It is left out of all pulses so far, and their
    directions are estimated anew; the pairs so far are forgotten.

    Args:
        array: The array.
        pose_error: Error of the poses.

    Attributes:
        groups: Groups so far.
        n_settled: Number of leading groups that later pulses cannot change.
        group: Row in `groups` of each pulse, shape (n_pulses,).
        pairs: Pairs of pulses so far.
        places_m: Places of the array, one for each visited grid cell, shape (n_places, 3), world frame.
        listened: Row in `places_m` for each second of the mission, with or without pulses, shape (n_seconds,).
        listened_s: Time of those seconds.
    """

    def __init__(self, array: ArrayModel, pose_error: PoseError) -> None:
        n_elements = array.manifold.n_elements
        self._array, self._good = array, np.ones(n_elements, dtype=np.bool_)
        self._open = PulseBatch.none(n_elements), np.empty((0, 3)), np.empty(0, dtype=np.intp)
        self.group: IntArray = np.empty(0, dtype=np.intp)
        self.groups: Groups = pool_pulses(*self._open, self.group)
        self.pairs = pair_pulses(*self._open[:2], self.group)
        self.n_settled, self._n_settled_pairs = 0, 0
        self.places_m = np.empty((0, 3))
        self.listened, self.listened_s = np.empty(0, dtype=np.intp), np.empty(0)
        self._height_m, self._window_s = array.height_m, max(WINDOW_S, pose_error.correlation_s)
        self._start_s: float | None = None
        self._cells: dict[tuple[int, int], int] = {}
        self._added: list[tuple[float, FloatArray, PulseBatch]] = []

    def add(self, time_s: float, pose: FloatArray, pulses: PulseBatch) -> None:
        """Add the pulses that were detected at one pose: x m, y m, yaw rad, world frame, shape (3,)."""
        self._added.append((time_s, pose, pulses))

    def pool(self) -> bool:
        """Pool the pulses added since the last call; return true if channels were left out of earlier ones."""
        if not self._added:
            return False
        times_s, each_pose, batches = zip(*self._added, strict=True)
        self._added = []
        self._start_s = times_s[0] if self._start_s is None else self._start_s
        n_each, places = [batch.n_pulses for batch in batches], np.array([self._place_of(pose) for pose in each_pose])
        self._listen(times_s, places)
        latest = PulseBatch.join([batch.without_bands() for batch in batches])
        good = self._good & latest.is_usable.all(axis=0)
        has_fault, self._good = bool((good != self._good).any()), good
        open_pulses, open_pose, open_place = self._open
        pulses = PulseBatch.join([open_pulses, latest._replace(time_s=np.repeat(times_s, n_each))])
        if has_fault:
            found = self._directions(pulses.strengths_v, pulses.variance_v2)
            pulses = found.attached_to(pulses)._replace(is_usable=pulses.is_usable & good)
            self._leave_out()
        pose = np.concatenate([open_pose, np.repeat(each_pose, n_each, axis=0)])
        place = np.concatenate([open_place, np.repeat(places, n_each)])
        window = self.window_of(pulses.time_s)
        is_settled = window < window.max(initial=0)
        self.groups = self.groups.take(slice(self.n_settled))
        self.group = self.group[: self.group.size - open_place.size]
        self.pairs = self.pairs.take(slice(0 if has_fault else self._n_settled_pairs))
        for part in (is_settled, ~is_settled):
            self.n_settled, self._n_settled_pairs = len(self.groups.time_s), len(self.pairs.group)
            own = pulses.take(part), pose[part], place[part]
            number = group_numbers(*own, window[part])
            self.group = np.concatenate([self.group, self.n_settled + number])
            self.pairs = self.pairs.followed_by(pair_pulses(*own[:2], self.n_settled + number))
            self.groups, self._open = self.groups.followed_by(pool_pulses(*own, number)), own
        return has_fault

    def _leave_out(self) -> None:
        """Leave channels that are not good any more out of all groups."""
        groups = self.groups
        strengths = groups.strengths * self._good
        norm = np.maximum(np.linalg.norm(strengths, axis=-1, keepdims=True), np.finfo(np.float64).tiny)
        strengths, variance = strengths / norm, groups.variance * self._good / norm**2
        found = self._directions(strengths, variance)
        self.groups = groups._replace(
            strengths=strengths,
            variance=variance,
            is_usable=groups.is_usable & self._good,
            level_db=groups.level_db + 20 * np.log10(norm[:, 0]),
            azimuth_rad=found.azimuth_rad,
            std_rad=found.std_rad,
        )

    def _directions(self, strengths: FloatArray, variance: FloatArray) -> Bearings:
        """Estimate directions by the good channels, from strengths and their noise variance, (n, n_elements) each."""
        pulses = PulseBatch.detected(np.zeros(len(strengths)), strengths, variance)
        return in_plane_likelihood(pulses.take_channels(self._good), self._array.take(self._good))

    def window_of(self, time_s: FloatArray) -> IntArray:
        """Return the number of the time window of each time (n,), from 0 on."""
        start_s = 0.0 if self._start_s is None else self._start_s
        return np.floor((time_s - start_s) / self._window_s + ROUNDING).astype(np.intp)

    def _listen(self, times_s: Sequence[float], places: IntArray) -> None:
        """Record one place of the array for each second."""
        assert self._start_s is not None
        second = np.floor(np.asarray(times_s) - self._start_s + ROUNDING)
        last = self.listened_s[-1] - self._start_s + 0.5 if self.listened_s.size else -1.0
        _, first = np.unique(second, return_index=True)
        first = first[second[first] > last]
        self.listened_s = np.append(self.listened_s, self._start_s + second[first])
        self.listened = np.append(self.listened, places[first])

    def _place_of(self, pose: FloatArray) -> int:
        """Return the row in `places_m` of the cell of a pose, and add the cell if it is new."""
        cell = int(pose[0] // PLACE_M), int(pose[1] // PLACE_M)
        if cell not in self._cells:
            self._cells[cell] = len(self.places_m)
            self.places_m = np.concatenate([self.places_m, [[pose[0], pose[1], self._height_m]]])
        return self._cells[cell]


def group_numbers(pulses: PulseBatch, pose: FloatArray, place: IntArray, window: IntArray) -> IntArray:
    """Assign pulses to groups, numbered in the order of their first pulses.

    The pulses of a group share a window, a place, and sectors of heading, level and direction.

    Args:
        pulses: Pulses with their directions, n rows.
        pose: Estimated x m, y m, yaw rad at each pulse, world frame, shape (n, 3).
        place: Place of each pulse, shape (n,).
        window: Time window of each pulse, shape (n,).

    Returns:
        Number of the group of each pulse, shape (n,).
    """
    norm_v = np.linalg.norm(pulses.strengths_v * pulses.is_usable, axis=-1)
    level = np.floor(20 * np.log10(np.maximum(norm_v, 1e-12)) / LEVEL_STEP_DB)
    doublings = np.clip(np.ceil(np.log2(np.maximum(pulses.std_rad, 1e-6) / ACCURATE_RAD)), 0, 5)
    bearing = np.floor(np.mod(pulses.azimuth_rad + pose[:, 2], 2 * np.pi) / (BEARING_STEP_RAD * 2.0**doublings))
    keys = np.column_stack([window, place, np.floor(pose[:, 2] / HEADING_STEP_RAD), level, doublings, bearing])
    _, first, number = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(np.argsort(first))
    return order[number.ravel()].astype(np.intp)


def pool_pulses(pulses: PulseBatch, pose: FloatArray, place: IntArray, group: IntArray) -> Groups:
    """Average the pulses of each group, weighted by their noise.

    The amplitudes of pulses differ, so strengths are divided by their norm first. Each channel is averaged over the
    pulses in which it is usable.

    Args:
        pulses: Pulses with their directions, n rows.
        pose: Estimated x m, y m, yaw rad at each pulse, world frame, shape (n, 3); nearly equal within a group.
        place: Place of each pulse, shape (n,).
        group: Number of the group of each pulse, from 0 without gaps, shape (n,).
    """
    order = np.argsort(group, kind="stable")
    starts = np.flatnonzero(np.diff(group[order], prepend=-1))
    row = np.repeat(np.arange(starts.size), np.diff(starts, append=order.size))
    pulses, pose = pulses.take(order), pose[order]

    def total(values: FloatArray) -> FloatArray:
        return np.add.reduceat(values, starts, axis=0) if starts.size else values[:0]

    usable_v = pulses.strengths_v * pulses.is_usable
    norm_v = np.maximum(np.linalg.norm(usable_v, axis=-1, keepdims=True), np.finfo(np.float64).tiny)
    weight = pulses.is_usable * norm_v**2 / np.maximum(pulses.variance_v2, np.finfo(np.float64).tiny)
    of_channel = total(weight)
    is_usable = of_channel > 0.0
    of_channel = np.where(is_usable, of_channel, 1.0)
    strengths, variance = total(weight * usable_v / norm_v) / of_channel, np.where(is_usable, 1.0 / of_channel, 0.0)
    norm = np.maximum(np.linalg.norm(strengths, axis=-1, keepdims=True), np.finfo(np.float64).tiny)
    precision = 1.0 / np.square(pulses.std_rad)
    of_bearing, n_pulses = total(precision), total(np.ones(row.size))

    def mean(values: FloatArray) -> FloatArray:
        return total(precision * values) / of_bearing

    azimuth_rad = pulses.azimuth_rad[starts] + mean(difference(pulses.azimuth_rad, pulses.azimuth_rad[starts][row]))
    yaw_rad = pose[starts, 2] + mean(difference(pose[:, 2], pose[starts, 2][row]))
    return Groups(
        time_s=mean(pulses.time_s),
        pose=np.column_stack([mean(pose[:, 0]), mean(pose[:, 1]), yaw_rad]),
        place=place[order][starts],
        strengths=strengths / norm,
        variance=variance / norm**2,
        is_usable=is_usable,
        level_db=total(20 * np.log10(norm_v[:, 0])) / np.maximum(n_pulses, 1.0),
        azimuth_rad=difference(azimuth_rad, 0.0),
        std_rad=1.0 / np.sqrt(of_bearing),
        n_pulses=n_pulses,
    )


def pair_pulses(pulses: PulseBatch, pose: FloatArray, group: IntArray) -> PulsePairs:
    """Form pairs of consecutive pulses of one pose from similar directions: no gap between these exceeds `PAIR_RAD`.

    Args:
        pulses: Pulses with their directions, in order of time, n rows.
        pose: Estimated x m, y m, yaw rad at each pulse, world frame, shape (n, 3).
        group: Row in `PulsePool.groups` of each pulse, shape (n,).
    """
    moments = np.column_stack([pulses.time_s, pose])
    step = np.cumsum(np.diff(moments, axis=0, prepend=np.nan).any(axis=-1))
    by_azimuth = np.lexsort((pulses.azimuth_rad, step))
    gap_rad = np.diff(pulses.azimuth_rad[by_azimuth], prepend=-np.inf)
    is_first = (np.diff(step[by_azimuth], prepend=-1) > 0) | (gap_rad > PAIR_RAD)
    cluster = np.empty(group.size, dtype=np.intp)
    cluster[by_azimuth] = np.cumsum(is_first)
    order = np.argsort(cluster, kind="stable")
    rank = np.arange(order.size) - np.searchsorted(cluster[order], cluster[order])
    first = np.flatnonzero((rank[:-1] % 2 == 0) & (cluster[order][1:] == cluster[order][:-1]))
    one, other = order[first], order[first + 1]
    strengths_v = pulses.strengths_v * pulses.is_usable
    norm_v = np.maximum(np.linalg.norm(strengths_v, axis=-1, keepdims=True), np.finfo(np.float64).tiny)
    strengths, variance = strengths_v / norm_v, pulses.variance_v2 / norm_v**2
    return PulsePairs(
        np.column_stack([group[one], group[other]]), strengths[other] - strengths[one], variance[one] + variance[other]
    )


class Visibility:
    """Transmission of the direct path from all places to a target, according to the map.

    Args:
        pool: Pool whose places are used.
        sight: Transmission along lines of sight; None without a map.
    """

    def __init__(self, pool: PulsePool, sight: LineOfSight | None) -> None:
        self._pool, self._sight = pool, sight
        self._known: dict[tuple[float, ...], FloatArray] = {}

    def transmission(self, target_m: FloatArray, within_m: float) -> FloatArray:
        """Return the transmission factor from every place to a target (3,), shape (n_places,); see `LineOfSight`.

        Targets are rounded to 0.1 m. Assumed: findings that are already located move less. The results for the last
        1000 targets are cached. For places added later, only the missing entries are computed.
        """
        places_m = self._pool.places_m
        if self._sight is None:
            return np.ones(len(places_m))
        steps = np.rint(target_m / 0.1).astype(np.intp).tolist()
        key = (*steps, within_m)
        known = self._known.get(key, np.empty(0))
        if known.size < len(places_m):
            more = self._sight(places_m[known.size :], np.array(steps) * 0.1, within_m)
            known = self._known[key] = np.concatenate([known, more])
            if len(self._known) > 1000:
                del self._known[next(iter(self._known))]
        return known

    def at_heights(self, position_m: FloatArray, height_std_m: float) -> FloatArray:
        """Return the transmission from all places to a source at likely heights, shape (4, n_places).

        The heights are one standard deviation below the estimate, the estimate, and one and two above it; more above,
        because obstacles are more often below a source (assumed).

        Args:
            position_m: Position of the source, world frame, shape (3,).
            height_std_m: Standard deviation of its height.
        """
        targets = np.tile(position_m, (4, 1))
        targets[:, 2] = np.maximum(targets[:, 2] + height_std_m * np.array([-1.0, 0.0, 1.0, 2.0]), 0.1)
        return np.array([self.transmission(target_m, WITHIN_M) for target_m in targets])

    def is_close_to_edge(self, position_m: FloatArray) -> BoolArray:
        """Return whether the direct path from each place to a source passes close above an edge, shape (n_places,).

        That is so if the source is in free sight, but not a point `EDGE_BELOW_M` below it.
        """
        below_m = np.array([*position_m[:2], max(position_m[2] - EDGE_BELOW_M, 0.1)])
        is_free, is_free_below = (self.transmission(at_m, WITHIN_M) > 0.5 for at_m in (position_m, below_m))
        return is_free & ~is_free_below


def choose_evenly(numbers: IntArray, most: int, weight: FloatArray | None = None) -> IntArray:
    """Choose at most `most` of the given numbers (n,), evenly spread (van der Corput sequence, 1935).

    With weights (n,), they are chosen about in proportion to these (priority sampling; Duffield, Lund and Thorup 2007).
    """
    if numbers.size <= most:
        return numbers
    n_bits = int(numbers.max()).bit_length()
    reversed_bits = np.zeros(1, dtype=np.intp)
    for _ in range(n_bits):
        reversed_bits = np.concatenate([2 * reversed_bits, 2 * reversed_bits + 1])
    rank = (reversed_bits[numbers] + 0.5) / (1.0 if weight is None else weight)
    return numbers[np.sort(np.argpartition(rank, most)[:most])]
