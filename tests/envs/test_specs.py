"""Environment specs in JSON, length of episodes, seeds, and errors of invalid calls."""

import json
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import error
from gymnasium.envs.registration import EnvSpec

from pdpatrol.envs import ScenarioError, load_scenario, shipped_scenarios
from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.envs.random_yard import random_yard
from pdpatrol.envs.scenario import SHIPPED
from pdpatrol.envs.vector_env import PatrolVectorEnv
from tests.envs.helpers import STAND, drive, listed

ID = "pdpatrol:PDPatrol-v0"


def spec_of(env: Any) -> EnvSpec:  # noqa: ANN401 - single or vector
    return env.spec


@pytest.mark.parametrize(("time_limit_s", "n_steps"), [(1.0, 10), (0.96, 10), (0.1, 1)])
def test_spec_states_the_steps_of_an_episode(time_limit_s: float, n_steps: int) -> None:
    short = load_scenario("quiet_yard", {"task.time_limit_s": time_limit_s})
    env, many = gymnasium.make(ID, scenario=short), gymnasium.make_vec(ID, num_envs=2, scenario=short)
    assert (spec_of(env).max_episode_steps, spec_of(many).max_episode_steps) == (n_steps, n_steps)
    _ = env.reset(seed=0), many.reset(seed=0)
    late = [env.step(STAND)[3] for _ in range(n_steps)]
    assert late == [False] * (n_steps - 1) + [True]
    rows = [many.step(np.tile(STAND, (2, 1)))[3].all() for _ in range(n_steps)]
    assert rows == late


def test_max_episode_steps_limits_single_and_vector() -> None:
    env, many = gymnasium.make(ID, max_episode_steps=7), gymnasium.make_vec(ID, num_envs=2, max_episode_steps=7)
    assert (spec_of(env).max_episode_steps, spec_of(many).max_episode_steps) == (7, 7)
    (one, _), (rows, _) = env.reset(seed=1), many.reset(seed=1)
    for step in range(1, 8):
        assert one["time"] == rows["time"][0] == np.float32(0.1 * (step - 1))  # the limit does not change observations
        one, _, _, late, _ = env.step(np.full(2, 0.5, dtype=np.float32))
        rows, _, _, rows_late, _ = many.step(np.full((2, 2), 0.5, dtype=np.float32))
        assert late == rows_late[0] == (step == 7)
        for key, values in one.items():
            np.testing.assert_array_equal(rows[key][0], values)
    assert PatrolVectorEnv(1, "quiet_yard", max_episode_steps=10**6).simulation.max_episode_steps < 10**6
    for wrong in (0, -1):
        with pytest.raises(ValueError, match="`max_episode_steps` must be at least 1"):
            PatrolVectorEnv(1, max_episode_steps=wrong)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("name", [*shipped_scenarios(), "random", "path"])
def test_spec_goes_through_json(name: str) -> None:
    drawn = random_yard(3) if name == "random" else load_scenario("bench" if name == "path" else name)
    scenario = SHIPPED / "bench.toml" if name == "path" else drawn
    env = gymnasium.make(ID, scenario=scenario, terminate_on_approach=False)
    again = gymnasium.make(EnvSpec.from_json(spec_of(env).to_json()))
    assert isinstance(again.unwrapped, PatrolEnv)
    assert again.unwrapped.scenario == drawn
    assert spec_of(again).max_episode_steps == spec_of(env).max_episode_steps
    np.testing.assert_equal(again.reset(seed=3), env.reset(seed=3))
    action = drive(0.6, -0.3)
    for _ in range(5):
        np.testing.assert_equal(again.step(action), env.step(action))


def test_spec_of_drawn_scenarios_goes_through_json() -> None:
    env = gymnasium.make(ID, scenario=random_yard)
    again = gymnasium.make(EnvSpec.from_json(spec_of(env).to_json()))
    np.testing.assert_equal(again.reset(seed=3), env.reset(seed=3))
    unnamed = gymnasium.make(ID, scenario=lambda rng: random_yard(rng)).spec
    assert unnamed is not None
    with pytest.raises(TypeError, match="function is not JSON serializable"):
        unnamed.to_json()
    with pytest.raises(ScenarioError, match="no_such"):
        PatrolEnv("pdpatrol.envs.random_yard:no_such")


def test_spec_of_vector_environment_goes_through_json() -> None:
    envs = gymnasium.make_vec(
        ID,
        num_envs=3,
        scenario=load_scenario("two_sources"),
        autoreset_mode=gymnasium.vector.AutoresetMode.SAME_STEP,
        max_episode_steps=5,
    )
    again = gymnasium.make_vec(EnvSpec.from_json(spec_of(envs).to_json()))
    assert again.num_envs == 3
    assert json.loads(spec_of(again).to_json()) == json.loads(spec_of(envs).to_json())
    np.testing.assert_equal(again.reset(seed=3), envs.reset(seed=3))
    for _ in range(6):
        result, expected = again.step(np.tile(STAND, (3, 1))), envs.step(np.tile(STAND, (3, 1)))
        np.testing.assert_equal(listed(result), listed(expected))


def test_seeds_of_rows_reproduce_their_episodes() -> None:
    envs = PatrolVectorEnv(3)
    envs.reset(seed=3)
    assert envs.np_random_seed == (3, 4, 5)
    envs.reset(seed=[None, 9, None])
    assert envs.np_random_seed == (3, 9, 5)
    unseeded, twin = PatrolVectorEnv(3), PatrolVectorEnv(3)
    first, _ = unseeded.reset()
    again, _ = twin.reset(seed=unseeded.np_random_seed)
    np.testing.assert_equal(again, first)
    assert len(set(unseeded.np_random_seed)) == 3


def test_calls_out_of_order_raise_errors_of_gymnasium() -> None:
    env, many = PatrolEnv(render_mode="rgb_array"), PatrolVectorEnv(2)
    for call in (
        lambda: env.step(STAND),
        env.render,
        lambda: many.step(np.tile(STAND, (2, 1))),
    ):
        with pytest.raises(error.ResetNeeded, match=r"before calling env\.reset"):
            call()
    with pytest.raises(error.ResetNeeded, match="for all of them"):
        many.reset(seed=0, options={"reset_mask": np.array([True, False])})
    _ = env.reset(seed=0), many.reset(seed=0)
    env.close()
    many.close()
    for call in (
        lambda: env.step(STAND),
        env.reset,
        lambda: many.step(np.tile(STAND, (2, 1))),
        many.reset,
    ):
        with pytest.raises(error.ClosedEnvironmentError, match=r"after calling env\.close"):
            call()


@pytest.mark.parametrize("scenario", [5, None, ["one_source"], lambda rng: random_yard(0)])
def test_other_scenario_arguments_are_refused(scenario: object) -> None:
    with pytest.raises(ValueError, match="`scenario` must be"):
        PatrolVectorEnv(2, scenario)  # pyright: ignore[reportArgumentType]


def test_errors_of_plain_data_are_all_listed() -> None:
    data = load_scenario("one_source").model_dump(mode="json")
    data["task"]["standoff_m"], data["battery"]["idle_w"] = -1.0, "much"
    with pytest.raises(ScenarioError) as raised:
        PatrolEnv(data)
    assert [fault.split(": ")[0] for fault in str(raised.value).splitlines()] == ["battery.idle_w", "task.standoff_m"]
