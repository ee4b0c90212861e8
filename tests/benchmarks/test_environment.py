"""Speed of the environment compared with its physics, with Gymnasium robots and with Gymnasium vector environments.

Lidar, sensing and direction finding are on. The compared functions run in turn, and the results are ratios.
"""

import statistics
import time
from collections.abc import Callable
from typing import Any

import gymnasium
import mujoco
import numpy as np
import pytest

from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.envs.simulation import STEP_S

pytestmark = [pytest.mark.benchmark, pytest.mark.usefixtures("one_thread")]

ENV_ID = "pdpatrol:PDPatrol-v0"
BENCH: dict[str, Any] = {"scenario": "bench", "terminate_on_approach": False}
N_ENVS, N_THREADS = 64, 2
ROUNDS, LEAST_QUIET, MOST_ROUNDS = 30, 20, 150


def median_seconds(*sides: Callable[[], int], undisturbed: Callable[[], int] | None = None) -> list[float]:
    """Return the median time per step of each function in seconds, running the functions in turn.

    Args:
        sides: Functions to compare, which take some steps and return their number.
        undisturbed: One of `sides`, which only steps the physics. Rounds in which it takes more than 1.15 times its
            fastest time are disturbed by other processes; they are not counted, and more rounds are run.
    """
    for side in sides:
        side()
    taken: list[list[float]] = []
    while True:
        taken.append([])
        for side in sides:
            start = time.perf_counter()
            n_steps = side()
            taken[-1].append((time.perf_counter() - start) / n_steps)
        rounds = taken
        if undisturbed is not None:
            column = sides.index(undisturbed)
            fastest = min(seconds[column] for seconds in taken)
            rounds = [seconds for seconds in taken if seconds[column] <= 1.15 * fastest]
        if len(taken) >= MOST_ROUNDS or (len(taken) >= ROUNDS and len(rounds) >= LEAST_QUIET):
            print(f"\n{len(rounds)} of {len(taken)} rounds count")
            return [statistics.median(column) for column in zip(*rounds, strict=True)]


def random_steps(env: gymnasium.Env[Any, Any], n_steps: int = 300) -> Callable[[], int]:
    """Make a function that takes random steps, with a reset at the start and after each episode."""
    assert isinstance(env.action_space, gymnasium.spaces.Box)
    low, high = env.action_space.low, env.action_space.high
    actions = np.random.default_rng(0).uniform(low, high, (n_steps, *low.shape)).astype(np.float32)
    env.reset(seed=0)

    def step_all() -> int:
        env.reset()
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
        return n_steps

    return step_all


def vector_steps(envs: gymnasium.vector.VectorEnv[Any, Any, Any], n_steps: int = 12) -> Callable[[], int]:
    """Make a function that takes random steps in a vector environment, and counts the steps of all rows."""
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (n_steps, envs.num_envs, 2)).astype(np.float32)
    envs.reset(seed=0)

    def step_all() -> int:
        for action in actions:
            envs.step(action)
        return n_steps * envs.num_envs

    return step_all


def bare_physics(n_steps: int = 300) -> Callable[[], int]:
    """Make a function that calls only `mj_step`, with the environment's model and substeps and random wheel speeds."""
    model = PatrolEnv("bench").simulation.robots.physics
    data = mujoco.MjData(model)  # pyright: ignore[reportAttributeAccessIssue]
    mujoco.mj_resetDataKeyframe(model, data, 0)  # pyright: ignore[reportAttributeAccessIssue]
    data.qpos[:2] = 3.0, 3.0
    v, turn = np.random.default_rng(0).uniform(-1.0, 1.0, (n_steps, 2)).T
    wheels = np.stack([0.8 * v - 1.5 * 0.16 * turn, 0.8 * v + 1.5 * 0.16 * turn], axis=-1) / 0.075
    n_substeps = round(STEP_S / model.opt.timestep)

    def step_all() -> int:
        for speeds in wheels:
            data.ctrl[:] = speeds
            mujoco.mj_step(model, data, nstep=n_substeps)  # pyright: ignore[reportAttributeAccessIssue]
        return n_steps

    return step_all


def test_every_step_of_the_bench_scenario_detects_a_pulse() -> None:
    env = gymnasium.make(ENV_ID, **BENCH)
    env.reset(seed=0)
    rng = np.random.default_rng(1)
    detected = [env.step(rng.uniform(-1, 1, 2).astype(np.float32))[0]["detected"][0] for _ in range(600)]
    assert min(detected) == 1.0
    envs = gymnasium.make_vec(ENV_ID, num_envs=8, **BENCH)
    envs.reset(seed=0)
    for _ in range(100):
        observation, *_ = envs.step(rng.uniform(-1, 1, (8, 2)).astype(np.float32))
        assert observation["detected"].min() == 1.0


@pytest.mark.parametrize(
    ("options", "least"), [(BENCH, 1.5), ({"scenario": "one_source"}, 1.2), ({"scenario": "two_sources"}, 1.0)]
)
def test_environment_is_as_fast_as_ant(options: dict[str, Any], least: float) -> None:
    ant, bare = gymnasium.make("Ant-v5"), bare_physics()
    ours = random_steps(gymnasium.make(ENV_ID, **options))
    ours_s, bare_s, ant_s = median_seconds(ours, bare, random_steps(ant), undisturbed=bare)
    over_ant = (STEP_S / ours_s) / (ant.unwrapped.dt / ant_s)  # pyright: ignore[reportAttributeAccessIssue]
    print(
        f"{options['scenario']}: {1 / ours_s:.0f} steps per second, {bare_s / ours_s:.2f} of the speed of physics; "
        f"{over_ant:.2f} times the simulated time of Ant-v5"
    )
    assert over_ant >= least


def test_vector_environment_is_twice_as_fast() -> None:
    def made(mode: str | None, **options: Any) -> gymnasium.vector.VectorEnv[Any, Any, Any]:  # noqa: ANN401
        n_envs = N_ENVS if mode is None else 8
        return gymnasium.make_vec(ENV_ID, num_envs=n_envs, vectorization_mode=mode, **BENCH, **options)

    native, sync, in_processes = made(None, num_threads=N_THREADS), made("sync"), made("async")
    try:
        single_s, native_s, sync_s, async_s = median_seconds(
            random_steps(gymnasium.make(ENV_ID, **BENCH)),
            vector_steps(native),
            vector_steps(sync, 30),
            vector_steps(in_processes, 30),
        )
    finally:
        in_processes.close()
    print(
        f"\nnative vector environment, {N_ENVS} robots on {N_THREADS} threads: {single_s / native_s:.2f} times as fast "
        f"as one environment, {sync_s / native_s:.2f} as SyncVectorEnv, {async_s / native_s:.2f} as AsyncVectorEnv"
    )
    assert single_s / native_s >= 2.0
    assert min(sync_s, async_s) / native_s >= 2.0
