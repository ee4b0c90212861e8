"""Sources and array fitted together."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from dirmusic import ArrayModel, ElementSpread, GainManifold
from dirmusic.array.pattern import as_boresights
from dirmusic.locating.joint_fit import ROBUST_SCALE, JointProblem, locate_jointly
from dirmusic.locating.joint_kernels import N_HARMONICS, N_TERMS, FitData, NominalArray, Priors, evaluate, linearise
from tests.dirmusic.scenes import NO_POSE_ERROR, RING, RING_M, SPREAD, detected

FloatArray = NDArray[np.float64]


def area_m2(times: int, unexplained: float) -> float:
    """Return the root of the determinant of the covariance on plan, for a number of pulses at each place."""
    spread = replace(SPREAD if unexplained else ElementSpread(), unexplained=unexplained)
    array = ArrayModel(manifold=RING, positions_m=RING_M, spread=spread)
    east = np.linspace(-6.0, 6.0, 13)
    pose = np.column_stack([east, np.zeros(13), np.linspace(0.0, 2.0, 13)])
    bearing = np.arctan2(5.0, -east)
    strengths = RING.gain(bearing - pose[:, 2]).T
    strengths /= np.linalg.norm(strengths, axis=-1, keepdims=True)
    rows = np.repeat(np.arange(13), times)
    pulses = detected(strengths[rows], 1e-5 if unexplained else 1e-3, 10.0 * rows)
    fix = locate_jointly(pulses, pose[rows], np.zeros_like(rows), np.array([[0.3, 4.8, 1.5]]), array, NO_POSE_ERROR)
    return float(np.sqrt(np.linalg.det(fix.covariances_m2[0, :2, :2])))


@pytest.mark.parametrize(("unexplained", "factor"), [(0.02, 1.0), (0.0, 0.1)])
def test_more_pulses_reduce_only_the_noise(unexplained: float, factor: float) -> None:
    assert area_m2(10, unexplained) == pytest.approx(factor * area_m2(1, unexplained), rel=0.1 if unexplained else 0.02)


RNG = np.random.default_rng(5)
POSE = np.column_stack([RNG.uniform(0.0, 20.0, (40, 2)), RNG.uniform(-np.pi, np.pi, 40)])
SOURCE = np.arange(40, dtype=np.intp) % 2
TILTED = GainManifold(
    RING.pattern,
    RING.boresights_rad,
    boresight_elevations_rad=np.radians([10.0, 0.0, -10.0, 20.0, 0.0, 0.0]),
    gain_factors=np.linspace(0.9, 1.1, 6),
    gain_offsets=np.linspace(-0.02, 0.02, 6),
)
STATE = np.concatenate(
    [
        [8.0, 9.0, 1.5, 3.0, 14.0, -0.4],
        *(RNG.normal(0.0, std, 6) for std in (0.05, 0.04, 0.01)),
        RNG.normal(0.0, 0.02, N_TERMS),
    ]
)
N_STATES = STATE.size
PRIORS = Priors(np.zeros(STATE.size), np.full(STATE.size, 2.0), np.eye(STATE.size), 0.1, 0.02, ROBUST_SCALE)


def nominal(manifold: GainManifold) -> NominalArray:
    boresights = as_boresights(manifold.boresights_rad, manifold.boresight_elevations_rad)
    of_gain = manifold.gain_factors, manifold.gain_offsets, manifold.pattern_table
    return NominalArray(RING_M, boresights, *of_gain)


def modelled(state: FloatArray, weight: FloatArray) -> FloatArray:
    """Compute the strengths of pulses of amplitude 1, shape (40, 6), by the formula of `locate_jointly`."""
    places, errors = state[:6].reshape(2, 3)[SOURCE], state[6:24].reshape(3, 6)
    terms = state[24:].reshape(3, N_HARMONICS, 2)
    cos, sin = np.cos(POSE[:, 2:]), np.sin(POSE[:, 2:])
    dx = places[:, :1] - POSE[:, :1] - (cos * RING_M[:, 0] - sin * RING_M[:, 1])
    dy = places[:, 1:2] - POSE[:, 1:2] - (sin * RING_M[:, 0] + cos * RING_M[:, 1])
    off = np.arctan2(dy, dx) - POSE[:, 2:] - TILTED.boresights_rad - errors[1]
    dz = places[:, 2:] - RING_M[:, 2]
    gain = TILTED.response_in_space(off, np.arctan2(dz, np.hypot(dx, dy))).gain
    sin_up, harmonic = dz / np.sqrt(dx**2 + dy**2 + dz**2), (1 + np.arange(N_HARMONICS)) * off[..., np.newaxis]
    parts = np.cos(harmonic) @ terms[..., 0].T + np.sin(harmonic) @ terms[..., 1].T
    gain = gain + TILTED.gain_factors * (parts[..., 0] + sin_up * parts[..., 1] + sin_up**2 * parts[..., 2])
    range_m = np.linalg.norm(places[:, :2] - POSE[:, :2], axis=-1, keepdims=True)
    return weight * ((1 + errors[0]) * gain + errors[2]) * range_m / np.sqrt(dx**2 + dy**2 + dz**2)


def linear(state: FloatArray, strengths: FloatArray, weight: FloatArray, priors: Priors) -> tuple[FloatArray, ...]:
    """Misses (40, 6) and slopes (40, 6, N_STATES - 3) of all pulses; the boresights are turned as `evaluate` does."""
    data = FitData(POSE, SOURCE, weight, strengths, np.full(40, 3.0))
    errors, at = state[6:24].reshape(3, 6), (np.empty((40, 6)), np.empty((40, 6, N_STATES - 3)))
    turned = nominal(TILTED)._replace(
        boresights=as_boresights(TILTED.boresights_rad + errors[1], TILTED.boresight_elevations_rad)
    )
    for k in range(40):
        linearise(k, state, data, turned, priors, at[0][k], at[1][k], np.empty((9 + N_TERMS, 6)))
    return at


def test_slopes_equal_differences_of_residuals() -> None:
    weight = RNG.uniform(5.0, 50.0, (40, 6))
    strengths = RNG.uniform(0.5, 2.0, (40, 1)) * modelled(STATE, weight)
    for priors in (PRIORS, PRIORS._replace(position_m=0.0, heading_rad=0.0)):
        miss, slope = linear(STATE, strengths, weight, priors)
        np.testing.assert_allclose(miss, 0.0, atol=1e-6)
        for i, own in [*((i, i // 3 == SOURCE) for i in range(6)), *((i, SOURCE >= 0) for i in range(6, N_STATES))]:
            step = np.zeros(N_STATES)
            step[i] = 1e-5
            after, before = (linear(STATE + s, strengths, weight, priors)[0] for s in (step, -step))
            column = i % 3 if i < 6 else i - 3
            expected = np.where(own[:, np.newaxis], slope[:, :, column], 0.0)
            np.testing.assert_allclose((after - before) / 2e-5, expected, atol=2e-4 * np.abs(slope[:, :, column]).max())


def test_cost_and_derivatives_are_those_of_soft_l1() -> None:
    weight = RNG.uniform(5.0, 50.0, (40, 6))
    strengths = modelled(STATE, weight) + RNG.normal(0.0, 3.0, (40, 6))
    miss, slope = linear(STATE, strengths, weight, PRIORS)
    full = np.zeros((40, 6, N_STATES))
    for k in range(40):
        full[k][:, 3 * SOURCE[k] : 3 * SOURCE[k] + 3], full[k][:, 6:] = slope[k][:, :3], slope[k][:, 3:]
    residual = np.concatenate([miss.ravel(), STATE / 2.0])
    jacobian = np.concatenate([full.reshape(-1, N_STATES), np.eye(N_STATES) / 2.0])
    root = np.sqrt(1 + np.square(residual / ROBUST_SCALE))
    data = FitData(POSE, SOURCE, weight, strengths, np.full(40, 3.0))
    cost, gradient, hessian = evaluate(STATE, 3, N_TERMS, data, nominal(TILTED), PRIORS)
    assert cost == pytest.approx(ROBUST_SCALE**2 * (root - 1).sum())
    np.testing.assert_allclose(gradient, jacobian.T @ (residual / root), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(hessian, jacobian.T @ (jacobian / root[:, np.newaxis] ** 3), rtol=1e-9, atol=1e-9)


def test_two_sources_and_array_errors_are_estimated() -> None:
    array = ArrayModel(manifold=TILTED, positions_m=RING_M, spread=replace(SPREAD, offset=0.02))
    truth = STATE.copy()
    truth[2], truth[5], truth[24:] = 2.1, 1.4, 0.0  # heights as they are believed to be, and the pattern
    pulses = detected(modelled(truth, np.ones((40, 6))), 1e-4, 10.0 * np.arange(40))
    start_m = truth[:6].reshape(2, 3) + np.array([[1.5, -1.0, 0.3], [-1.0, 2.0, -0.3]])
    fix = locate_jointly(pulses, POSE, SOURCE, start_m, array, NO_POSE_ERROR)
    miss_m = fix.positions_m - truth[:6].reshape(2, 3)
    assert np.linalg.norm(miss_m[:, :2], axis=-1).max() < 0.02
    square = np.einsum("ki,kij,kj->k", miss_m, np.linalg.inv(fix.covariances_m2), miss_m)
    assert square.max() < 6.0
    np.testing.assert_allclose(fix.errors.mean.pointing_rad, truth[12:18], atol=0.01)


def test_second_solve_equals_a_fresh_one() -> None:
    """No state of a solve outlives it: an earlier one does not stop a later one early."""
    array = ArrayModel(manifold=TILTED, positions_m=RING_M, spread=replace(SPREAD, offset=0.02, pattern=0.1))
    pulses = detected(modelled(STATE, np.ones((40, 6))), 1e-2, 10.0 * np.arange(40))

    def problem() -> JointProblem:
        return JointProblem(pulses, POSE, SOURCE, STATE[:6].reshape(2, 3), array, NO_POSE_ERROR)

    far, used = STATE.copy(), problem()
    far[:6] += [1.5, -1.0, 0.3, -1.0, 2.0, 0.3]
    used.solve(STATE)
    for again, fresh in zip(used.solve(far), problem().solve(far), strict=True):
        np.testing.assert_array_equal(again, fresh)
