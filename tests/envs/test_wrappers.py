"""Wrappers for flat and bearings-only observations."""

import pickle
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.utils.env_checker import check_env

from dirmusic.angles import difference
from pdpatrol.envs import load_scenario
from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.envs.vector_env import PatrolVectorEnv
from pdpatrol.envs.wrappers import BearingsOnly, FlatObservation, Flattener, bearings_only, bearings_only_space
from tests.envs.helpers import drive

ACTION = drive(0.8, 0.4)
OPEN_YARD = Path(__file__).parents[2] / "examples" / "learning" / "open_yard.toml"


def make() -> PatrolEnv:
    return PatrolEnv("one_source")


@pytest.mark.filterwarnings("ignore:.*is different from the unwrapped version")  # expected here
@pytest.mark.parametrize("wrapped", [BearingsOnly, FlatObservation, lambda env: FlatObservation(BearingsOnly(env))])
def test_wrapped_environment_passes_check_env_and_pickles(wrapped) -> None:  # noqa: ANN001
    env = wrapped(gymnasium.make("pdpatrol:PDPatrol-v0").unwrapped)
    check_env(env, skip_render_check=True)
    env.reset(seed=2)
    copy = pickle.loads(pickle.dumps(env))
    for _ in range(20):
        np.testing.assert_equal(env.step(ACTION)[0], copy.step(ACTION)[0])


def test_bearing_is_in_the_robot_frame() -> None:
    env, same = BearingsOnly(make()), make()
    assert isinstance(env.observation_space, spaces.Dict)
    (seen, _), (full, _) = env.reset(seed=4), same.reset(seed=4)
    assert not seen["bearing"].any()  # no pulse yet
    n_detected = 0
    for _ in range(300):
        seen, full = env.step(ACTION)[0], same.step(ACTION)[0]
        assert env.observation_space.contains(seen)
        if full["detected"][0]:
            n_detected += 1
            world = np.arctan2(*full["bearing"][::-1]) - np.arctan2(*full["pose"][:1:-1])
            assert abs(difference(np.arctan2(*seen["bearing"][::-1]), world)) < 1e-5
    assert n_detected > 3


def test_flat_observation_has_every_entry_scaled() -> None:
    env, same = FlatObservation(make()), make()
    flat, _ = env.reset(seed=1)
    full, _ = same.reset(seed=1)
    assert isinstance(same.observation_space, spaces.Dict)
    assert len(env.names) == flat.size == sum(space.shape[0] for space in same.observation_space.values())  # pyright: ignore
    assert flat[env.names.index("time[0]")] == -1.0
    lidar = flat[[env.names.index(f"lidar[{k}]") for k in range(36)]]
    np.testing.assert_allclose(lidar, full["lidar"] / 6.0 - 1.0, atol=1e-6)
    assert env.observation_space.contains(flat)


def test_functions_apply_to_batches() -> None:
    rows, n_detected = PatrolVectorEnv(4, load_scenario(OPEN_YARD), num_threads=1), 0
    flatten = Flattener(bearings_only_space(rows.single_observation_space))
    singles = [FlatObservation(BearingsOnly(PatrolEnv(load_scenario(OPEN_YARD)))) for _ in range(4)]
    batch, _ = rows.reset(seed=8)
    one_by_one = [env.reset(seed=8 + row)[0] for row, env in enumerate(singles)]
    for _ in range(30):
        np.testing.assert_array_equal(flatten(bearings_only(batch)), np.stack(one_by_one))
        batch = rows.step(np.repeat(ACTION[np.newaxis], 4, axis=0))[0]
        one_by_one = [env.step(ACTION)[0] for env in singles]
        n_detected += int(batch["detected"].sum())
    assert n_detected > 60
    stacked = {key: np.stack([values, values]) for key, values in batch.items()}  # any number of leading axes
    np.testing.assert_array_equal(flatten(bearings_only(stacked))[1], flatten(bearings_only(batch)))
