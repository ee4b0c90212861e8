"""Errors of bearings in a yard compared with their total deviations."""

from itertools import pairwise

import numpy as np
import pytest

from dirmusic.angles import azimuth_of, difference
from dirmusic.arrays import FloatArray
from dirmusic.bearing.elevation import total_std
from pdpatrol.envs import load_scenario
from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.missions.driving.site_map import SiteMap
from tests.dirmusic.scenes import robust_std
from tests.envs.helpers import STAND

N_EPISODES = 3600


@pytest.fixture(scope="module")
def errors() -> FloatArray:
    """Return error, deviation by noise and total deviation of one bearing for each of many arrays, places and sites."""
    scenario = load_scenario("transformer_bay")
    env, site_map = PatrolEnv(scenario, full_info=True), SiteMap(scenario, scenario.yard)
    rng, rows = np.random.default_rng(41), list[FloatArray]()
    array = env.simulation.array
    corner_m = np.array(scenario.yard.size_m)
    for seed in range(N_EPISODES):
        pose = np.append(rng.uniform([0.0, 0.0], corner_m), rng.uniform(-np.pi, np.pi))
        if not scenario.yard.contains(pose) or scenario.yard.clearance(pose) < 0.1:
            continue
        env.reset(seed=seed, options={"start_pose": pose})
        source_m = np.array(env.simulation.truths[0]["sources"][0]["position_m"])
        if not site_map.in_sight(pose[np.newaxis, :2], source_m, 0.1)[0]:
            continue
        *_, info = env.step(STAND)
        pulses = info["pulses"].take(slice(1))
        if not (pulses.std_rad < np.radians(12.0)).any():
            continue
        true = info["true_pose"]
        off_rad = difference(pulses.azimuth_rad, azimuth_of(source_m[:2] - true[:2]) - true[2])
        rows.append(np.concatenate([off_rad, pulses.std_rad, total_std(pulses, array)]))
    return np.array(rows).T


@pytest.mark.whole
def test_total_deviation_matches_errors_in_a_yard(errors: FloatArray) -> None:
    offset_rad, noise_rad, total_rad = errors
    assert robust_std(offset_rad / noise_rad) > 2.0
    assert 0.85 < robust_std(offset_rad / total_rad) < 1.15
    for low, high in pairwise(np.radians([0.0, 1.0, 2.0, 4.0, 12.0])):
        own = (low <= noise_rad) & (noise_rad < high)
        assert 0.85 < robust_std(offset_rad[own] / total_rad[own]) < 1.15
