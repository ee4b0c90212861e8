"""Audibility: from which ground that the robot can reach each site of the map is heard, in sight and near enough."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.angles import aperture
from dirmusic.locating.joint_fit import HEIGHT_PRIOR_M
from pdpatrol.envs import Scenario
from pdpatrol.missions.driving.site_map import CELL_M, MIN_TRANSMISSION, SiteMap
from pdpatrol.sensing import ArrayConfig, HelicalArray, ReceiverConfig
from pdpatrol.sensing.radio.sight import Sight
from pdpatrol.sensing.receiver.receiver import Receiver

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

AMPLITUDE_V = 0.05
"""Peak 1 m away of the quietest discharge that the tour is to hear (assumed): the weakest of the suite's `weak`."""

MARGIN_DB = 3.0
"""How far above the trigger the straight path alone has to be (assumed): amplitudes spread, and the ground mirrors."""

HEADINGS_RAD = np.radians(np.arange(0.0, 360.0, 2.0))
ELEVATIONS_RAD = np.radians(np.arange(-90.0, 91.0))
"""Where the gain of the array is asked for; linear in between."""

FARTHER_M = 1.0
"""What is heard from beyond the range of confirmation alone may be heard from so much farther than needs be (assumed):
a band of a few cells."""


STRAYS_CELLS = 2
"""The robot cuts corners and stops short of its stops: a cell counts as one that hears if all do that are so many cells
away along x and y at most and can be reached (assumed: 0.5 m)."""


class Target(NamedTuple):
    """What is to be heard.

    Attributes:
        name: Of the site, as `equipment/site`.
        position_m: Shape (3,), world frame.
    """

    name: str
    position_m: FloatArray


class Hearing(NamedTuple):
    """Where targets are heard from; rows are targets, columns cells of the map that the robot can reach.

    Attributes:
        targets: What is to be heard.
        cells: Numbers of the cells in the map, ascending, shape (n_cells,).
        places_m: Their centres, shape (n_cells, 2).
        level_db: Level of the straight path over the trigger, shape (n_targets, n_cells); minus infinity behind metal,
            and farther away than is asked for.
        range_m: Distance on plan, shape (n_targets, n_cells).
        aspect_rad: Direction on plan from the target to the cell, world frame, shape (n_targets, n_cells).
        is_heard: Whether it is heard: in sight, above the trigger by `MARGIN_DB`, near enough, and not only just there
            (`STRAYS_CELLS`) where there are such cells; shape (n_targets, n_cells).
    """

    targets: tuple[Target, ...]
    cells: IntArray
    places_m: FloatArray
    level_db: FloatArray
    range_m: FloatArray
    aspect_rad: FloatArray
    is_heard: BoolArray

    @property
    def is_blind(self) -> BoolArray:
        """Targets that no reachable place hears, shape (n_targets,)."""
        return np.asarray(~self.is_heard.any(axis=1), dtype=np.bool_)

    def columns(self, cells: IntArray) -> IntArray:
        """Columns of cells of the map, all of which can be reached, same shape."""
        return np.searchsorted(self.cells, cells)


def targets_of(site_map: SiteMap, spacing_m: float) -> tuple[Target, ...]:
    """The sites of the map; of one without any, free air over a lattice: a patrol has something to go for.

    Args:
        site_map: The map.
        spacing_m: Most that rows and columns of the lattice are apart.
    """
    yard = site_map.yard
    if names := yard.site_names():
        return tuple(Target(name, yard.site_position(name)) for name in names)
    lattice = [size * (np.arange(n) + 0.5) / n for size, n in ((s, int(np.ceil(s / spacing_m))) for s in yard.size_m)]
    places_m = [np.array([x, y, HEIGHT_PRIOR_M[0]]) for x in lattice[0] for y in lattice[1]]
    free_m = [place_m for place_m in places_m if yard.enclosing_equipment(place_m) is None]
    return tuple(Target(f"air/{number}", place_m) for number, place_m in enumerate(free_m, start=1))


def hear(scenario: Scenario, site_map: SiteMap, amplitude_v: float = AMPLITUDE_V) -> Hearing:
    """Audibility of all targets; of the scenario its sources do not count.

    What is nowhere heard within the range of confirmation is asked for at any distance, and then counts as heard up to
    `FARTHER_M` beyond the nearest place that hears it. What is heard here and there alone counts as heard in each cell
    that hears it: where others would leave it less aperture than confirmation wants.

    Args:
        scenario: Array, receiver, route and rules of locating.
        site_map: Of that scenario.
        amplitude_v: Peak of the discharge in a unit-gain channel 1 m away, > 0.
    """
    rules = scenario.locating.rules()
    within_m = rules.confirm_range_m
    targets = targets_of(site_map, within_m)
    cells = np.flatnonzero(np.isfinite(site_map.reach(scenario.route.dock_m).length_m)).astype(np.intp)
    places_m = site_map.centres_m[cells]
    targets_m = np.array([target.position_m for target in targets]).reshape(-1, 3)
    away_m = places_m - targets_m[:, np.newaxis, :2]
    range_m = np.linalg.norm(away_m, axis=-1)
    level_db, is_heard = np.full(range_m.shape, -np.inf), np.zeros(range_m.shape, dtype=np.bool_)
    straight = StraightPaths(scenario.array, scenario.receiver, site_map.sight)
    for k, target_m in enumerate(targets_m):
        for near in (range_m[k] <= within_m, range_m[k] > within_m):
            share, level_db[k, near] = straight.heard(places_m[near], target_m, amplitude_v)
            is_heard[k, near] = (share >= MIN_TRANSMISSION) & (level_db[k, near] >= MARGIN_DB)
            if is_heard[k].any():
                break
        nearest_m = range_m[k, is_heard[k]].min(initial=np.inf)
        is_heard[k] &= range_m[k] <= max(within_m, nearest_m + FARTHER_M)
    aspect_rad = np.arctan2(away_m[..., 1], away_m[..., 0])
    surely = _heard_all_round(is_heard, cells, site_map)
    for k, aspects in enumerate(aspect_rad):
        widest_rad = min(aperture(aspects[is_heard[k]]), rules.planned_aperture_rad)
        if surely[k].any() and aperture(aspects[surely[k]]) >= widest_rad:
            is_heard[k] = surely[k]
    return Hearing(targets, cells, places_m, level_db, range_m, aspect_rad, is_heard)


def _heard_all_round(is_heard: BoolArray, cells: IntArray, site_map: SiteMap) -> BoolArray:
    """Cells that hear, and round which all cells within reach do; shape as of `is_heard`, (n_targets, n_cells)."""
    from scipy.ndimage import minimum_filter

    shape = tuple(round(size / CELL_M) for size in site_map.yard.size_m)
    surely = np.empty_like(is_heard)
    for k, row in enumerate(is_heard):
        ground = np.ones(shape[0] * shape[1], dtype=np.uint8)  # what cannot be reached does not count
        ground[cells] = row
        around = minimum_filter(ground.reshape(shape), size=2 * STRAYS_CELLS + 1, mode="constant", cval=1)
        surely[k] = around.ravel()[cells] > 0
    return surely


def trigger_peak(receiver: Receiver) -> float:
    """Peak of a pulse before the band-pass that just triggers, volts."""
    return receiver.threshold_v / receiver.front_end.pulse_peak


class StraightPaths:
    """How loud discharges are on the straight path, to an array on its robot in the worst heading.

    Args:
        array: The array.
        receiver: Whose trigger levels are over.
        sight: What the equipment of the map leaves of waves.
    """

    def __init__(self, array: ArrayConfig, receiver: ReceiverConfig, sight: Sight) -> None:
        self._height_m = array.height_m
        self._least_gain = _least_gain(array)
        self._trigger_v = trigger_peak(Receiver(receiver, array.n_channels))
        self._sight = sight

    def heard(
        self, places_m: FloatArray, target_m: FloatArray, amplitude_v: float = AMPLITUDE_V
    ) -> tuple[FloatArray, FloatArray]:
        """Share of the wave that equipment leaves, and level over the trigger in decibels, each of shape (n,).

        Args:
            places_m: On the ground under the array, shape (n, 2), world frame.
            target_m: The discharge, shape (3,), world frame.
            amplitude_v: Its peak in a unit-gain channel 1 m away, > 0.
        """
        share = self._sight(np.column_stack([places_m, np.full(len(places_m), self._height_m)]), target_m)
        range_m, rise_m = np.linalg.norm(places_m - target_m[:2], axis=-1), target_m[2] - self._height_m
        gain = np.interp(np.arctan2(rise_m, range_m), ELEVATIONS_RAD, self._least_gain)
        with np.errstate(divide="ignore"):
            return share, 20 * np.log10(amplitude_v * share * gain / (np.hypot(range_m, rise_m) * self._trigger_v))


def _least_gain(config: ArrayConfig) -> FloatArray:
    """Gain of the loudest element in the robot's worst heading, towards `ELEVATIONS_RAD`.

    A linear wave loses nothing else, whatever its direction: half its power is in the measured gain of a circular
    antenna (`pdpatrol.sensing.radio.polarisation.received`).
    """
    array = HelicalArray.nominal(config)
    shape = (HEADINGS_RAD.size, ELEVATIONS_RAD.size, array.n_elements)
    azimuth_rad = np.broadcast_to(HEADINGS_RAD[:, np.newaxis, np.newaxis], shape)
    gain = array.gain(azimuth_rad, np.broadcast_to(ELEVATIONS_RAD[:, np.newaxis], shape))
    return gain.max(axis=-1).min(axis=0)
