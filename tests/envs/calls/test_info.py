"""`info` has fixed shapes and tells how an episode went; what has no fixed shape is there only for those who ask."""

import re
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.wrappers.vector import DictInfoToList, RecordEpisodeStatistics

from pdpatrol.envs import Scenario, load_scenario
from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.envs.vector_env import PatrolVectorEnv

ID = "pdpatrol:PDPatrol-v0"
STAND = np.zeros(2, dtype=np.float32)
AHEAD = np.array([1.0, 0.2], dtype=np.float32)


def near(scenario: Scenario, standoff_m: float, time_limit_s: float = 60.0) -> Scenario:
    task = scenario.task.model_copy(update={"standoff_m": standoff_m, "time_limit_s": time_limit_s})
    return scenario.model_copy(update={"task": task})


def table() -> dict[str, str]:
    """Keys and shapes of the docstring's table."""
    _, _, below = (PatrolEnv.__doc__ or "").partition("## Info")
    return dict(re.findall(r"^ +\| (\w+) \| (\(.*?\)) \|", below, flags=re.MULTILINE))


@pytest.mark.parametrize("name", ["one_source", "two_sources", "quiet_yard"])
def test_the_table_of_the_docstring_is_what_every_reset_and_step_tells(name: str) -> None:
    env, scenario = PatrolEnv(name), load_scenario(name)
    sizes = {"n_sources": len(scenario.sources), "n_waypoints": len(scenario.route.stops_m)}
    expected = {key: eval(shape, {}, sizes) for key, shape in table().items()}
    observation, info = env.reset(seed=0)
    for told in (info, env.step(AHEAD)[-1], env.step(AHEAD)[-1]):
        assert all(isinstance(value, (bool, float, np.ndarray)) for value in told.values())
        assert {key: np.shape(value) for key, value in told.items()} == expected
        assert told["is_success"] == told["success"]
    assert not set(expected) & set(observation)


def test_rows_of_the_vector_environment_tell_what_single_ones_tell_in_any_mode_of_autoreset() -> None:
    scenario = near(load_scenario("one_source"), 12.0, 2.0)
    for mode in ("SameStep", "NextStep"):
        rows = gymnasium.make_vec(ID, num_envs=3, scenario=scenario, autoreset_mode=mode, num_threads=1)
        singles = gymnasium.make_vec(
            ID, num_envs=3, scenario=scenario, vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode}
        )
        n_apart, n_over = 0, 0
        assert_same_info(rows.reset(seed=4)[1], singles.reset(seed=4)[1])
        for step in range(60):
            driven = np.random.default_rng(step).uniform(-1, 1, (3, 2)).astype(np.float32)
            *_, over, late, info = rows.step(driven)
            assert_same_info(info, singles.step(driven)[-1])
            if step in (7, 31):  # so that the rows end at different times
                mask = np.array([step == 31, step == 7, False])
                infos = [envs.reset(options={"reset_mask": mask})[1] for envs in (rows, singles)]
                assert_same_info(*infos)
            n_over += int((over | late).sum())
            n_apart += int((over | late).any() and not (over | late).all())
        assert min(n_over, n_apart) > 3


def assert_same_info(native: dict[str, Any], sync: dict[str, Any]) -> None:
    """Compare keys, masks, values and dtypes."""
    assert set(native) == set(sync)
    for key, values in native.items():
        if key == "final_info":
            assert_same_info(values, sync[key])
        else:
            assert values.dtype == sync[key].dtype, key
            np.testing.assert_equal(list(values), list(sync[key]), err_msg=key)


def test_success_is_to_have_approached_every_source_however_the_episode_goes_on() -> None:
    scenario = load_scenario("two_sources")
    first, second = (source.name for source in scenario.sources)
    env = PatrolEnv(near(scenario, 1.0), terminate_on_approach=False)
    x, y = scenario.route.dock_m
    places = {second: (x + 2.0, y, 3.0), first: (x + 4.0, y, 3.0)}
    _, info = env.reset(seed=0, options={"start_pose": (x, y, 0.0), "sources": places})
    seen = [tuple(info["approached"].tolist())]
    for _ in range(120):
        *_, terminated, _, info = env.step(np.array([0.6, 0.0], dtype=np.float32))
        assert info["success"] == info["approached"].all()
        assert not terminated
        if seen[-1] != tuple(info["approached"].tolist()):
            seen.append(tuple(info["approached"].tolist()))
    assert seen == [(False, False), (False, True), (True, True)]


def test_a_route_that_is_done_is_no_success_where_nothing_discharges() -> None:
    scenario = load_scenario("quiet_yard")
    here = scenario.route.model_copy(update={"waypoints_m": (scenario.route.dock_m,)})
    env = PatrolEnv(scenario.model_copy(update={"route": here}))
    _, info = env.reset(seed=0)
    *_, terminated, _, info = env.step(STAND)
    assert terminated
    assert info["waypoints_visited"].all()
    assert not info["success"]
    assert info["approached"].shape == (0,)


def test_pulses_and_what_else_has_no_fixed_shape_come_only_when_asked_for() -> None:
    env, many = PatrolEnv("bench", full_info=True), PatrolVectorEnv(2, "bench", full_info=True)
    start, begun = env.reset(seed=1)[1], many.reset(seed=1)[1]
    info, rows = env.step(STAND)[-1], many.step(np.zeros((2, 2), dtype=np.float32))[-1]
    assert set(info) - set(table()) == {"pulses", "suspects", "touched_names"}
    assert set(start) - set(info) == {"truth"}
    for keys in (set(rows), set(begun)):
        assert keys - set(table()) - {f"_{key}" for key in table()} == {"pulses"}
    np.testing.assert_array_equal(
        rows["pulses"]["strengths_v"][rows["pulses"]["robot"] == 0], info["pulses"].strengths_v
    )


def test_with_same_step_the_pulses_of_rows_that_go_on_are_told_beside_those_of_new_episodes() -> None:
    scenario = near(load_scenario("bench"), 2.5, 1.0)
    many = PatrolVectorEnv(3, scenario, full_info=True, autoreset_mode="SameStep", num_threads=1)
    alone = PatrolVectorEnv(3, scenario, full_info=True, autoreset_mode="Disabled", num_threads=1)
    for envs in (many, alone):
        envs.reset(seed=2)
        envs.step(np.zeros((3, 2), dtype=np.float32))
        envs.reset(options={"reset_mask": np.array([True, False, True])})
    told, going = dict[str, Any](), dict[str, Any]()
    for _ in range(9):
        told, going = (
            many.step(np.zeros((3, 2), dtype=np.float32))[-1]["pulses"],
            alone.step(np.zeros((3, 2), dtype=np.float32))[-1]["pulses"],
        )
    assert (np.diff(told["robot"]) >= 0).all()
    assert set(told["robot"].tolist()) >= {0, 2}
    for column, values in going.items():
        np.testing.assert_array_equal(told[column][told["robot"] != 1], values[going["robot"] != 1])


def test_gymnasiums_wrappers_of_info_work_on_the_vector_environment() -> None:
    scenario = near(load_scenario("one_source"), 2.5, 0.5)
    for mode in ("SameStep", "NextStep"):
        envs = DictInfoToList(
            RecordEpisodeStatistics(gymnasium.make_vec(ID, num_envs=3, scenario=scenario, autoreset_mode=mode))
        )
        _, infos = envs.reset(seed=0)
        assert [set(info) for info in infos] == [set(table())] * 3
        late = np.zeros(3, dtype=np.bool_)
        for _ in range(5):
            *_, late, infos = envs.step(np.zeros((3, 2), dtype=np.float32))
        assert late.all()
        assert [float(info["episode"]["l"]) for info in infos] == [5.0] * 3
        if mode == "SameStep":
            assert [float(info["final_info"]["time_s"]) for info in infos] == pytest.approx([0.5] * 3)
