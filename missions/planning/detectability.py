"""Detectability: from which reachable ground each site of the map is in sight, near enough and above the trigger."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.ndimage import minimum_filter

from dirmusic.angles import aperture
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
    """Places from which targets are detectable; rows are targets, columns are reachable cells of the map.

    Attributes:
        names: Names of the targets; `equipment/site`, or `air/NUMBER` on a map without sites.
        positions_m: Their positions, shape (n_targets, 3), world frame.
        cells: Numbers of the cells in the map, ascending, shape (n_cells,).
        places_m: Centres of the cells, shape (n_cells, 2).
        level_db: Level of the direct path over the trigger, shape (n_targets, n_cells); minus infinity behind metal and
            where it was not computed.
        range_m: Horizontal distance, shape (n_targets, n_cells).
        aspect_rad: Horizontal direction from the target to the cell, world frame, shape (n_targets, n_cells).
        is_detectable: True where the target is in sight, `MARGIN_DB` above the trigger and near enough, and where the
            same holds for all reachable cells within 0.5 m if the target has such places; shape (n_targets, n_cells).
    """

    names: tuple[str, ...]
    positions_m: FloatArray
    cells: IntArray
    places_m: FloatArray
    level_db: FloatArray
    range_m: FloatArray
    aspect_rad: FloatArray
    is_detectable: BoolArray

    @property
    def is_blind(self) -> BoolArray:
        """True for targets that no reachable cell detects, shape (n_targets,)."""
        return np.asarray(~self.is_detectable.any(axis=1))

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


def compute_detectability(scenario: Scenario, site_map: SiteMap, amplitude_v: float = AMPLITUDE_V) -> Detectability:
    """Compute the cells from which each target is detectable; the sources of the scenario are ignored.

    For a target that is not detectable within the confirmation range, cells at any range are tried, and those up to 1 m
    (assumed) farther than the nearest one that detects it count. A target keeps isolated cells if it would otherwise
    have less aperture than confirmation requires.

    Args:
        scenario: Array, receiver, route and rules of locating.
        site_map: Map of that scenario.
        amplitude_v: Peak of the discharge in a unit-gain channel 1 m away, > 0.
    """
    rules = scenario.locating.rules()
    within_m = rules.confirm_range_m
    names, positions_m = targets_of(site_map, within_m)
    cells = np.flatnonzero(np.isfinite(site_map.reach(scenario.route.dock_m).length_m))
    places_m = site_map.centres_m[cells]
    away_m = places_m - positions_m[:, np.newaxis, :2]
    range_m = np.linalg.norm(away_m, axis=-1)
    level_db, is_detectable = np.full(range_m.shape, -np.inf), np.zeros(range_m.shape, dtype=np.bool_)
    direct = DirectPaths(scenario.array, scenario.receiver, site_map.sight)
    for k, target_m in enumerate(positions_m):
        for near in (range_m[k] <= within_m, range_m[k] > within_m):
            transmission, level_db[k, near] = direct.levels(places_m[near], target_m, amplitude_v)
            is_detectable[k, near] = (transmission >= MIN_TRANSMISSION) & (level_db[k, near] >= MARGIN_DB)
            if is_detectable[k].any():
                break
        nearest_m = range_m[k, is_detectable[k]].min(initial=np.inf)
        is_detectable[k] &= range_m[k] <= max(within_m, nearest_m + 1.0)
    aspect_rad = np.arctan2(away_m[..., 1], away_m[..., 0])
    is_robust = _robust(is_detectable, cells, site_map)
    for k, aspects in enumerate(aspect_rad):
        required_rad = min(aperture(aspects[is_detectable[k]]), rules.planned_aperture_rad)
        if is_robust[k].any() and aperture(aspects[is_robust[k]]) >= required_rad:
            is_detectable[k] = is_robust[k]
    return Detectability(names, positions_m, cells, places_m, level_db, range_m, aspect_rad, is_detectable)


def _robust(is_detectable: BoolArray, cells: IntArray, site_map: SiteMap) -> BoolArray:
    """Return the cells around which all reachable cells detect as well, shape (n_targets, n_cells).

    The robot deviates from its path by up to two cells, 0.5 m (assumed).
    """
    shape = tuple(round(size / CELL_M) for size in site_map.yard.size_m)
    ground = np.ones((len(is_detectable), shape[0] * shape[1]), dtype=np.bool_)  # unreachable cells do not count
    ground[:, cells] = is_detectable
    around = minimum_filter(ground.reshape(-1, *shape), size=(1, 5, 5), mode="constant", cval=True)
    return around.reshape(ground.shape)[:, cells]


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

    def levels(
        self, places_m: FloatArray, target_m: FloatArray, amplitude_v: float = AMPLITUDE_V
    ) -> tuple[FloatArray, FloatArray]:
        """Return the transmission of equipment and the level over the trigger in decibels, each of shape (n,).

        Args:
            places_m: Places on the ground below the array, shape (n, 2), world frame.
            target_m: The discharge, shape (3,), world frame.
            amplitude_v: Its peak in a unit-gain channel 1 m away, > 0.
        """
        transmission = self._sight(np.column_stack([places_m, np.full(len(places_m), self._height_m)]), target_m)
        range_m, rise_m = np.linalg.norm(places_m - target_m[:2], axis=-1), target_m[2] - self._height_m
        gain = np.interp(np.arctan2(rise_m, range_m), self._elevations_rad, self._worst_gain)
        peak_v = amplitude_v * transmission * gain
        with np.errstate(divide="ignore"):
            return transmission, 20 * np.log10(peak_v / (np.hypot(range_m, rise_m) * self._trigger_v))
