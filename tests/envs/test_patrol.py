"""PDPatrol-v0 fulfils the contract of Gymnasium and that of its docstring."""

import pickle
import re
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.utils.env_checker import check_env
from hypothesis import given, settings
from hypothesis import strategies as st

from pdpatrol.envs import load_scenario, shipped_scenarios
from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.envs.random_yard import random_yard
from tests.envs.helpers import STAND, drive


@pytest.mark.parametrize("name", shipped_scenarios())
def test_check_env_passes(name: str) -> None:
    check_env(gymnasium.make("pdpatrol:PDPatrol-v0", scenario=name).unwrapped, skip_render_check=True)


def test_docstring_table_matches_observation_space() -> None:
    env = PatrolEnv()
    rows = re.findall(r"^ +\| (\w+) \| (\d+) \| \S", PatrolEnv.__doc__ or "", flags=re.MULTILINE)
    assert isinstance(env.observation_space, spaces.Dict)
    shapes = {key: (int(n),) for key, n in rows if not key.isdigit()}
    assert all(isinstance(space, spaces.Box) and space.is_bounded() for space in env.observation_space.values())
    assert shapes == {key: space.shape for key, space in env.observation_space.spaces.items()}
    speed_mps, yaw_rate_radps = env.scenario.robot.description.limits
    assert f"| forward speed | {speed_mps:g} |" in (PatrolEnv.__doc__ or "")
    assert f"| yaw rate | {yaw_rate_radps:g} |" in (PatrolEnv.__doc__ or "")
    assert f"[-{2 * speed_mps:g}, {2 * speed_mps:g}], [-{2 * yaw_rate_radps:g}, " in (PatrolEnv.__doc__ or "")


@settings(max_examples=24, deadline=None, derandomize=True)
@given(
    name=st.sampled_from([*shipped_scenarios(), *range(8)]),
    seed=st.integers(0, 2**31),
    pace=st.floats(-1.0, 1.0, width=32),
)
def test_observations_lie_in_their_space(name: str | int, seed: int, pace: float) -> None:
    """Names select shipped scenarios; numbers select random yards with that number of obstructions."""
    scenario = random_yard(seed, name) if isinstance(name, int) else load_scenario(name)
    env = PatrolEnv(scenario)
    observation, _ = env.reset(seed=seed)
    assert env.observation_space.contains(observation)
    env.action_space.seed(seed)
    for step in range(25):
        action = env.action_space.sample() if step % 2 else drive(pace, 1.0)
        observation, *_ = env.step(action)
        assert env.observation_space.contains(observation)


def test_options_set_what_is_drawn() -> None:
    env = PatrolEnv("two_sources", full_info=True)
    names = [source.name for source in env.scenario.sources]
    site = env.scenario.yard.site_names()[0]
    places = {names[0]: site, names[1]: (20.0, 6.0, 1.5)}
    _, info = env.reset(seed=0, options={"start_pose": (8.0, 6.0, 0.5), "sources": places})
    np.testing.assert_allclose(info["true_pose"], [8.0, 6.0, 0.5], atol=1e-9)
    first, second = (np.array(source["position_m"]) for source in info["truth"]["sources"])
    np.testing.assert_allclose(first, env.scenario.yard.site_position(site))
    np.testing.assert_allclose(second, [20.0, 6.0, 1.5])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"pose": (1.0, 1.0, 0.0)}, "must be a dict with the keys start_pose and sources, got {'pose'"),
        ({"sources": {"other": (1.0, 1.0, 1.0)}}, "no source `other`; available:"),
        ({"sources": {"discharge": (1.0, 1.0, -1.0)}}, "must lie in the yard, above the ground"),
        ({"start_pose": (3.0, 3.0, 180.0)}, "a yaw in [-2 pi, 2 pi]"),
        ({"start_pose": "dock"}, "start_pose must be three finite numbers, got 'dock'"),
    ],
)
def test_impossible_option_is_refused(options: Any, message: str) -> None:  # noqa: ANN401
    env = PatrolEnv("transformer_bay")
    with pytest.raises(ValueError, match=re.escape(message)):
        env.reset(seed=0, options=options)


def test_scenario_can_be_drawn_for_each_episode() -> None:
    env = gymnasium.make("pdpatrol:PDPatrol-v0", scenario=random_yard).unwrapped
    assert isinstance(env, PatrolEnv)
    check_env(env, skip_render_check=True)
    layouts = set()
    for seed in range(4):
        env.reset(seed=seed)
        layouts.add(tuple(item.position_m for item in env.scenario.yard.equipment))
        env.step(STAND)
    assert len(layouts) == 4
    env.reset(seed=0)
    again = tuple(item.position_m for item in env.scenario.yard.equipment)
    assert again in layouts
    names = iter(["one_source", "paper_field"])
    mixed = PatrolEnv(lambda _: load_scenario(next(names)))
    with pytest.raises(ValueError, match="must draw scenarios with one size of yard"):
        mixed.reset(seed=0)


def test_entries_without_a_pulse_are_zero() -> None:
    env = PatrolEnv(load_scenario("one_source", {"sources": [], "receiver.false_alarm_rate_hz": 1e-9}))
    env.reset(seed=0)
    observation, *_ = env.step(STAND)
    for key in ("detected", "strengths", "level", "spectrum", "bearing"):
        assert not observation[key].any()
    assert observation["bearing_age"] == 60.0


def test_detected_pulse_has_unit_strengths_and_spectrum_maximum_one() -> None:
    env = PatrolEnv()
    env.reset(seed=0)
    detected = [o for o, *_ in (env.step(drive(0.3, 0.0)) for _ in range(300)) if o["detected"]]
    assert detected
    for observation in detected:
        assert np.linalg.norm(observation["strengths"]) == pytest.approx(1.0, abs=1e-5)
        assert (observation["spectrum"] == 1.0).sum() == 1
        assert observation["bearing_age"] == 0.0


def test_reward_is_the_sum_of_its_terms() -> None:
    env = PatrolEnv(full_info=True)
    _, info = env.reset(seed=4)
    source = np.array(info["truth"]["sources"][0]["position_m"][:2])
    for _ in range(40):
        before = env.simulation.robots.readings.pose[0, :2]
        _, reward, *_, info = env.step(drive(1.0, 0.1))
        moved = np.linalg.norm(source - before) - np.linalg.norm(source - info["true_pose"][:2])
        assert reward == pytest.approx(sum(info[f"reward_{term}"] for term in ("progress", "time", "contact")))
        assert info["reward_progress"] == pytest.approx(moved)


def test_episode_ends_on_approach_if_asked() -> None:
    close = load_scenario("one_source", {"sources": [{"name": "near", "position_m": [4.0, 3.0, 1.0]}]})
    for ends in (True, False):
        env = PatrolEnv(close, terminate_on_approach=ends)
        env.reset(seed=0)
        assert env.step(STAND)[2] is ends


def test_seed_draws_site_amplitude_heading_and_array() -> None:
    env = PatrolEnv(full_info=True)
    starts = [env.reset(seed=seed)[1] for seed in range(20)]
    truths = [start["truth"] for start in starts]
    positions = np.array([truth["sources"][0]["position_m"] for truth in truths])
    levels = 20 * np.log10([truth["sources"][0]["amplitude_v"] / 0.27 for truth in truths])
    assert len(np.unique(positions.round(2), axis=0)) >= 5
    assert np.ptp(positions[:, :2], axis=0).max() > 8.0
    assert np.abs(levels).max() <= 3.0
    assert np.ptp(levels) > 3.0
    assert np.ptp([start["true_pose"][2] for start in starts]) > 3.0
    assert np.ptp([truth["array"]["gain_factors"][0] for truth in truths]) > 0.05


def test_every_shot_of_a_discharge_gun_is_detected_once() -> None:
    env = PatrolEnv("paper_field", full_info=True)
    observation, info = env.reset(seed=3)
    assert observation["strengths"].shape == (4,)
    start, offsets = info["true_pose"], np.array(info["truth"]["array"]["gain_offsets"])
    np.testing.assert_allclose(start, [10.0, 15.0, 0.0], atol=1e-6)
    times: list[float] = []
    truncated = False
    while not truncated:
        _, _, terminated, truncated, info = env.step(STAND)
        assert not terminated
        pulses = info["pulses"]
        times += pulses.time_s[pulses.std_rad < np.radians(10.0)].tolist()  # triggers by noise have no bearing
    np.testing.assert_allclose(info["true_pose"], start, atol=0.01)
    expected = np.concatenate([1.0 + 11.0 * k + np.arange(20) / 2.0 for k in range(10)])
    np.testing.assert_allclose(times, expected, atol=1e-9)
    assert np.all(np.abs(offsets) <= 0.06)
    assert np.all(offsets != 0)


def test_pickled_copy_continues_to_the_bit() -> None:
    env = PatrolEnv("two_sources", full_info=True)
    env.reset(seed=5)
    action = drive(0.7, 0.2)
    for _ in range(30):
        env.step(action)
    copy = pickle.loads(pickle.dumps(env))
    for _ in range(30):
        (seen, reward, *_, info), (again, same_reward, *_, same_info) = env.step(action), copy.step(action)
        assert reward == same_reward
        assert all(np.array_equal(seen[key], again[key]) for key in seen)
        np.testing.assert_array_equal(info["pulses"].strengths_v, same_info["pulses"].strengths_v)
        np.testing.assert_array_equal(info["odometry"], same_info["odometry"])
