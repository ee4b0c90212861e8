"""Random yards: valid, buildable, different, and the same for the same seed."""

import numpy as np
import pytest

from envs.patrol import PatrolEnv
from envs.random_yard import N_WAYPOINTS, ROOM_M, random_yard
from envs.scenario import ROBOT_CLEARANCE_M


def check(seed: int) -> None:
    n = seed % 8
    scenario = random_yard(seed, n)
    yard = scenario.yard
    assert len(yard.equipment) <= n
    env = PatrolEnv(scenario)
    _, info = env.reset(seed=seed)
    assert env.observation_space.contains(env.step(np.array([0.5, 0.1], dtype=np.float32))[0])
    assert len(scenario.route.waypoints_m) == N_WAYPOINTS
    for stop in (scenario.route.dock_m, *scenario.route.waypoints_m):
        assert yard.clearance(np.array(stop)) >= ROBOT_CLEARANCE_M
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
