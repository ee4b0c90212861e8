"""Detectability: from which reachable ground each site of the map is in sight, near enough and above the trigger."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.ndimage import minimum_filter

from dirmusic.angles import aperture, azimuth_of
from dirmusic.arrays import BoolArray, FloatArray, IntArray
from dirmusic.locating.joint_fit import HEIGHT_PRIOR_M
from pdpatrol.envs import Scenario
from pdpatrol.missions.driving.site_map import CELL_M, MIN_TRANSMISSION, SiteMap
from pdpatrol.sensing import ArrayConfig, HelicalArray, ReceiverConfig
from pdpatrol.sensing.radio.transmission import Sight
from pdpatrol.sensing.receiver.receiver import Receiver

AMPLITUDE_V = 0.05
"""Peak, 1 m away, of the weakest discharge to detect. Assumed; the weakest of the suite's level `weak`."""

MARGIN_DB = 3.0
"""Margin of the direct path over the trigger. Assumed; amplitudes vary, and the ground reflects."""


class Detectability(NamedTuple):
    """Places from which targets are detectable: pairs of a target and a reachable cell of the map that detects it.

    Pairs are sorted by target, then by aspect.

    Attributes:
        names: Names of the targets; `equipment/site`, or `air/NUMBER` on a map without sites.
        positions_m: Their positions, shape (n_targets, 3), world frame.
        cells: Numbers of the reachable cells in the map, ascending, shape (n_cells,).
        places_m: Centres of the cells, shape (n_cells, 2).
        first: Index of the first pair of each target, and the number of pairs, shape (n_targets + 1,).
        column: Index of the cell of each pair in `cells`, shape (n_pairs,).
        level_db: Level of the direct path over the trigger, shape (n_pairs,).
        range_m: Horizontal distance, shape (n_pairs,).
        aspect_rad: Horizontal direction from the target to the cell, world frame, shape (n_pairs,).
    """

    names: tuple[str, ...]
    positions_m: FloatArray
    cells: IntArray
    places_m: FloatArray
    first: IntArray
    column: IntArray
    level_db: FloatArray
    range_m: FloatArray
    aspect_rad: FloatArray

    @property
    def is_blind(self) -> BoolArray:
        """True for targets that no reachable cell detects, shape (n_targets,)."""
        return np.diff(self.first) == 0

    def pairs(self, target: int) -> slice:
        """Return the pairs of a target."""
        return slice(int(self.first[target]), int(self.first[target + 1]))

    def columns(self, cells: IntArray) -> IntArray:
        """Return the columns of reachable cells of the map, same shape."""
        return np.searchsorted(self.cells, cells)


def targets_of(site_map: SiteMap, spacing_m: float) -> tuple[tuple[str, ...], FloatArray]:
    """Return names and positions (n, 3) of the sites of the map, or of a lattice in free air if it has no sites.

    Args:
        site_map: The map.
        spacing_m: Largest distance between rows and between columns of the lattice.
    """
    yard = site_map.yard
    if names := tuple(yard.site_names()):
        return names, np.array([yard.site_position(name) for name in names])
    n_rows = np.ceil(np.array(yard.size_m) / spacing_m)
    x_m, y_m = (size * (np.arange(n) + 0.5) / n for size, n in zip(yard.size_m, n_rows, strict=True))
    places_m = [np.array([x, y, HEIGHT_PRIOR_M[0]]) for x in x_m for y in y_m]
    free_m = [place_m for place_m in places_m if yard.enclosing_equipment(place_m) is None]
    return tuple(f"air/{number}" for number in range(1, len(free_m) + 1)), np.array(free_m).reshape(-1, 3)


def compute_detectability(
    scenario: Scenario,
    site_map: SiteMap,
    amplitude_v: float = AMPLITUDE_V,
    progress: Callable[[float], None] = lambda _: None,
) -> Detectability:
    """Compute the cells from which each target is detectable; the sources of the scenario are ignored.

    A cell detects a target if it has the target in sight, `MARGIN_DB` above the trigger and near enough. For a target
    that is not detectable within the confirmation range, cells at any range are tried, and those up to 1 m (assumed)
    farther than the nearest one that detects it count. Only cells count around which all reachable cells within 0.5 m
    detect the target as well, unless the target would then have less aperture than confirmation requires.

    Args:
        scenario: Array, receiver, route and rules of locating.
        site_map: Map of that scenario.
        amplitude_v: Peak of the discharge in a unit-gain channel 1 m away, > 0.
        progress: Function that is called with the fraction of the targets that are done.
    """
    rules = scenario.locating.rules()
    names, positions_m = targets_of(site_map, rules.confirm_range_m)
    cells = np.flatnonzero(np.isfinite(site_map.reach(scenario.route.dock_m).length_m))
    shape = tuple(round(size / CELL_M) for size in site_map.yard.size_m)
    column_of = np.full(shape[0] * shape[1], -1)
    column_of[cells] = np.arange(cells.size)
    places_m, ground = site_map.centres_m[cells], column_of.reshape(shape)
    direct = DirectPaths(scenario.array, scenario.receiver, site_map.sight)
    found = [(np.empty(0, dtype=np.intp), np.empty(0), np.empty(0), np.empty(0))]
    for k, target_m in enumerate(positions_m):
        progress(k / len(positions_m))
        column, range_m, level_db = _detecting(target_m, ground, places_m, direct, rules.confirm_range_m, amplitude_v)
        aspect_rad = azimuth_of(places_m[column] - target_m[:2])
        required_rad = min(aperture(aspect_rad), rules.planned_aperture_rad)
        robust = _is_robust(column, ground, places_m)
        order = np.argsort(aspect_rad, kind="stable")
        if robust.any() and aperture(aspect_rad[robust]) >= required_rad:
            order = order[robust[order]]
        found.append((column[order], level_db[order], range_m[order], aspect_rad[order]))
    first = np.cumsum([len(column) for column, *_ in found])
    return Detectability(names, positions_m, cells, places_m, first, *map(np.concatenate, zip(*found, strict=True)))


def _detecting(
    target_m: FloatArray,
    ground: IntArray,
    places_m: FloatArray,
    direct: DirectPaths,
    within_m: float,
    amplitude_v: float,
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the columns of the cells that detect a target, with horizontal distance and level over the trigger.

    Args:
        target_m: The target, shape (3,).
        ground: Column of each cell of the map, -1 for unreachable cells, shape (n_x, n_y).
        places_m: Places of the columns, shape (n_cells, 2).
        direct: Levels along the direct path.
        within_m: Range within which all cells count.
        amplitude_v: Peak of the discharge.
    """
    farthest_m, reach_m = direct.largest_range_m(amplitude_v), within_m
    while True:
        column = _block(ground, target_m, target_m, reach_m)
        column = column[column >= 0]
        range_m = np.linalg.norm(places_m[column] - target_m[:2], axis=-1)
        column, range_m = column[range_m <= reach_m], range_m[range_m <= reach_m]
        transmission, level_db = direct.levels(places_m[column], target_m, amplitude_v)
        detects = (transmission >= MIN_TRANSMISSION) & (level_db >= MARGIN_DB)
        limit_m = max(within_m, range_m[detects].min(initial=np.inf) + 1.0)
        if np.isinf(limit_m) and reach_m < farthest_m:
            reach_m = min(2.0 * reach_m, farthest_m)
        elif reach_m < limit_m < np.inf:
            reach_m = limit_m
        else:
            detects &= range_m <= limit_m
            return column[detects], range_m[detects], level_db[detects]


def _block(ground: IntArray, low_m: FloatArray, high_m: FloatArray, margin_m: float) -> IntArray:
    """Return the part of a grid of cells (n_x, n_y) that contains all cells up to a margin from a rectangle."""
    (x, y), (x_end, y_end) = (
        np.maximum(np.floor((corner_m[:2] + sign * margin_m) / CELL_M).astype(np.intp) + one, 0)
        for corner_m, sign, one in ((low_m, -1.0, 0), (high_m, 1.0, 1))
    )
    return ground[x:x_end, y:y_end]


def _is_robust(column: IntArray, ground: IntArray, places_m: FloatArray) -> BoolArray:
    """Return which of some cells have none but them among the reachable cells around, same shape.

    The robot deviates from its path by up to two cells, 0.5 m (assumed).
    """
    if column.size == 0:
        return np.empty(0, dtype=np.bool_)
    block = _block(ground, places_m[column].min(axis=0), places_m[column].max(axis=0), 2 * CELL_M)
    detects, is_robust = np.zeros((2, len(places_m)), dtype=np.bool_)
    detects[column] = True
    around = minimum_filter(detects[block] | (block < 0), size=5, mode="constant", cval=True)
    is_robust[block[around & (block >= 0)]] = True
    return is_robust[column]


class DirectPaths:
    """Levels of discharges along the direct path at the strongest element, for the worst heading of the robot.

    A linearly polarised wave has no further loss, whatever its direction: the measured gain of a circularly polarised
    antenna already includes the loss of half the power (`pdpatrol.sensing.radio.polarisation.received`).

    Args:
        array: The array.
        receiver: The receiver, whose trigger is the reference of levels.
        sight: Transmission of the mapped equipment.
    """

    def __init__(self, array: ArrayConfig, receiver: ReceiverConfig, sight: Sight) -> None:
        self._height_m = array.height_m
        self._elevations_rad, headings_rad = np.radians(np.arange(-90.0, 91.0)), np.radians(np.arange(0.0, 360.0, 2.0))
        towards = headings_rad[:, np.newaxis, np.newaxis], self._elevations_rad[:, np.newaxis]
        self._worst_gain = HelicalArray.nominal(array).gain(*towards).max(axis=-1).min(axis=0)
        trigger = Receiver(receiver, array.n_channels)
        self._trigger_v = trigger.threshold_v / trigger.front_end.pulse_peak  # before the band-pass filter
        self._sight = sight

    def largest_range_m(self, amplitude_v: float) -> float:
        """Return a distance beyond which no discharge of this amplitude is `MARGIN_DB` above the trigger."""
        return amplitude_v * self._worst_gain.max() / (self._trigger_v * 10 ** (MARGIN_DB / 20))

    def levels(
        self, places_m: FloatArray, target_m: FloatArray, amplitude_v: float = AMPLITUDE_V
    ) -> tuple[FloatArray, FloatArray]:
        """Return the transmission of equipment and the level over the trigger in decibels, each of shape (n,).

        Where the level would be less than `MARGIN_DB` even in free space, the transmission is stated as 0.

        Args:
            places_m: Places on the ground below the array, shape (n, 2), world frame.
            target_m: The discharge, shape (3,), world frame.
            amplitude_v: Its peak in a unit-gain channel 1 m away, > 0.
        """
        range_m, rise_m = np.linalg.norm(places_m - target_m[:2], axis=-1), target_m[2] - self._height_m
        gain = np.interp(np.arctan2(rise_m, range_m), self._elevations_rad, self._worst_gain)
        over_trigger = amplitude_v * gain / (np.hypot(range_m, rise_m) * self._trigger_v)
        is_strong, transmission = over_trigger >= 10 ** (MARGIN_DB / 20), np.zeros(len(places_m))
        antennas_m = np.column_stack([places_m, np.full(len(places_m), self._height_m)])[is_strong]
        transmission[is_strong] = self._sight(antennas_m, target_m)
        with np.errstate(divide="ignore"):
            return transmission, 20 * np.log10(transmission * over_trigger)
