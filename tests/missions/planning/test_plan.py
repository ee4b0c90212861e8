"""Plans detect every detectable site, without needless stops, from the map alone."""

from functools import partial

import numpy as np
import pytest

from dirmusic.angles import aperture
from dirmusic.arrays import FloatArray, IntArray
from pdpatrol.envs import load_scenario
from pdpatrol.envs.random_yard import random_yard
from pdpatrol.envs.scenario import ScenarioError
from pdpatrol.envs.scenario.map import MapConfig
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.planning.cover import coverage
from pdpatrol.missions.planning.detectability import Detectability, compute_detectability
from pdpatrol.missions.planning.output import as_json
from pdpatrol.missions.planning.plan import Plan, make_plan
from pdpatrol.missions.planning.tour import MIN_GAIN_M, ShortestTours
from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing import HelicalArray, level_transform
from pdpatrol.sensing.receiver.receiver import Receiver
from tests.missions.planning.big_yard import big_yard
from tests.missions.planning.one_plan import YARDS, plan_of, scenario_of, walled_in

NEEDED_RAD, WITHIN_M = np.radians(60.0), 8.0


def aperture_of(plan: Plan, site_m: FloatArray, from_m: FloatArray) -> float | None:
    """Return the aperture of the places (n, 2) from which a site is in sight and near enough, or None."""
    away_m = from_m - site_m[:2]
    sees = (np.linalg.norm(away_m, axis=-1) <= WITHIN_M) & plan.site_map.in_sight(from_m, site_m, 0.0)
    return aperture(np.arctan2(away_m[sees, 1], away_m[sees, 0])) if sees.any() else None


def check(plan: Plan) -> None:
    """Check that the tour detects every site that a reachable place detects, and that no stop can be removed."""
    where, site_map = plan.detectability, plan.site_map
    for name, detection in zip(where.names, plan.detections(), strict=True):
        site_m = site_map.yard.site_position(name)
        widest_rad, offered_rad = (aperture_of(plan, site_m, places_m) for places_m in (where.places_m, plan.path_m))
        assert (detection is None) == (widest_rad is None), name
        if widest_rad is not None:
            assert offered_rad is not None, name
            assert offered_rad >= min(NEEDED_RAD, widest_rad) - 1e-6, name
    tours, stops = ShortestTours(site_map), plan.tour.stops.tolist()
    for k in range(len(stops)):
        rest = tours.in_order(stops[:k] + stops[k + 1 :])
        assert not covers_enough(plan, np.unique(rest.cells)), f"stop {k + 1} is needless"
    ordered = tours.in_order(tours.shortest(stops))
    is_shortest = plan.tour.length_m <= ordered.length_m + MIN_GAIN_M
    assert is_shortest or not covers_enough(plan, ordered.cells), "the stops have a better order"
    assert covers_enough(plan, plan.tour.cells)
    assert plan.bound_m <= plan.tour.length_m + 1e-6


def covers_enough(plan: Plan, cells: IntArray) -> bool:
    """Return True if the given cells cover each site as the plan requires."""
    where = plan.detectability
    return bool((coverage(where, cells) >= plan.required - 1e-6).all())


def pairs_of(where: Detectability) -> set[tuple[int, int]]:
    """Return the pairs of targets and columns that detect them."""
    return set(
        zip(np.repeat(np.arange(len(where.names)), np.diff(where.first)).tolist(), where.column.tolist(), strict=True)
    )


@pytest.mark.whole
@pytest.mark.parametrize("name", YARDS)
def test_tour_detects_every_detectable_site(name: str) -> None:
    check(plan_of(name))


@pytest.mark.slow
@pytest.mark.parametrize("first", range(6000, 6040, 10))
def test_tour_detects_every_site_of_forty_yards(first: int) -> None:
    for seed in range(first, first + 10):
        check(make_plan(random_yard(seed, 1 + seed % 12)))


def test_blind_sites_are_out_of_sight_of_all_reachable_cells() -> None:
    plan = make_plan(walled_in())
    assert plan.blind == ("hidden/door",)
    reachable_m = plan.site_map.centres_m[plan.detectability.cells]
    door_m = plan.site_map.yard.site_position("hidden/door")
    assert not plan.site_map.in_sight(reachable_m, door_m, 0.0).any()
    inside_m = plan.site_map.centres_m[plan.site_map.is_free]  # within the walls
    assert plan.site_map.in_sight(inside_m, door_m, 0.0).any()
    check(plan)


def test_level_is_that_of_the_worst_heading() -> None:
    plan = plan_of("one_source")
    scenario, detectability = plan.scenario, plan.detectability
    array, receiver = HelicalArray.nominal(scenario.array), Receiver(scenario.receiver, 6)
    for k, target_m in enumerate(detectability.positions_m):
        pair = detectability.pairs(k).start + int(detectability.range_m[detectability.pairs(k)].argmax())
        place_m = np.append(detectability.places_m[detectability.column[pair]], scenario.array.height_m)
        share = plan.site_map.sight(place_m[np.newaxis], target_m).item()
        peaks_v = []
        for yaw in np.radians(np.arange(0.0, 60.0, 0.5)):  # the ring repeats itself every 60 degrees
            at = level_transform(np.array([*place_m[:2], yaw]))
            peaks_v.append(plan.amplitude_v * share * array.free_space_response(target_m, at)[0].max())
        over = min(peaks_v) * receiver.front_end.pulse_peak / receiver.threshold_v
        assert detectability.level_db[pair] == pytest.approx(20 * np.log10(over), abs=0.4)


def test_weaker_discharges_are_detectable_from_fewer_cells() -> None:
    scenario = load_scenario("one_source")
    at = partial(compute_detectability, scenario, SiteMap(scenario))
    strong, weak, faint = (pairs_of(at(volts)) for volts in (0.05, 0.02, 1e-4))
    assert weak < strong
    assert weak
    assert not faint
    plan = make_plan(scenario, 1e-4)
    assert len(plan.stops_m) == 0
    assert plan.tour.length_m == plan.driving_s == 0.0
    assert plan.blind == plan.detectability.names


@pytest.mark.whole
def test_plan_ignores_sources_true_yard_and_route() -> None:
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


@pytest.mark.whole
def test_map_without_sites_is_patrolled_everywhere() -> None:
    plan = make_plan(random_yard(0, 0))
    assert not plan.blind
    away_m = np.linalg.norm(plan.site_map.centres_m[:, np.newaxis] - plan.path_m, axis=-1).min(axis=1)
    assert away_m.max() < 1.5 * WITHIN_M


@pytest.mark.slow
def test_large_yard_is_covered_by_a_tour_with_a_tight_bound() -> None:
    """The shortest tour past the stops of the plan, which may cover less, is at most 3 % longer than the bound."""
    plan = make_plan(big_yard(120.0, 60))
    check(plan)
    assert len(plan.blind) <= 0.1 * len(plan.detectability.names)
    tours, rng = ShortestTours(plan.site_map), np.random.default_rng(0)
    drawn_m = tours.length_m(tours.shortest(rng.permutation(plan.tour.stops).tolist()))
    assert plan.bound_m <= drawn_m + 1e-6
    assert drawn_m <= 1.03 * plan.bound_m
    assert plan.tour.length_m <= 1.25 * plan.bound_m


def test_yard_of_the_largest_size_can_be_described() -> None:
    yard = big_yard(400.0, 1000).yard
    assert len(yard.equipment) == 1000
    assert len(yard.site_names()) >= 1500
    with pytest.raises(ScenarioError, match="400"):
        big_yard(401.0, 10)
