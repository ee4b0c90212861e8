"""Random yards are valid and determined by their seed, and their sources are in sight of free ground."""

from pathlib import Path

import numpy as np
import pytest

from dirmusic.angles import aperture
from pdpatrol.envs import load_scenario
from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.envs.random_yard import (
    AIR_M,
    DOCK_M,
    GAP_M,
    N_WAYPOINTS,
    OFF_SITE_M,
    SEEN_FROM_M,
    place_off_sites,
    random_source,
    random_yard,
)
from pdpatrol.envs.scenario.radio import surroundings_of
from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing.radio.transmission import Sight
from tests.envs.helpers import drive


def check(seed: int) -> None:
    n = seed % 8
    scenario = random_yard(seed, n)
    yard = scenario.yard
    assert len(yard.equipment) <= n
    env = PatrolEnv(scenario, full_info=True)
    _, info = env.reset(seed=seed)
    assert env.observation_space.contains(env.step(drive(0.5, 0.1))[0])
    assert len(scenario.route.waypoints_m) == N_WAYPOINTS
    for stop in (scenario.route.dock_m, *scenario.route.waypoints_m):
        assert yard.clearance(np.array(stop)) >= scenario.robot.description.room_m
    assert yard.contains(info["truth"]["sources"][0]["position_m"])
    for number, item in enumerate(yard.equipment):
        others = yard.solids.take(yard.owner != number)
        assert others.horizontal_distance(item.solids.centre_m).min(initial=np.inf) > GAP_M


@pytest.mark.parametrize("seeds", [range(16), pytest.param(range(100, 600), marks=pytest.mark.slow)], ids=str)
def test_random_yards_are_valid(seeds: range) -> None:
    for seed in seeds:
        check(seed)


def test_seed_determines_the_yard() -> None:
    assert random_yard(3) == random_yard(3)
    assert random_yard(3) != random_yard(4)
    assert len({tuple(item.kind for item in random_yard(seed).yard.equipment) for seed in range(10)}) > 8


@pytest.mark.parametrize("n", [-1, 13])
def test_number_of_obstructions_is_checked(n: int) -> None:
    with pytest.raises(ValueError, match=r"`n_obstructions` must be in \[0, 12\]"):
        random_yard(0, n)


def test_open_yard_ends_by_approach_or_time_alone() -> None:
    scenario = load_scenario(Path(__file__).parents[2] / "examples" / "learning" / "open_yard.toml")
    env = PatrolEnv(scenario, full_info=True)
    starts = [env.reset(seed=seed)[1] for seed in range(40)]
    places_m = np.array([start["truth"]["sources"][0]["position_m"] for start in starts])
    assert (places_m[:, :2].min(axis=0) < 4.0).all()
    assert (places_m[:, :2].max(axis=0) > np.array(scenario.yard.size_m) - 4.0).all()
    assert np.ptp([start["true_pose"][2] for start in starts]) > 5.0
    stops_m = np.array([DOCK_M, *scenario.route.waypoints_m, DOCK_M])
    round_m = np.hypot(*np.diff(stops_m, axis=0).T).sum() - 2 * scenario.task.waypoint_radius_m * (len(stops_m) - 1)
    assert round_m > scenario.robot.description.max_speed_mps * scenario.task.time_limit_s


YARDS = [random_yard(seed, 1 + seed % 12).yard for seed in range(0, 12, 2)]


def test_a_fifth_of_the_sources_is_off_the_sites() -> None:
    rng = np.random.default_rng(0)
    sources = [random_source(YARDS[k % len(YARDS)], rng) for k in range(600)]
    n_off = sum(source.position_m is not None for source in sources)
    assert 90 <= n_off <= 150  # 120 are expected; the band is three standard deviations wide on each side
    for k, source in enumerate(sources):
        assert set(source.sites) <= set(YARDS[k % len(YARDS)].site_names())


@pytest.mark.parametrize("k", range(len(YARDS)))
def test_source_off_the_sites_is_near_equipment_and_in_sight(k: int) -> None:
    yard, rng = YARDS[k], np.random.default_rng(k)
    sites_m = np.array([yard.site_position(name) for name in yard.site_names()])
    for _ in range(4):
        place_m = place_off_sites(yard, rng)
        assert place_m is not None
        assert np.linalg.norm(sites_m - place_m, axis=-1).min() > OFF_SITE_M - 0.001
        assert 0.0 < yard.solids.distance(place_m).min() < AIR_M[1] + 0.02
        assert yard.contains(place_m)
        ground_m = np.random.default_rng(0).uniform([0.0, 0.0], yard.size_m, (4000, 2))
        range_m = np.linalg.norm(ground_m - place_m[:2], axis=-1)
        ground_m = ground_m[(range_m > SEEN_FROM_M[0]) & (range_m < SEEN_FROM_M[1]) & (yard.clearance(ground_m) > 0.5)]
        share = Sight(surroundings_of(yard))(np.column_stack([ground_m, np.full(len(ground_m), 0.6)]), place_m)
        seen_m = ground_m[share > 10 ** (-12 / 20)] - place_m[:2]
        assert aperture(np.arctan2(seen_m[:, 1], seen_m[:, 0])) > np.radians(50.0)


def test_source_of_an_empty_yard_is_on_open_ground() -> None:
    assert random_source(Yard(size_m=(20.0, 20.0)), np.random.default_rng(5)).position_m is not None
