"""The plan of a yard: what can be detected, the tour that detects it, and how accurately it is located."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.locating.finding import ellipse95
from pdpatrol.envs import Scenario
from pdpatrol.envs.scenario import ScenarioError, restore_scenario
from pdpatrol.envs.scenario.scenario import PLANNED
from pdpatrol.missions.driving.site_map import CELL_M, COMFORT_M, SiteMap
from pdpatrol.missions.planning.cover import Coverage, apertures, candidates, cover, required_coverage
from pdpatrol.missions.planning.detectability import AMPLITUDE_V, Detectability, compute_detectability
from pdpatrol.missions.planning.forecast import Forecast, driving_time, views_along
from pdpatrol.missions.planning.tour import CellPaths, Tour, TourShortener, shortest_tour_of

FloatArray = NDArray[np.float64]


class SiteDetection(NamedTuple):
    """How a tour detects one site.

    Attributes:
        level_db: Highest level of the direct path over the trigger along the tour.
        aperture_rad: Angle over which the places that detect it spread, seen from the site.
        nearest_m: Smallest horizontal distance of these places.
        ellipse95_semi_major_m: Expected semi-major axis of the 95 % ellipse of a discharge there.
        height_std_m: Expected standard deviation of its height.
    """

    level_db: float
    aperture_rad: float
    nearest_m: float
    ellipse95_semi_major_m: float
    height_std_m: float


class PlannedSite(NamedTuple):
    """A site of the map.

    Attributes:
        name: As in `Detectability`.
        position_m: Position, shape (3,), world frame.
        needed_rad: Required aperture: that of confirmation, or the widest possible if less.
        crossing_rad: Required crossing angle of the lines of sight, see `Coverage`.
        n_cells: Required number of cells of the path that detect it.
        detection: How the tour detects it; None if no reachable place does.
    """

    name: str
    position_m: FloatArray
    needed_rad: float
    crossing_rad: float
    n_cells: int
    detection: SiteDetection | None


class Plan(NamedTuple):
    """The plan of a yard.

    Attributes:
        scenario: Scenario for which the plan was made.
        site_map: Its map.
        amplitude_v: Peak, 1 m away, of the weakest discharge to detect.
        stops_m: Stops of the tour in order, shape (n_stops, 2), world frame.
        path_m: Path of the tour from the dock and back, shape (n, 2); only the dock's cell if nothing is detectable.
        length_m: Length of the tour.
        driving_s: Approximate duration of the tour.
        sites: Sites in the order of the map.
        detectability: Where each site is detectable from, rows as in `sites`.
    """

    scenario: Scenario
    site_map: SiteMap
    amplitude_v: float
    stops_m: FloatArray
    path_m: FloatArray
    length_m: float
    driving_s: float
    sites: tuple[PlannedSite, ...]
    detectability: Detectability

    @property
    def blind(self) -> tuple[str, ...]:
        """Names of the sites that no reachable place detects."""
        return tuple(site.name for site in self.sites if site.detection is None)


def make_plan(
    scenario: Scenario, amplitude_v: float = AMPLITUDE_V, progress: Callable[[str, float], None] = lambda *_: None
) -> Plan:
    """Plan the patrol of a yard on the robot's map; sources, true yard and present route are ignored.

    Args:
        scenario: Map, dock, robot, array, receiver, pose sensor and rules of locating.
        amplitude_v: Peak of the weakest discharge to detect, in a unit-gain channel 1 m away, > 0.
        progress: Called with the next step and the fraction that is done.
    """
    progress("detectability", 0.0)
    site_map = SiteMap(scenario)
    detectability = compute_detectability(scenario, site_map, amplitude_v)
    progress("cover", 0.1)
    tour, required = _find_tour(scenario, site_map, detectability, progress)
    progress("expected accuracy", 0.9)
    forecast = Forecast(scenario, site_map, amplitude_v)
    top_speed_mps = scenario.robot.description.max_speed_mps
    views = views_along(tour, detectability, top_speed_mps)
    path = detectability.columns(tour.cells)
    aperture_rad = apertures(detectability, path)
    sites: list[PlannedSite] = []
    for k, (name, position_m) in enumerate(zip(detectability.names, detectability.positions_m, strict=True)):
        columns, detection = path[detectability.is_detectable[k, path]], None
        if columns.size:
            is_used = forecast.detects(position_m, views)
            if not is_used.any():  # detected between two views
                is_used[np.abs(views.column - columns[0]).argmin()] = True
            covariance_m2 = forecast.covariance(position_m, views, is_used)
            detection = SiteDetection(
                level_db=float(detectability.level_db[k, columns].max()),
                aperture_rad=float(aperture_rad[k]),
                nearest_m=float(detectability.range_m[k, columns].min()),
                ellipse95_semi_major_m=ellipse95(covariance_m2[:2, :2]).semi_major_m,
                height_std_m=float(np.sqrt(covariance_m2[2, 2])),
            )
        needs = float(required.aperture_rad[k]), float(required.crossing_rad[k]), int(required.n_cells[k])
        sites.append(PlannedSite(name, position_m, *needs, detection))
    return Plan(
        scenario=scenario,
        site_map=site_map,
        amplitude_v=amplitude_v,
        stops_m=site_map.centres_m[tour.stops],
        path_m=site_map.centres_m[tour.cells],
        length_m=tour.length_m,
        driving_s=driving_time(tour.length_m, tour.stops.size, top_speed_mps),
        sites=tuple(sites),
        detectability=detectability,
    )


def _find_tour(
    scenario: Scenario, site_map: SiteMap, detectability: Detectability, progress: Callable[[str, float], None]
) -> tuple[Tour, Coverage]:
    """Return the tour, and the coverage that it must offer."""
    clearance_m = site_map.clearance_m[detectability.cells]
    required_rad = np.minimum(apertures(detectability), scenario.locating.rules().planned_aperture_rad)
    columns = cover(detectability, candidates(detectability, clearance_m, required_rad), required_rad)
    chosen = detectability.cells[columns].tolist()
    paths, dock = CellPaths(site_map), site_map.cell(scenario.route.dock_m)
    longer = shortest_tour_of(paths, dock, chosen)
    required = required_coverage(detectability, detectability.columns(np.unique(longer.cells)), required_rad)
    every_fourth = np.floor(detectability.places_m / CELL_M).astype(np.intp) % 4 == 2  # 1 m apart (assumed)
    is_stop = every_fourth.all(axis=1) & (clearance_m >= COMFORT_M)

    def report(n_left: int) -> None:
        progress(f"tour of {n_left} stops", 0.9 - 0.6 * n_left / max(len(chosen), 1))

    return TourShortener(detectability, paths, dock, required, is_stop, report).shorten(longer), required


def with_planned_route(scenario: Scenario) -> Scenario:
    """Return the scenario with a planned route if it has `waypoints_m = "planned"`, else unchanged.

    The environment cannot plan, because the map belongs to missions: whoever starts a mission calls this.

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
    """Return the waypoints for a scenario given as JSON: missions with different seeds share a plan."""
    plan = make_plan(restore_scenario(json.loads(scenario)))
    return tuple((float(x), float(y)) for x, y in plan.stops_m)
