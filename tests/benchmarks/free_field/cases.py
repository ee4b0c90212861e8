"""Cases in the free field: a robot drives once around discharges in an empty yard.

The shipped models of discharges, array, receiver and pose sensor make the pulses; the seed alone determines all draws.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.spatial.distance import pdist

from dirmusic import ArrayModel, ElementSpread, PoseError, PulseBatch
from dirmusic.arrays import FloatArray, IntArray
from pdpatrol.envs import Scenario, load_scenario
from pdpatrol.envs.episode import Episode, Generators, ResetOptions
from pdpatrol.envs.motion import add_pose_error
from pdpatrol.envs.scenario.radio import surroundings_of
from pdpatrol.envs.simulation import STEP_S
from pdpatrol.envs.user_code import make_estimator
from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing import HelicalArray, Surroundings, level_transform
from pdpatrol.sensing.receiver.bank import ReceiverBank

SPEED_MPS = 0.8
HEIGHTS_M = 0.8, 3.2
LEAST_RANGE_M, MOST_RANGE_M = 5.0, 10.0
SOURCES_WITHIN_M, LEAST_APART_M = 5.0, 3.0
"""Largest distance of several sources from the middle of the loop, and smallest distance between them."""

FENCE_M = load_scenario("one_source").yard.size_m


class Case(NamedTuple):
    """One drive.

    Attributes:
        sources_m: Positions of the sources, shape (n_sources, 3), world frame.
        real: The array with its errors.
        array: The array as the robot knows it.
        pose_error: Error of the poses as the robot knows it.
        true_pose: x m, y m, yaw rad at each control step, world frame, shape (n_steps, 3).
        pose: The same, as measured by the pose sensor, shape (n_steps, 3).
        pulses: All detected pulses with their directions, by time.
        step: Control step of each pulse, shape (n_pulses,).
    """

    sources_m: FloatArray
    real: HelicalArray
    array: ArrayModel
    pose_error: PoseError
    true_pose: FloatArray
    pose: FloatArray
    pulses: PulseBatch
    step: IntArray


def draw_case(
    seed: int, n_sources: int = 1, *, heights_m: tuple[float, float] = HEIGHTS_M, is_exact: bool = False
) -> Case:
    """Draw a drive from a seed.

    Args:
        seed: Seed of all draws.
        n_sources: Number of sources: one in the middle of the loop, 5 to 10 m from it, or several near there.
        heights_m: Range of their heights.
        is_exact: Leave out the errors of array and poses and the ground, so that only noise remains.
    """
    scenario = empty_yard(n_sources, is_exact)
    surroundings = Surroundings() if is_exact else surroundings_of(scenario.yard)
    generators = Generators.spawn(np.random.default_rng(seed))
    sources_m, loop = _draw_places(scenario.yard.size_m, n_sources, heights_m, generators.policy)
    names = [source.name for source in scenario.sources]
    fixed = ResetOptions(None, dict(zip(names, sources_m, strict=True)))
    episode = Episode.draw(scenario, surroundings, generators, fixed)
    array = scenario.known_array
    if is_exact:
        array = replace(array, spread=ElementSpread())
    bank = ReceiverBank(scenario.receiver, [episode.listener])
    batches = [
        bank.listen(level_transform(pose)[np.newaxis], np.array([STEP_S * k]), STEP_S).pulses
        for k, pose in enumerate(loop)
    ]
    pulses = PulseBatch.join(batches)
    return Case(
        sources_m=sources_m,
        real=episode.listener.array,
        array=array,
        pose_error=scenario.pose_sensor.pose_error,
        true_pose=loop,
        pose=_measured(loop, scenario, generators.motion),
        pulses=make_estimator(scenario.estimator.method, array)(pulses, array).attached_to(pulses),
        step=np.repeat(np.arange(len(loop)), [batch.n_pulses for batch in batches]),
    )


@lru_cache
def empty_yard(n_sources: int, is_exact: bool) -> Scenario:
    """Make the shipped scenario of one source without equipment and with several such sources."""
    shipped = load_scenario("one_source")
    source = shipped.sources[0].model_copy(update={"sites": (), "anywhere_at_m": 1.0})
    exact_array = {"gain_error": 0.0, "pointing_error_deg": 0.0, "position_error_m": 0.0}
    exact_pose = {"position_std_m": 0.0, "heading_std_deg": 0.0}
    return shipped.model_copy(
        update={
            "yard": Yard(size_m=shipped.yard.size_m),
            "sources": tuple(source.model_copy(update={"name": f"source_{k}"}) for k in range(n_sources)),
            "array": shipped.array.model_copy(update=exact_array if is_exact else {}),
            "pose_sensor": shipped.pose_sensor.model_copy(update=exact_pose if is_exact else {}),
        }
    )


def with_wild_bearings(case: Case, share: float, seed: int) -> Case:
    """Replace a share of the pulses of a case by equally strong plane waves from random directions."""
    rng, pulses = np.random.default_rng(seed), case.pulses
    wild = np.flatnonzero(rng.random(pulses.n_pulses) < share)
    gain = case.real.manifold().gain(rng.uniform(-np.pi, np.pi, wild.size)).T
    level_v = np.linalg.norm(pulses.strengths_v[wild], axis=-1) / np.linalg.norm(gain, axis=-1)
    noise_v = np.sqrt(pulses.variance_v2[wild]) * rng.standard_normal(gain.shape)
    strengths_v = pulses.strengths_v.copy()
    strengths_v[wild] = np.abs(level_v[:, np.newaxis] * gain + noise_v)
    changed = pulses._replace(strengths_v=strengths_v)
    estimator = make_estimator("maximum_likelihood", case.array)
    return case._replace(pulses=estimator(changed, case.array).attached_to(changed))


def _draw_places(
    size_m: tuple[float, float], n_sources: int, heights_m: tuple[float, float], rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Draw sources (n_sources, 3) and the poses (n_steps, 3) of a loop around them with a random start."""
    centre_m = np.array([rng.uniform(MOST_RANGE_M, length_m - MOST_RANGE_M) for length_m in size_m])
    angle = np.linspace(0.0, 2.0 * np.pi, 3600, endpoint=False)
    half_m = 0.5 * (MOST_RANGE_M - LEAST_RANGE_M)
    first_m = rng.uniform(-half_m, half_m)
    second_m = rng.uniform(-1.0, 1.0) * (half_m - abs(first_m))
    start, turn, direction = rng.uniform(-np.pi, np.pi), rng.uniform(-np.pi, np.pi), rng.choice((-1.0, 1.0))
    range_m = LEAST_RANGE_M + half_m + first_m * np.cos(angle - turn) + second_m * np.cos(2.0 * angle)
    path_m = centre_m + _from_polar(range_m, start + direction * angle)
    plan_m = np.tile(centre_m, (n_sources, 1))
    while n_sources > 1 and pdist(plan_m).min() < LEAST_APART_M:
        from_centre_m = SOURCES_WITHIN_M * np.sqrt(rng.random(n_sources))
        plan_m = centre_m + _from_polar(from_centre_m, rng.uniform(-np.pi, np.pi, n_sources))
    return np.column_stack([plan_m, rng.uniform(*heights_m, n_sources)]), _driven(path_m)


def _from_polar(radius_m: FloatArray, angle_rad: FloatArray) -> FloatArray:
    return radius_m[:, np.newaxis] * np.column_stack([np.cos(angle_rad), np.sin(angle_rad)])


def _driven(path_m: FloatArray) -> FloatArray:
    """Return poses (n_steps, 3) at each control step on a closed path (n, 2), heading along it."""
    closed_m = np.concatenate([path_m, path_m[:1]])
    along_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed_m, axis=0), axis=-1))])
    at_m = np.arange(0.0, along_m[-1], SPEED_MPS * STEP_S)
    x, y = (np.interp(at_m, along_m, axis) for axis in closed_m.T)
    return np.column_stack([x, y, np.arctan2(np.gradient(y), np.gradient(x))])


def _measured(true_pose: FloatArray, scenario: Scenario, rng: np.random.Generator) -> FloatArray:
    """Simulate the pose sensor; shape (n_steps, 3)."""
    sensor = scenario.pose_sensor
    pose, error = np.empty_like(true_pose), np.full(3, np.nan)
    for k, normal in enumerate(rng.standard_normal(true_pose.shape)):
        add_pose_error(true_pose[k], error, sensor.correlation(STEP_S), sensor.std, normal, pose[k])
    return pose
