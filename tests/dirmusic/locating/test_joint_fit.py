"""Sources and array fitted together."""

from dataclasses import replace

import numpy as np
import pytest

from dirmusic import ArrayModel, GainManifold
from dirmusic.array.pattern import as_boresights
from dirmusic.arrays import FloatArray
from dirmusic.locating.joint_fit import ROBUST_SCALE, JointProblem, locate_jointly
from dirmusic.locating.joint_kernels import N_HARMONICS, N_TERMS, FitData, NominalArray, Priors, evaluate, linearise
from tests.dirmusic.scenes import NO_POSE_ERROR, RING, RING_M, SPREAD, detected, sights

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


NOMINAL = NominalArray(
    RING_M,
    as_boresights(TILTED.boresights_rad, TILTED.boresight_elevations_rad),
    TILTED.gain_factors,
    TILTED.gain_offsets,
    TILTED.pattern_table,
)
WEIGHT = RNG.uniform(5.0, 50.0, (40, 6))


def modelled(state: FloatArray) -> FloatArray:
    """Compute the strengths of pulses of amplitude 1, shape (40, 6), by the formula of `locate_jointly`."""
    places, errors = state[:6].reshape(2, 3)[SOURCE], state[6:24].reshape(3, 6)
    terms = state[24:].reshape(3, N_HARMONICS, 2)
    azimuth, elevation, range_m = sights(POSE, places)
    off = azimuth - TILTED.boresights_rad - errors[1]
    gain = TILTED.response_in_space(off, elevation).gain
    sin_up, harmonic = np.sin(elevation), (1 + np.arange(N_HARMONICS)) * off[..., np.newaxis]
    parts = np.cos(harmonic) @ terms[..., 0].T + np.sin(harmonic) @ terms[..., 1].T
    gain = gain + TILTED.gain_factors * (parts[..., 0] + sin_up * parts[..., 1] + sin_up**2 * parts[..., 2])
    plan_m = np.linalg.norm(places[:, :2] - POSE[:, :2], axis=-1, keepdims=True)
    return ((1 + errors[0]) * gain + errors[2]) * plan_m / range_m


def linear(state: FloatArray, strengths: FloatArray, priors: Priors) -> tuple[FloatArray, ...]:
    """Return residuals (40, 6) and slopes (40, 6, N_STATES - 3) of all pulses, boresights turned as by `evaluate`."""
    data = FitData(POSE, SOURCE, WEIGHT, strengths, np.full(40, 3.0))
    errors, at = state[6:24].reshape(3, 6), (np.empty((40, 6)), np.empty((40, 6, N_STATES - 3)))
    turned = NOMINAL._replace(
        boresights=as_boresights(TILTED.boresights_rad + errors[1], TILTED.boresight_elevations_rad)
    )
    for k in range(40):
        linearise(k, state, data, turned, priors, at[0][k], at[1][k], np.empty((9 + N_TERMS, 6)))
    return at


def test_slopes_equal_differences_of_residuals() -> None:
    strengths = RNG.uniform(0.5, 2.0, (40, 1)) * WEIGHT * modelled(STATE)
    for priors in (PRIORS, PRIORS._replace(position_m=0.0, heading_rad=0.0)):
        miss, slope = linear(STATE, strengths, priors)
        np.testing.assert_allclose(miss, 0.0, atol=1e-6)
        for i, own in [*((i, i // 3 == SOURCE) for i in range(6)), *((i, SOURCE >= 0) for i in range(6, N_STATES))]:
            step = np.zeros(N_STATES)
            step[i] = 1e-5
            after, before = (linear(STATE + s, strengths, priors)[0] for s in (step, -step))
            column = i % 3 if i < 6 else i - 3
            expected = np.where(own[:, np.newaxis], slope[:, :, column], 0.0)
            np.testing.assert_allclose((after - before) / 2e-5, expected, atol=2e-4 * np.abs(slope[:, :, column]).max())


def test_cost_and_derivatives_are_those_of_soft_l1() -> None:
    strengths = WEIGHT * modelled(STATE) + RNG.normal(0.0, 3.0, (40, 6))
    miss, slope = linear(STATE, strengths, PRIORS)
    full = np.zeros((40, 6, N_STATES))
    for k in range(40):
        full[k][:, 3 * SOURCE[k] : 3 * SOURCE[k] + 3], full[k][:, 6:] = slope[k][:, :3], slope[k][:, 3:]
    residual = np.concatenate([miss.ravel(), STATE / 2.0])
    jacobian = np.concatenate([full.reshape(-1, N_STATES), np.eye(N_STATES) / 2.0])
    root = np.sqrt(1 + np.square(residual / ROBUST_SCALE))
    data = FitData(POSE, SOURCE, WEIGHT, strengths, np.full(40, 3.0))
    cost, gradient, hessian = evaluate(STATE, 3, N_TERMS, data, NOMINAL, PRIORS)
    assert cost == pytest.approx(ROBUST_SCALE**2 * (root - 1).sum())
    np.testing.assert_allclose(gradient, jacobian.T @ (residual / root), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(hessian, jacobian.T @ (jacobian / root[:, np.newaxis] ** 3), rtol=1e-9, atol=1e-9)


def test_two_sources_and_array_errors_are_estimated() -> None:
    array = ArrayModel(manifold=TILTED, positions_m=RING_M, spread=replace(SPREAD, offset=0.02))
    truth = STATE.copy()
    truth[2], truth[5], truth[24:] = 2.1, 1.4, 0.0  # heights at their prior means; pattern as assumed
    pulses = detected(modelled(truth), 1e-4, 10.0 * np.arange(40))
    start_m = truth[:6].reshape(2, 3) + np.array([[1.5, -1.0, 0.3], [-1.0, 2.0, -0.3]])
    fix = locate_jointly(pulses, POSE, SOURCE, start_m, array, NO_POSE_ERROR)
    miss_m = fix.positions_m - truth[:6].reshape(2, 3)
    assert np.linalg.norm(miss_m[:, :2], axis=-1).max() < 0.02
    for miss, covariance_m2 in zip(miss_m, fix.covariances_m2, strict=True):
        assert miss @ np.linalg.solve(covariance_m2, miss) < 6.0
    np.testing.assert_allclose(fix.errors.mean.pointing_rad, truth[12:18], atol=0.01)


def test_second_solve_equals_a_fresh_one() -> None:
    """A solve leaves no state behind that could stop a later solve early."""
    array = ArrayModel(manifold=TILTED, positions_m=RING_M, spread=replace(SPREAD, offset=0.02, pattern=0.1))
    pulses = detected(modelled(STATE), 1e-2, 10.0 * np.arange(40))

    def problem() -> JointProblem:
        return JointProblem(pulses, POSE, SOURCE, STATE[:6].reshape(2, 3), array, NO_POSE_ERROR)

    far, used = STATE.copy(), problem()
    far[:6] += [1.5, -1.0, 0.3, -1.0, 2.0, 0.3]
    used.solve(STATE)
    for again, fresh in zip(used.solve(far), problem().solve(far), strict=True):
        np.testing.assert_array_equal(again, fresh)
