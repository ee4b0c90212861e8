"""The plan of a yard: what can be heard, the tour that hears it, and how well."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdpatrol.envs import Scenario
from pdpatrol.missions.driving.site_map import CELL_M, COMFORT_M, SiteMap
from pdpatrol.missions.planning.cover import apertures, candidates, cover
from pdpatrol.missions.planning.expected import Deviation, Forecast, driving_time, views_along
from pdpatrol.missions.planning.hearing import AMPLITUDE_V, Hearing, hear
from pdpatrol.missions.planning.looks import Looks, needed_of
from pdpatrol.missions.planning.tighten import Tightening
from pdpatrol.missions.planning.tour import Tour, shortest_tour_of
from pdpatrol.missions.planning.ways import Ways

FloatArray = NDArray[np.float64]

EVERY = 4
"""Stops are moved to every fourth cell along x and y (assumed): 1 m."""


class HeardSite(NamedTuple):
    """What the tour hears of one site.

    Attributes:
        level_db: Of the straight path over the trigger, the highest along the tour.
        aperture_rad: Over which the places along the tour spread that hear it, seen from the site.
        nearest_m: The nearest of them, on plan.
        expected: What a discharge there would be known to.
    """

    level_db: float
    aperture_rad: float
    nearest_m: float
    expected: Deviation


class PlannedSite(NamedTuple):
    """A site of the map.

    Attributes:
        name: As `equipment/site`; `air/NUMBER` on a map without any.
        position_m: Shape (3,), world frame.
        needed_rad: The aperture that it is to be heard under: that of confirmation, or the widest there is if less.
        crossing_rad: The angle under which lines of sight are to cross, as of `Looks`.
        n_cells: Cells of the way that are to hear it.
        heard: What the tour hears of it; None if no place that the robot can reach hears it.
    """

    name: str
    position_m: FloatArray
    needed_rad: float
    crossing_rad: float
    n_cells: int
    heard: HeardSite | None


class Plan(NamedTuple):
    """The plan of a yard.

    Attributes:
        scenario: What was planned for.
        site_map: Of it.
        amplitude_v: Peak 1 m away of the discharge that is to be heard.
        stops_m: Of the tour, in order, shape (n_stops, 2), world frame.
        way_m: All of the tour, from the dock and back, shape (n, 2); the dock's cell alone where nothing is heard.
        length_m: Of the tour.
        driving_s: What the tour takes, about.
        sites: In the order of the map.
        hearing: Where each is heard from, rows as of `sites`.
    """

    scenario: Scenario
    site_map: SiteMap
    amplitude_v: float
    stops_m: FloatArray
    way_m: FloatArray
    length_m: float
    driving_s: float
    sites: tuple[PlannedSite, ...]
    hearing: Hearing

    @property
    def blind(self) -> tuple[str, ...]:
        """Names of the sites that no reachable place hears."""
        return tuple(site.name for site in self.sites if site.heard is None)


def make_plan(
    scenario: Scenario, amplitude_v: float = AMPLITUDE_V, follow: Callable[[str, float], None] = lambda *_: None
) -> Plan:
    """Plan the patrol of a yard, on the map that the robot has: neither sources nor the true yard count.

    Args:
        scenario: Map, dock, robot, array, receiver, pose sensor and rules of locating. What route it has does not
            matter.
        amplitude_v: Peak of the quietest discharge that is to be heard, in a unit-gain channel 1 m away, > 0.
        follow: Is told what is done next, and what share of all is done.
    """
    follow("audibility", 0.0)
    site_map = SiteMap(scenario)
    hearing = hear(scenario, site_map, amplitude_v)
    follow("cover", 0.1)
    tour, needed = _find_tour(scenario, site_map, hearing, follow)
    follow("expected deviations", 0.9)
    forecast = Forecast(scenario, site_map, amplitude_v)
    top_speed_mps = scenario.robot.description.max_speed_mps
    views = views_along(tour, hearing, top_speed_mps)
    way = hearing.columns(tour.cells)
    wide_rad = apertures(hearing, way)
    sites: list[PlannedSite] = []
    for k, target in enumerate(hearing.targets):
        heard, by_view = way[hearing.is_heard[k, way]], forecast.hears(target.position_m, views)
        if heard.size and not by_view.any():  # between two views
            by_view[np.abs(views.column - heard[0]).argmin()] = True
        of_tour = HeardSite(
            float(hearing.level_db[k, heard].max()),
            float(wide_rad[k]),
            float(hearing.range_m[k, heard].min()),
            forecast.deviation(target.position_m, views, by_view),
        ) if heard.size else None  # fmt: skip
        of_need = float(needed.aperture_rad[k]), float(needed.crossing_rad[k]), int(needed.n_cells[k])
        sites.append(PlannedSite(target.name, target.position_m, *of_need, of_tour))
    return Plan(
        scenario=scenario,
        site_map=site_map,
        amplitude_v=amplitude_v,
        stops_m=site_map.centres_m[tour.stops],
        way_m=site_map.centres_m[tour.cells],
        length_m=tour.length_m,
        driving_s=driving_time(tour.length_m, tour.stops.size, top_speed_mps),
        sites=tuple(sites),
        hearing=hearing,
    )


def _find_tour(
    scenario: Scenario, site_map: SiteMap, hearing: Hearing, follow: Callable[[str, float], None]
) -> tuple[Tour, Looks]:
    """The tour, and what it has to show of each site."""
    clearance_m = site_map.clearance_m[hearing.cells]
    needed_rad = np.minimum(apertures(hearing), scenario.locating.rules().planned_aperture_rad)
    chosen = hearing.cells[cover(hearing, candidates(hearing, clearance_m, needed_rad), needed_rad)].tolist()
    ways, dock = Ways(site_map), site_map.cell(scenario.route.dock_m)
    longer = shortest_tour_of(ways, dock, chosen)
    needed = needed_of(hearing, hearing.columns(np.unique(longer.cells)), needed_rad)
    on_lattice = (np.floor(hearing.places_m / CELL_M).astype(np.intp) % EVERY == EVERY // 2).all(axis=1)
    is_stop = on_lattice & (clearance_m >= COMFORT_M)

    def tell(n_left: int) -> None:
        follow(f"tour of {n_left} stops", 0.9 - 0.6 * n_left / max(len(chosen), 1))

    return Tightening(hearing, ways, dock, needed, is_stop, tell).tighten(longer), needed
