"""Plans hear all that can be heard, with no stop too many, from the map alone."""

import json
from functools import partial

import numpy as np
import pytest
import scipy.optimize
from numpy.typing import NDArray

from dirmusic.angles import aperture
from pdpatrol.envs import Scenario, load_scenario
from pdpatrol.envs.random_yard import random_yard
from pdpatrol.envs.scenario.map import MapConfig
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.planning.hearing import hear
from pdpatrol.missions.planning.plan import Plan, make_plan
from pdpatrol.missions.planning.tables import as_json
from pdpatrol.missions.planning.tour import shortest_tour_of
from pdpatrol.missions.planning.ways import Ways
from pdpatrol.robot_models.yard.yard import Yard
from tests.missions.planning.one_plan import YARDS, FloatArray, plan_of, scenario_of, walled_in

NEEDED_RAD, WITHIN_M = np.radians(60.0), 8.0


def views_of(plan: Plan, site_m: FloatArray, from_m: FloatArray) -> FloatArray:
    """Places (n, 2) among those given from which a site is in sight and near enough."""
    near_m = from_m[np.linalg.norm(from_m - site_m[:2], axis=-1) <= WITHIN_M]
    return near_m[plan.site_map.in_sight(near_m, site_m, 0.0)] if near_m.size else near_m


def aperture_of(views_m: FloatArray, site_m: FloatArray) -> float:
    away_m = views_m - site_m[:2]
    return aperture(np.arctan2(away_m[:, 1], away_m[:, 0]))


def check(plan: Plan) -> None:
    """Every site that a reachable place hears is heard along the tour, and no stop can be left out."""
    hearing, site_map = plan.hearing, plan.site_map
    for site in plan.sites:
        site_m = site_map.yard.site_position(site.name)
        everywhere = views_of(plan, site_m, site_map.centres_m[hearing.cells])
        assert (site.heard is None) == (everywhere.size == 0), site.name
        if site.heard is not None:
            widest_rad = min(NEEDED_RAD, aperture_of(everywhere, site_m))
            assert aperture_of(views_of(plan, site_m, plan.way_m), site_m) >= widest_rad - 1e-6, site.name
    ways, dock = Ways(site_map), site_map.cell(plan.scenario.route.dock_m)
    stops = [site_map.cell(stop_m) for stop_m in plan.stops_m]
    for k in range(len(stops)):
        rest = shortest_tour_of(ways, dock, stops[:k] + stops[k + 1 :])
        assert not shows_enough(plan, np.unique(rest.cells)), f"stop {k + 1} is needless"
    assert shows_enough(plan, np.unique(shortest_tour_of(ways, dock, stops).cells))


def shows_enough(plan: Plan, cells: NDArray[np.intp]) -> bool:
    """Whether some cells show each site as the plan says that it is to be shown."""
    columns = plan.hearing.columns(cells)
    for k, site in enumerate(plan.sites):
        aspect_rad = plan.hearing.aspect_rad[k, columns[plan.hearing.is_heard[k, columns]]]
        lines = np.sort(np.mod(aspect_rad, np.pi))
        widest = np.diff(lines, append=lines[:1] + np.pi).max(initial=0.0)
        crossing_rad = min(np.pi - widest, np.pi / 2) if lines.size else 0.0
        if aperture(aspect_rad) < site.needed_rad - 1e-6 or crossing_rad < site.crossing_rad - 1e-6:
            return False
        if aspect_rad.size < max(site.n_cells, site.heard is not None):
            return False
    return True


@pytest.mark.parametrize("name", YARDS)
def test_each_site_that_any_place_hears_is_heard_from_the_tour_and_no_stop_can_be_left_out(name: str) -> None:
    check(plan_of(name))


@pytest.mark.slow
@pytest.mark.parametrize("first", range(6000, 6040, 10))
def test_forty_more_yards_are_heard_with_no_stop_too_many(first: int) -> None:
    for seed in range(first, first + 10):
        check(make_plan(random_yard(seed, 1 + seed % 12)))


def test_blind_sites_are_those_that_no_place_within_reach_has_in_sight() -> None:
    plan = make_plan(walled_in())
    assert plan.blind == ("hidden/door",)
    reachable_m = plan.site_map.centres_m[plan.hearing.cells]
    door_m = plan.site_map.yard.site_position("hidden/door")
    assert not plan.site_map.in_sight(reachable_m, door_m, 0.0).any()
    inside_m = plan.site_map.centres_m[plan.site_map.is_free]  # within the walls it would be heard
    assert plan.site_map.in_sight(inside_m, door_m, 0.0).any()
    check(plan)


def test_the_level_is_that_of_the_receiver_in_the_worst_heading() -> None:
    from pdpatrol.sensing import HelicalArray
    from pdpatrol.sensing.receiver.receiver import Receiver

    plan = plan_of("one_source")
    scenario, hearing = plan.scenario, plan.hearing
    array, receiver = HelicalArray.nominal(scenario.array), Receiver(scenario.receiver, 6)
    for k in range(len(plan.sites)):
        column = int(np.where(hearing.is_heard[k], hearing.range_m[k], 0.0).argmax())
        target_m, place_m = hearing.targets[k].position_m, np.append(hearing.places_m[column], scenario.array.height_m)
        share = plan.site_map.sight(place_m[np.newaxis], target_m).item()
        peaks_v = []
        for yaw in np.radians(np.arange(0.0, 60.0, 0.5)):  # the ring repeats itself every 60 degrees
            cos, sin = np.cos(yaw), np.sin(yaw)
            elements_m = array.positions_m @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
            away_m = target_m - np.append(place_m[:2], 0.0) - elements_m
            level_m = np.hypot(away_m[:, 0], away_m[:, 1])
            gain = array.gain(np.arctan2(away_m[:, 1], away_m[:, 0]) - yaw, np.arctan2(away_m[:, 2], level_m))
            peaks_v.append((plan.amplitude_v * share * gain / np.linalg.norm(away_m, axis=-1)).max())
        over = min(peaks_v) * receiver.front_end.pulse_peak / receiver.threshold_v
        assert hearing.level_db[k, column] == pytest.approx(20 * np.log10(over), abs=0.4)  # elements are 12 cm off


def test_a_quieter_discharge_is_heard_from_fewer_places_and_a_faint_one_from_none() -> None:
    scenario = load_scenario("one_source")
    hear_at = partial(hear, scenario, SiteMap(scenario))
    loud, quiet, faint = (hear_at(volts).is_heard for volts in (0.05, 0.02, 1e-4))
    assert (quiet <= loud).all()
    assert 0 < quiet.sum() < loud.sum()
    assert not faint.any()
    plan = make_plan(scenario, 1e-4)
    assert len(plan.stops_m) == 0
    assert plan.length_m == plan.driving_s == 0.0
    assert len(plan.blind) == len(plan.sites)


def test_the_same_plan_comes_twice_to_the_bit() -> None:
    again = make_plan(scenario_of("5004"))
    assert json.dumps(as_json(again)) == json.dumps(as_json(plan_of("5004")))


def test_neither_sources_nor_the_true_yard_nor_the_given_route_count() -> None:
    shown = scenario_of("5004")
    piece = shown.yard.equipment[-1]
    true = Yard(size_m=shown.yard.size_m, equipment=shown.yard.equipment[:-1])
    other = shown.model_copy(
        update={
            "yard": true,
            "map": MapConfig(extra=(piece,)),
            "sources": (),
            "route": shown.route.model_copy(update={"waypoints_m": "planned"}),
        }
    )
    assert as_json(make_plan(other)) == as_json(plan_of("5004"))


def test_a_map_without_sites_is_patrolled_all_over() -> None:
    plan = make_plan(random_yard(0, 0))
    assert not plan.blind
    away_m = np.linalg.norm(plan.site_map.centres_m[:, np.newaxis] - plan.way_m, axis=-1).min(axis=1)
    assert away_m.max() < 1.5 * WITHIN_M


@pytest.mark.slow
def test_the_largest_shipped_yard_takes_few_searches_of_few_nodes(monkeypatch: pytest.MonkeyPatch) -> None:
    n_nodes: list[int] = []
    solve = scipy.optimize.milp

    def counted(*args: object, **options: object) -> object:
        found = solve(*args, **options)  # pyright: ignore
        n_nodes.append(int(found.mip_node_count or 0))
        return found

    monkeypatch.setattr(scipy.optimize, "milp", counted)
    plan = make_plan(largest())
    assert not plan.blind
    assert len(n_nodes) < 500
    assert sum(n_nodes) < 1500
    check(plan)


def largest() -> Scenario:
    return load_scenario("switchyard")
