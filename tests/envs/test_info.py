"""`info` has fixed shapes; entries without a fixed shape are present only with `full_info`."""

import re
from typing import Any

import numpy as np
import pytest

from pdpatrol.envs import Scenario, load_scenario
from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.envs.vector_env import PatrolVectorEnv
from tests.envs.helpers import STAND, drive

AHEAD = drive(1.0, 0.2)


def near(name: str, standoff_m: float, time_limit_s: float = 60.0) -> Scenario:
    return load_scenario(name, {"task.standoff_m": standoff_m, "task.time_limit_s": time_limit_s})


def table() -> dict[str, str]:
    """Return keys and shapes from the table of the docstring."""
    _, _, below = (PatrolEnv.__doc__ or "").partition("## Info")
    return dict(re.findall(r"^ +\| (\w+) \| (\(.*?\)) \|", below, flags=re.MULTILINE))


@pytest.mark.parametrize("name", ["one_source", "two_sources", "quiet_yard"])
def test_info_matches_the_docstring_table(name: str) -> None:
    env, scenario = PatrolEnv(name), load_scenario(name)
    sizes = {"n_sources": len(scenario.sources), "n_waypoints": len(scenario.route.stops_m)}
    expected = {key: eval(shape, {}, sizes) for key, shape in table().items()}
    observation, info = env.reset(seed=0)
    for each in (info, env.step(AHEAD)[-1], env.step(AHEAD)[-1]):
        assert all(isinstance(value, (bool, float, np.ndarray)) for value in each.values())
        assert {key: np.shape(value) for key, value in each.items()} == expected
        assert each["is_success"] == each["success"]
    assert not set(expected) & set(observation)


def test_success_is_to_have_approached_every_source() -> None:
    scenario = near("two_sources", 1.0)
    first, second = (source.name for source in scenario.sources)
    env = PatrolEnv(scenario, terminate_on_approach=False)
    x, y = scenario.route.dock_m
    places = {second: (x + 2.0, y, 3.0), first: (x + 4.0, y, 3.0)}
    _, info = env.reset(seed=0, options={"start_pose": (x, y, 0.0), "sources": places})
    seen = [tuple(info["approached"].tolist())]
    for _ in range(120):
        *_, terminated, _, info = env.step(drive(0.6, 0.0))
        assert info["success"] == info["approached"].all()
        assert not terminated
        if seen[-1] != tuple(info["approached"].tolist()):
            seen.append(tuple(info["approached"].tolist()))
    assert seen == [(False, False), (False, True), (True, True)]


def test_finished_route_without_sources_is_not_a_success() -> None:
    dock_m = load_scenario("quiet_yard").route.dock_m
    env = PatrolEnv(load_scenario("quiet_yard", {"route.waypoints_m": [dock_m]}))
    _, info = env.reset(seed=0)
    *_, terminated, _, info = env.step(STAND)
    assert terminated
    assert info["waypoints_visited"].all()
    assert not info["success"]
    assert info["approached"].shape == (0,)


def test_full_info_adds_entries_without_fixed_shape() -> None:
    env, many = PatrolEnv("bench", full_info=True), PatrolVectorEnv(2, "bench", full_info=True)
    start, begun = env.reset(seed=1)[1], many.reset(seed=1)[1]
    info, rows = env.step(STAND)[-1], many.step(np.tile(STAND, (2, 1)))[-1]
    assert set(info) - set(table()) == {"pulses", "suspects", "touched_names"}
    assert set(start) - set(info) == {"truth"}
    for keys in (set(rows), set(begun)):
        assert keys - set(table()) - {f"_{key}" for key in table()} == {"pulses"}
    np.testing.assert_array_equal(
        rows["pulses"]["strengths_v"][rows["pulses"]["robot"] == 0], info["pulses"].strengths_v
    )


def test_same_step_keeps_pulses_of_continuing_rows() -> None:
    scenario = near("bench", 2.5, 1.0)
    many = PatrolVectorEnv(3, scenario, full_info=True, autoreset_mode="SameStep", num_threads=1)
    alone = PatrolVectorEnv(3, scenario, full_info=True, autoreset_mode="Disabled", num_threads=1)
    stand = np.tile(STAND, (3, 1))
    for envs in (many, alone):
        envs.reset(seed=2)
        envs.step(stand)
        envs.reset(options={"reset_mask": np.array([True, False, True])})
    mixed, going = dict[str, Any](), dict[str, Any]()
    for _ in range(9):
        mixed, going = (envs.step(stand)[-1]["pulses"] for envs in (many, alone))
    assert (np.diff(mixed["robot"]) >= 0).all()
    assert set(mixed["robot"].tolist()) >= {0, 2}
    for column, values in going.items():
        np.testing.assert_array_equal(mixed[column][mixed["robot"] != 1], values[going["robot"] != 1])
