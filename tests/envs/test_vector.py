"""Each row of the vector environment equals a single environment to the bit."""

from typing import Any

import gymnasium
import numpy as np
import pytest

from pdpatrol.envs import Scenario, load_scenario
from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.envs.vector_env import PatrolVectorEnv

N_STEPS = 300


def brisk(name: str = "one_source", **settings: Any) -> Scenario:  # noqa: ANN401 - as TOML
    """Make a scenario whose episodes end soon, by time or by approach, with other tables replaced."""
    return load_scenario(name, {"task.time_limit_s": 9.0, "task.standoff_m": 8.0, **settings})


def actions(seed: int, n_steps: int = N_STEPS) -> np.ndarray:
    return np.random.default_rng([seed, 9]).uniform(-1.0, 1.0, (n_steps, 2)).astype(np.float32)


def single_rollout(scenario: Scenario, seed: int, n_steps: int = N_STEPS) -> list[Any]:
    """Run a single environment that is reset in the step after the end of an episode."""
    env, is_over, steps = PatrolEnv(scenario), False, list[Any]()
    observation, _ = env.reset(seed=seed)
    steps.append((observation, 0.0, False, False))
    for action in actions(seed, n_steps):
        if is_over:
            observation, _ = env.reset()
            steps.append((observation, 0.0, False, False))
            is_over = False
        else:
            observation, reward, terminated, truncated, _ = env.step(action)
            steps.append((observation, reward, terminated, truncated))
            is_over = terminated or truncated
    return steps


@pytest.fixture(scope="module")
def singles() -> list[list[Any]]:
    return [single_rollout(brisk(), 40 + row) for row in range(16)]


@pytest.mark.parametrize(("num_envs", "num_threads"), [(1, 1), (3, 2), (16, 1), (16, 2)])
def test_row_equals_single_environment_to_the_bit(num_envs: int, num_threads: int, singles: list[list[Any]]) -> None:
    envs = gymnasium.make_vec("pdpatrol:PDPatrol-v0", num_envs=num_envs, scenario=brisk(), num_threads=num_threads)
    assert isinstance(envs.unwrapped, PatrolVectorEnv)
    observation, _ = envs.reset(seed=40)
    driven = np.stack([actions(40 + row) for row in range(num_envs)], axis=1)
    steps = [(observation, np.zeros(num_envs), np.zeros(num_envs, bool), np.zeros(num_envs, bool))]
    steps += [envs.step(action)[:4] for action in driven]
    n_ended = 0
    for step, (observation, reward, terminated, truncated) in enumerate(steps):
        assert observation in envs.observation_space
        for row in range(num_envs):
            alone, alone_reward, alone_terminated, alone_truncated = singles[row][step]
            for key, values in observation.items():
                np.testing.assert_array_equal(values[row], alone[key], err_msg=f"{key} of row {row} in step {step}")
            assert reward[row] == alone_reward
            assert (terminated[row], truncated[row]) == (alone_terminated, alone_truncated)
            n_ended += alone_terminated or alone_truncated
    assert n_ended >= 3 * num_envs


def test_rows_with_faulty_channels_equal_single_environments() -> None:
    fault = {"channel": 2, "kind": "dead", "start_s": 1.0}
    many = [{"name": f"in_{item}", "sites": [f"{item}/*"], "pulse_rate_hz": 60.0} for item in ("vt_west", "vt_east")]
    scenario = brisk("two_sources", **{"receiver.faults": [fault], "sources": many})
    envs = PatrolVectorEnv(3, scenario, num_threads=2)
    observation, _ = envs.reset(seed=5)
    for step, action in enumerate(np.stack([actions(5 + row, 60) for row in range(3)], axis=1)):
        observation, *_ = envs.step(action)
        if step == 59:
            alone = [single_rollout(scenario, 5 + row, 60)[-1][0] for row in range(3)]
            for key, values in observation.items():
                np.testing.assert_array_equal(values, np.array([one[key] for one in alone]), err_msg=key)


def test_moving_interferer_is_where_each_row_has_it() -> None:
    tram = {"name": "tram", "position_m": (-20.0, -8.0, 3.0), "moves_to_m": (60.0, -8.0, 3.0), "speed_mps": 20.0}
    tram |= {"amplitude_v": 3.0, "pulse_rate_hz": 100.0}
    scenario = brisk(interferers=[tram])
    envs = PatrolVectorEnv(3, scenario, autoreset_mode="Disabled")
    singles = [PatrolEnv(scenario) for _ in range(3)]
    _, info = envs.reset(seed=40)
    for row, env in enumerate(singles):
        env.reset(seed=40 + row)
    n_detected = 0
    for step, driven in enumerate(np.stack([actions(40 + row, 60) for row in range(3)], axis=1)):
        if step in (10, 25):
            mask = np.arange(3) == step // 10 - 1
            envs.reset(options={"reset_mask": mask})
            singles[int(mask.argmax())].reset()
        observation, *_, info = envs.step(driven)
        n_detected += int(observation["detected"].sum())
        for row, env in enumerate(singles):
            alone, *_ = env.step(driven[row])
            for key, values in observation.items():
                np.testing.assert_array_equal(values[row], alone[key], err_msg=f"{key} of row {row} in step {step}")
    assert info["time_s"].tolist() == pytest.approx([5.0, 3.5, 6.0])
    assert n_detected > 100


def test_truth_has_the_path_of_a_moving_interferer() -> None:
    tram = {"name": "tram", "position_m": (-9.0, 0.0, 3.0), "amplitude_v": 1.0}
    moving = {**tram, "name": "bus", "moves_to_m": (-9.0, 30.0, 3.0), "speed_mps": 8.0}
    _, info = PatrolEnv(brisk(interferers=[tram, moving]), full_info=True).reset(seed=0)
    standing, bus = info["truth"]["interferers"]
    assert not {"moves_to_m", "speed_mps"} & standing.keys()
    assert (bus["position_m"], bus["moves_to_m"], bus["speed_mps"]) == ([-9.0, 0.0, 3.0], [-9.0, 30.0, 3.0], 8.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"num_envs": 0}, "`num_envs` must be at least 1"),
        ({"num_envs": 2, "render_mode": "rgb_array"}, "make a single environment"),
    ],
)
def test_impossible_argument_is_refused(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        PatrolVectorEnv(**arguments)


@pytest.mark.parametrize("seed", [np.int64(5), (5, 6), np.array([5, 6]), [5, 6]])
def test_seed_may_be_any_integer_type(seed: object) -> None:
    envs = PatrolVectorEnv(2)
    first, _ = envs.reset(seed=5)
    again, _ = envs.reset(seed=seed)  # pyright: ignore[reportArgumentType]
    np.testing.assert_array_equal(first["pose"], again["pose"])
