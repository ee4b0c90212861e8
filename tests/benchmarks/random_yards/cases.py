"""Missions in random yards: planned routes, several sources, and sources with little or no line of sight."""

from __future__ import annotations

import itertools

import numpy as np

from dirmusic.arrays import FloatArray, IntArray
from pdpatrol.envs import Scenario
from pdpatrol.envs.random_yard import random_source, random_yard
from pdpatrol.envs.scenario.sources import SourceConfig
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.records import Report
from pdpatrol.missions.runner import Mission
from pdpatrol.robot_models.yard.yard import Yard
from tests.envs.helpers import to_be_planned

TIME_LIMIT_S = 420.0
"""Time for the tour and the candidates."""

APART_M = 2.0
"""Smallest horizontal distance between sources of one yard, as the cut-off of OSPA."""

NEAR_M = 10.0
"""Distance within which the route passes the hidden source."""

NARROW_SHARE = 0.2
NARROW_M = 8.0
"""A source is narrow if less than this share of the reachable ground within this distance has line of sight."""

DETECTED_PULSES = 30
"""Number of pulses above which a source counts as detected on a route."""

BUSHING_M = 3.0
"""Height above which a source counts as a source on a bushing."""


def run_case(scenario: Scenario, policy: str, seed: int) -> Report:
    """Run a mission and return its report."""
    return make_report(Mission(scenario, policy, seed).run(), 0.0)


def is_all_found(report: Report) -> bool:
    """Return True if each source has a confirmed finding within a metre."""
    return all(source.match is not None and source.match.error_m < 1.0 for source in report.scores.sources)


def planned(seed: int) -> Scenario:
    """Return a yard with 0 to 12 pieces of equipment, one source and a planned route."""
    return _with_time(to_be_planned(random_yard(seed, seed % 13)))


def several(seed: int) -> Scenario:
    """Return a yard with 5 to 12 pieces of equipment, one to three sources and a planned route."""
    scenario, rng = to_be_planned(random_yard(seed, 5 + seed % 8)), np.random.default_rng([seed, 5])
    sources = [*scenario.sources]
    while len(sources) < 1 + seed % 3:
        another = random_source(scenario.yard, rng)
        apart_m = [_place(scenario.yard, another)[:2] - _place(scenario.yard, other)[:2] for other in sources]
        if min(np.linalg.norm(apart_m, axis=-1)) >= APART_M:
            sources.append(another)
    named = tuple(
        source.model_copy(update={"name": f"discharge_{number + 1}"}) for number, source in enumerate(sources)
    )
    return _with_time(scenario.model_copy(update={"sources": named}))


def narrow(seed: int) -> Scenario | None:
    """Return a yard with 5 to 12 pieces, a planned route and a narrow source; None if the seed gives no such yard."""
    scenario, rng = to_be_planned(random_yard(seed, 5 + seed % 8)), np.random.default_rng([seed, 8])
    site_map = SiteMap(scenario)
    is_reachable = np.isfinite(site_map.reach(scenario.route.dock_m).length_m)
    for _ in range(30):
        source = random_source(scenario.yard, rng)
        source_m = _place(scenario.yard, source)
        is_near = np.linalg.norm(site_map.centres_m - source_m[:2], axis=-1) < NARROW_M
        is_in_sight = site_map.in_sight(site_map.centres_m[is_near & is_reachable], source_m, 0.3)
        if is_in_sight.any() and is_in_sight.mean() < NARROW_SHARE:
            return _with_time(scenario.model_copy(update={"sources": (source,)}))
    return None


def hidden(seed: int) -> Scenario | None:
    """Return a yard with 5 to 12 pieces whose route has no line of sight to its source; None if the seed gives none."""
    scenario, rng = random_yard(seed, 5 + seed % 8), np.random.default_rng([seed, 77])
    site_map, source_m = SiteMap(scenario), _place(scenario.yard, scenario.sources[0])
    is_in_sight = site_map.in_sight(site_map.centres_m, source_m, 0.3)
    for _ in range(30):
        stops_m = [tuple(scenario.yard.free_place(rng, 1.0).tolist()) for _ in range(2)]
        cells = _cells_of([scenario.route.dock_m, *stops_m, scenario.route.dock_m], site_map)
        if cells is None or is_in_sight[cells].any():
            continue
        if np.linalg.norm(site_map.centres_m[cells] - source_m[:2], axis=-1).min() < NEAR_M:
            route = scenario.route.model_copy(update={"waypoints_m": tuple(stops_m)})
            return _with_time(scenario.model_copy(update={"route": route}))
    return None


def _cells_of(stops_m: list[tuple[float, float]], site_map: SiteMap) -> IntArray | None:
    """Return the cells of the shortest paths from stop to stop; None if a path is missing."""
    cells = list[IntArray]()
    for start_m, end_m in itertools.pairwise(stops_m):
        paths, end = site_map.reach(start_m), site_map.cell(end_m)
        if not np.isfinite(paths.length_m[end]):
            return None
        cells.append(paths.cells(end))
    return np.concatenate(cells)


def _place(yard: Yard, source: SourceConfig) -> FloatArray:
    return yard.site_position(source.sites[0]) if source.sites else np.asarray(source.position_m)


def _with_time(scenario: Scenario) -> Scenario:
    return scenario.model_copy(update={"task": scenario.task.model_copy(update={"time_limit_s": TIME_LIMIT_S})})
