"""Patrol plan of a yard: the sites that can be detected, and a tour that detects them."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import compress
from typing import NamedTuple

import numpy as np

from dirmusic.arrays import FloatArray, IntArray
from pdpatrol.envs import Scenario
from pdpatrol.envs.scenario import ScenarioError, restore_scenario
from pdpatrol.envs.scenario.scenario import PLANNED
from pdpatrol.missions.driving.site_map import CELL_M, COMFORT_M, SiteMap
from pdpatrol.missions.planning.confirmation_probability import CERTAIN, ConfirmationModel, Passes
from pdpatrol.missions.planning.cover import CROSSING_RAD, MIN_CELLS, candidates, cover, coverage
from pdpatrol.missions.planning.detectability import AMPLITUDE_V, Detectability, compute_detectability
from pdpatrol.missions.planning.shift import PlannedRoute, ShiftPlan, plan_shift
from pdpatrol.missions.planning.tour import ShortestTours, Tour, TourShortener

DWELLS_S = (0.0, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 300.0)
"""Times to stand at each stop, among which a plan chooses."""

NEARLY_ALL = 0.95
"""Share of these sites for which the time to stand suffices. Assumed; the last few sites of a large yard would need
minutes at each of hundreds of stops."""

POSE_STEP = 4
"""Number of cells of the path for each pose from which the robot listens, 1.2 s of driving at 0.8 m/s. Assumed; pulses
count in windows of 5 s."""

HALT_S = 2.0
"""Time for each stop, and for the dock at the end. Measured on patrols of six random yards: 1.1 to 2.4 s at 0.8 m/s,
including the turns between stops."""


@dataclass(frozen=True, eq=False)
class Plan:
    """Patrol plan of a yard.

    Attributes:
        scenario: Scenario for which the plan was made.
        site_map: Map of the scenario.
        amplitude_v: Peak of the weakest discharge to detect, 1 m away.
        detectability: Places from which each site is detectable.
        required: Coverage that the tour must provide, shape (n_sites, 3), with the columns of `coverage`. The first is
            the aperture that routes are planned for, or the widest possible if that is smaller. The others are the
            values of the tour before shortening, limited to `CROSSING_RAD` and `MIN_CELLS`.
        tour: The tour; only the dock's cell if nothing is detectable.
        bound_m: Lower bound of the length of all tours past the same stops.
        stops_m: Stops of the tour in order, shape (n_stops, 2), world frame.
        path_m: Path of the tour from the dock and back, shape (n, 2).
        driving_s: Approximate duration of the tour without dwelling at its stops.
    """

    scenario: Scenario
    site_map: SiteMap
    amplitude_v: float
    detectability: Detectability
    required: FloatArray
    tour: Tour
    bound_m: float
    stops_m: FloatArray
    path_m: FloatArray
    driving_s: float

    @property
    def gap(self) -> float:
        """Relative optimality gap: largest fraction by which the tour is longer than the shortest past its stops."""
        return max(self.tour.length_m / self.bound_m - 1.0, 0.0) if self.tour.length_m > 0.0 else 0.0

    @property
    def blind(self) -> tuple[str, ...]:
        """Names of the sites that are not detectable from any reachable place."""
        return tuple(compress(self.detectability.names, self.detectability.is_blind))

    def detections(self) -> list[SiteDetection | None]:
        """Return how the tour detects each site; None for sites that are not detectable from any reachable place."""
        where, path = self.detectability, np.zeros(self.detectability.cells.size, dtype=np.bool_)
        path[where.columns(self.tour.cells)] = True
        found: list[SiteDetection | None] = []
        for k, aperture_rad in enumerate(coverage(where, self.tour.cells)[:, 0].tolist()):
            pairs = where.pairs(k)
            is_seen = path[where.column[pairs]]
            level_db, range_m = where.level_db[pairs][is_seen], where.range_m[pairs][is_seen]
            found.append(
                SiteDetection(float(level_db.max()), aperture_rad, float(range_m.min())) if len(range_m) else None
            )
        return found

    @cached_property
    def dwell_s(self) -> float:
        """Shortest of `DWELLS_S` with which nearly all sites are confirmed for certain that are with the longest."""
        left, n_left = np.arange(len(self.detectability.names)), list[int]()
        for dwell_s in DWELLS_S:
            left = left[self._confirmations(dwell_s, left) < CERTAIN]
            n_left.append(left.size)
        n_most = len(self.detectability.names) - n_left[-1]
        is_enough = [n - n_left[-1] <= (1.0 - NEARLY_ALL) * n_most for n in n_left]
        return DWELLS_S[is_enough.index(True)]

    @cached_property
    def confirmed(self) -> FloatArray:
        """Probability that the stated discharge would be confirmed at each site, shape (n_sites,)."""
        return self._confirmations(self.dwell_s, np.arange(len(self.detectability.names)))

    def _confirmations(self, dwell_s: float, sites: IntArray) -> FloatArray:
        """Return the probability that the stated discharge would be confirmed at sites, shape (n_sites,).

        Args:
            dwell_s: Time for which the robot stands at each stop.
            sites: Indices of the sites.
        """
        stated, sites_m = self.scenario.inspection, self.detectability.positions_m[sites]
        if len(self.path_m) < 2:
            return np.zeros(len(sites_m))
        stops = np.flatnonzero(np.isin(self.tour.cells, self.tour.stops))
        stops = stops[np.unique(self.tour.cells[stops], return_index=True)[1]]  # it may pass a stop again
        is_pose = np.arange(len(self.path_m)) % POSE_STEP == 0
        is_pose[stops] = is_pose[-1] = True
        speed_mps, at = self.scenario.robot.description.max_speed_mps, np.cumsum(is_pose) - 1
        passes = Passes.along(self.path_m[is_pose], speed_mps, at[stops], dwell_s)
        model = ConfirmationModel(self.scenario, self.site_map.sight)
        views = (model.views(passes, site_m) for site_m in sites_m)
        return np.array([model.chances(each, stated.level_dbv, stated.rate_hz).confirmed for each in views])

    @cached_property
    def shift(self) -> ShiftPlan:
        """Energy and charges of a round."""
        route = PlannedRoute(self.path_m, self.stops_m, self.dwell_s, HALT_S)
        return plan_shift(self.scenario, self.site_map, route)


class SiteDetection(NamedTuple):
    """Detection of one site on a tour.

    Attributes:
        level_db: Highest level of the direct path along the tour, relative to the trigger level.
        aperture_rad: Angle over which the places of detection spread, seen from the site.
        nearest_m: Smallest horizontal distance of these places from the site.
    """

    level_db: float
    aperture_rad: float
    nearest_m: float


def make_plan(
    scenario: Scenario, amplitude_v: float = AMPLITUDE_V, progress: Callable[[str, float], None] = lambda *_: None
) -> Plan:
    """Plan the patrol of a yard on the robot's map; the sources, the true yard and the scenario's route are ignored.

    Args:
        scenario: Scenario with the map, dock, robot, array, receiver, pose sensor and rules of locating.
        amplitude_v: Peak of the weakest discharge to detect, in a unit-gain channel 1 m away, > 0.
        progress: Function that is called with the name of the next step and the fraction done.
    """
    progress("map", 0.0)
    site_map = SiteMap(scenario)
    detectability = compute_detectability(
        scenario, site_map, amplitude_v, lambda share: progress("detectability", 0.1 + 0.2 * share)
    )
    progress("cover", 0.3)
    clearance_m = site_map.clearance_m[detectability.cells]
    widest_rad = coverage(detectability, detectability.cells)[:, 0]
    required_rad = np.minimum(widest_rad, scenario.locating.rules().planned_aperture_rad)
    columns = cover(detectability, candidates(detectability, clearance_m, required_rad), required_rad)
    tours, speed_mps = ShortestTours(site_map), scenario.robot.description.max_speed_mps
    longer = tours.in_order(tours.shortest(detectability.cells[columns].tolist()))
    offered = coverage(detectability, longer.cells)
    required = np.column_stack([required_rad, np.minimum(offered[:, 1:], [CROSSING_RAD, MIN_CELLS])])
    every_fourth = np.floor(detectability.places_m / CELL_M).astype(np.intp) % 4 == 2  # 1 m apart (assumed)
    is_stop = every_fourth.all(axis=1) & (clearance_m >= COMFORT_M)

    def report(n_left: int) -> None:
        progress(f"tour of {n_left} stops", 0.9 - 0.4 * n_left / max(columns.size, 1))

    shortener = TourShortener(detectability, tours, required, is_stop, HALT_S * speed_mps, report)
    tour = tours.in_order(shortener.shorten(longer.stops.tolist()))
    n_halts = tour.stops.size + 1 if tour.length_m > 0.0 else 0
    path_m, limit_mps = site_map.centres_m[tour.cells], site_map.speed_limit(site_map.centres_m[tour.cells])
    return Plan(
        scenario=scenario,
        site_map=site_map,
        amplitude_v=amplitude_v,
        detectability=detectability,
        required=required,
        tour=tour,
        bound_m=tours.bound_m(tour),
        stops_m=site_map.centres_m[tour.stops],
        path_m=path_m,
        driving_s=float((np.linalg.norm(np.diff(path_m, axis=0), axis=1) / limit_mps[1:]).sum()) + HALT_S * n_halts,
    )


def with_planned_route(scenario: Scenario) -> Scenario:
    """Return the scenario with a planned route if it has `waypoints_m = "planned"`; otherwise return it unchanged.

    The environment cannot plan, because planning is part of `missions`. Call this function before starting a mission.

    Raises:
        ScenarioError: If no site is detectable from any reachable place.
    """
    if scenario.route.waypoints_m != PLANNED:
        return scenario
    waypoints_m = _planned_waypoints(scenario.model_dump_json())
    if not waypoints_m:
        raise ScenarioError(
            [f'{scenario.name}: route.waypoints_m: no site is detectable from reachable ground, got "{PLANNED}"; give '
             "points instead"]
        )  # fmt: skip
    return scenario.model_copy(update={"route": scenario.route.model_copy(update={"waypoints_m": waypoints_m})})


@lru_cache(maxsize=16)
def _planned_waypoints(scenario: str) -> tuple[tuple[float, float], ...]:
    """Plan the waypoints for a scenario given as JSON, cached so that missions with different seeds share a plan."""
    return tuple(map(tuple, make_plan(restore_scenario(json.loads(scenario))).stops_m.tolist()))
