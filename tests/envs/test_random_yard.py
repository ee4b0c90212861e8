"""Random yards: valid, buildable, different, and the same for the same seed."""

import numpy as np
import pytest

from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.envs.random_yard import DOCK_M, N_WAYPOINTS, ROOM_M, open_yard, random_yard


def check(seed: int) -> None:
    n = seed % 8
    scenario = random_yard(seed, n)
    yard = scenario.yard
    assert len(yard.equipment) <= n
    env = PatrolEnv(scenario, full_info=True)
    _, info = env.reset(seed=seed)
    assert env.observation_space.contains(env.step(np.array([0.5, 0.1], dtype=np.float32))[0])
    assert len(scenario.route.waypoints_m) == N_WAYPOINTS
    for stop in (scenario.route.dock_m, *scenario.route.waypoints_m):
        assert yard.clearance(np.array(stop)) >= scenario.robot.description.room_m
    assert yard.contains(info["truth"]["sources"][0]["position_m"])
    for number, item in enumerate(yard.equipment):
        others = yard.solids.take(yard.owner != number)
        assert others.horizontal_distance(item.solids.centre_m).min(initial=np.inf) > ROOM_M


@pytest.mark.parametrize("first", [0, 20])
def test_forty_seeds_make_yards_with_room_between_their_equipment(first: int) -> None:
    for seed in range(first, first + 20):
        check(seed)


@pytest.mark.slow
def test_five_hundred_seeds_make_yards_with_room_between_their_equipment() -> None:
    for seed in range(100, 600):
        check(seed)


def test_the_same_seed_gives_the_same_yard_and_another_another() -> None:
    assert random_yard(3) == random_yard(3)
    assert random_yard(3) != random_yard(4)
    assert len({tuple(item.kind for item in random_yard(seed).yard.equipment) for seed in range(10)}) > 8


@pytest.mark.parametrize("n", [-1, 13])
def test_more_obstructions_than_fit_or_fewer_than_none_are_refused(n: int) -> None:
    with pytest.raises(ValueError, match=r"`n_obstructions` must be in \[0, 12\]"):
        random_yard(0, n)


def test_an_open_yard_has_its_source_anywhere_and_ends_by_approach_or_by_time_alone() -> None:
    scenario = open_yard()
    env = PatrolEnv(scenario, full_info=True)
    starts = [env.reset(seed=seed)[1] for seed in range(40)]
    places_m = np.array([start["truth"]["sources"][0]["position_m"] for start in starts])
    assert (places_m[:, :2].min(axis=0) < 4.0).all()
    assert (places_m[:, :2].max(axis=0) > np.array(scenario.yard.size_m) - 4.0).all()
    assert np.ptp([start["true_pose"][2] for start in starts]) > 5.0
    stops_m = np.array([DOCK_M, *scenario.route.waypoints_m, DOCK_M])
    round_m = np.hypot(*np.diff(stops_m, axis=0).T).sum() - 2 * scenario.task.waypoint_radius_m * (len(stops_m) - 1)
    assert round_m > scenario.robot.description.max_speed_mps * scenario.task.time_limit_s
