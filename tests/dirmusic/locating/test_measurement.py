"""Measurement model: strengths, derivatives and covariance against formulas in NumPy, and densities."""

from dataclasses import replace

import numpy as np
import pytest

from dirmusic import ArrayModel, ElementErrors, GainManifold
from dirmusic.arrays import FloatArray, IntArray
from dirmusic.locating.joint_fit import array_prior, nominal_array
from dirmusic.locating.measurement import (
    GROUND,
    N_SHARED,
    N_TERMS,
    TINY_VARIANCE,
    Noise,
    PooledPulses,
    Prediction,
    compare,
    errors_at,
    expand,
    predict,
    shared_scores,
    whiten,
)
from tests.dirmusic.locating.forward_model import ARRAY as RING
from tests.dirmusic.locating.forward_model import (
    BOARD_RAD,
    BOARDS_M,
    GRAVEL,
    LOBE,
    START,
    Nature,
    distorted,
    drawn_errors,
    gains,
    ground_effect,
    ground_phase,
    image_of,
    modelled,
    sights,
    unexplained_error,
)

RNG = np.random.default_rng(5)
N = 12
MANIFOLD = GainManifold(
    LOBE,
    BOARD_RAD,
    boresight_elevations_rad=np.radians([10.0, 0.0, -10.0, 20.0, 0.0, 0.0]),
    gain_factors=np.linspace(0.9, 1.1, 6),
    gain_offsets=np.linspace(-0.02, 0.02, 6),
)
ARRAY = ArrayModel(manifold=MANIFOLD, positions_m=BOARDS_M + RNG.uniform(-0.05, 0.05, (6, 3)), spread=RING.spread)
NATURE = Nature(
    widening=0.1,
    tilt_rad=(0.03, -0.02),
    errors=replace(drawn_errors(RNG), offset=RNG.normal(0.0, 0.01, 6)),
    terms=RNG.normal(0.0, 0.003, N_TERMS),
    permittivity=5.0,
)
NOISE = Noise(position_m=0.05, heading_rad=0.01, unexplained=0.03)
PLACE_M = np.array([3.0, 2.0, 2.2])
POSE = np.column_stack([RNG.uniform(-5.0, 8.0, (N, 2)), RNG.uniform(-np.pi, np.pi, N)])


def state_of(nature: Nature) -> FloatArray:
    errors, terms = nature.errors, np.zeros(N_TERMS) if nature.terms is None else nature.terms
    common = [nature.widening, *nature.tilt_rad, np.log(nature.permittivity)]
    return np.concatenate([common, errors.gain, errors.pointing_rad, errors.offset, terms])


def pulses_at(pose: FloatArray, strengths: FloatArray, noise: float = 0.01) -> PooledPulses:
    usable = np.ones(strengths.shape, dtype=np.bool_)
    return PooledPulses(pose, strengths, np.full(strengths.shape, noise**2), usable, np.ones(len(pose)))


def of_channels(pulses: PooledPulses, rows: IntArray) -> PooledPulses:
    """Select channels, in contiguous arrays as compiled functions know them."""
    return pulses._replace(
        strengths=np.ascontiguousarray(pulses.strengths[:, rows]),
        variance=np.ascontiguousarray(pulses.variance[:, rows]),
        is_usable=np.ascontiguousarray(pulses.is_usable[:, rows]),
    )


def drawn_pulses(pose: FloatArray = POSE, place_m: FloatArray = PLACE_M) -> PooledPulses:
    """Make pulses of unit norm with errors of 5 %."""
    strengths = modelled(pose, np.tile(place_m, (len(pose), 1)), ARRAY, NATURE)
    strengths = strengths * (1.0 + 0.05 * np.random.default_rng(1).normal(size=strengths.shape))
    return pulses_at(pose, strengths / np.linalg.norm(strengths, axis=-1, keepdims=True))


def prediction(
    pulses: PooledPulses,
    k: int,
    array: ArrayModel = ARRAY,
    place_m: FloatArray = PLACE_M,
    state: FloatArray | None = None,
) -> tuple[Prediction, tuple[float, float, float]]:
    """Predict one pulse."""
    state, n = state_of(NATURE) if state is None else state, array.manifold.n_elements
    result = Prediction(*(np.zeros(shape) for shape in (n, n, (n, 3 + state.size), (n, n), (n, N_SHARED + n))))
    return result, predict(k, place_m, 0, state, pulses, nominal_array(array), NOISE, result)


def across(model: FloatArray, change: FloatArray) -> FloatArray:
    """Remove the part along the model from changes (n, m)."""
    unit = model / np.linalg.norm(model)
    return change - np.outer(unit, unit @ change)


def differences(k: int, pose: FloatArray) -> FloatArray:
    """Return central differences of the modelled strengths of a pulse by all states, shape (6, n_states)."""
    one, place_m = pose[k : k + 1], PLACE_M[np.newaxis]
    columns, step = [], 1e-5
    for i in range(3 + state_of(NATURE).size):
        ends = []
        for sign in (step, -step):
            moved_m, nature = place_m.copy(), NATURE
            if i < 3:
                moved_m[0, i] += sign
            else:
                nature = distorted(NATURE, i - 3, sign)
            power = ground_effect(one, place_m, ARRAY, nature.permittivity)[0]
            ends.append(modelled(one, moved_m, ARRAY, nature, power)[0])
        columns.append((ends[0] - ends[1]) / (2 * step))
    return np.array(columns).T


def test_strengths_equal_the_formula() -> None:
    """Positions, pointing, widening, tilt, offsets, pattern error and ground act as in an independent formula."""
    pulses, expected = drawn_pulses(), modelled(POSE, np.tile(PLACE_M, (N, 1)), ARRAY, NATURE)
    for k in range(N):
        result, (amplitude, _, by_noise) = prediction(pulses, k)
        np.testing.assert_allclose(result.model, expected[k], rtol=1e-6)
        assert amplitude == pytest.approx(pulses.strengths[k] @ expected[k] / (expected[k] @ expected[k]), rel=1e-6)
        np.testing.assert_allclose(result.residual, pulses.strengths[k] - amplitude * expected[k], atol=1e-7)
        assert by_noise == pytest.approx(6 * 0.01**2)


def test_slopes_equal_central_differences() -> None:
    """All derivatives belong to the formula; those by position hold the coefficient of the ground wave fixed."""
    pulses = drawn_pulses()
    for k in range(N):
        result, (amplitude, _, _) = prediction(pulses, k)
        expected = amplitude * across(result.model, differences(k, POSE))
        slope = across(result.model, result.slope)
        scale = np.abs(expected).max(axis=0).clip(1e-4)
        np.testing.assert_allclose(slope / scale, expected / scale, atol=1e-5)


def test_gradient_is_that_of_the_cost() -> None:
    """With fixed errors of the pulses, also those of another state, and ground that does not reflect."""
    nature = replace(NATURE, permittivity=0.9)
    pulses, source, once = drawn_pulses(), np.zeros(N, dtype=np.intp), np.ones(N)
    data = pulses, nominal_array(ARRAY), NOISE
    at = np.concatenate([PLACE_M, state_of(nature)])
    errors = errors_at(at + np.r_[0.5, -0.3, 0.4, np.zeros(at.size - 3)], source, once, once, *data)
    gradient, step = expand(at, errors, source, *data, 6.0).gradient, 1e-6
    expected = [
        expand(at + each, errors, source, *data, 6.0).cost - expand(at - each, errors, source, *data, 6.0).cost
        for each in step * np.eye(at.size)
    ]
    np.testing.assert_allclose(gradient, np.array(expected) / (2.0 * step), rtol=1e-5, atol=1e-5)


def test_shared_errors_change_the_gradient_as_stated() -> None:
    """Errors of strengths that are otherwise as predicted, also for a pulse with a weight of its own."""
    state, weight = np.concatenate([PLACE_M, state_of(NATURE)]), np.linspace(0.5, 2.0, N)
    source, once = np.zeros(N, dtype=np.intp), np.ones(N)
    exact = np.array([prediction(drawn_pulses(), k)[0].model for k in range(N)])
    pulses = pulses_at(POSE, exact / np.linalg.norm(exact, axis=-1, keepdims=True))
    data = nominal_array(ARRAY), NOISE, 1e9
    errors = errors_at(state, source, once, once, pulses, *data[:2])._replace(weight=weight)
    scores, step = shared_scores(state, errors, source, pulses, *data), 1e-4
    for j in range(scores.shape[1]):
        change = np.array([prediction(pulses, k)[0].shared[:, j] for k in range(N)])
        ends = [
            expand(state, errors, source, pulses._replace(strengths=pulses.strengths + at * change), *data).gradient
            for at in (step, -step)
        ]
        expected = (ends[0] - ends[1]) / (2.0 * step)
        np.testing.assert_allclose(scores[:, j].sum(axis=0), expected, atol=1e-4 * np.abs(expected).max())


def test_covariance_is_that_of_pose_noise_and_ground() -> None:
    """The covariance adds errors of pose, interference, noise, and multipath, which counts more if the wave is weak."""
    pulses = drawn_pulses()._replace(weakening=np.linspace(1.0, 4.0, N))
    for k in range(N):
        result, (amplitude, shared, _) = prediction(pulses, k)
        one, place_m, change = POSE[k : k + 1], PLACE_M[np.newaxis], differences(k, POSE)
        image = gains(sights(one, image_of(place_m), ARRAY), ARRAY, NATURE)[0]
        _, coherent = ground_effect(one, place_m, ARRAY, NATURE.permittivity)
        larger = MANIFOLD.gain_factors * (1 + NATURE.errors.gain)
        ground = larger * image * coherent[0] / np.linalg.norm(sights(one, place_m, ARRAY), axis=0)[0]
        phase, ground = ground_phase(one, place_m, ARRAY)[0], ground / np.sqrt(2.0)
        turn = change[:, 13:19].sum(axis=1)  # of all boresights
        pose = [NOISE.position_m * change[:, 0], NOISE.position_m * change[:, 1], NOISE.heading_rad * turn]
        nuisance = amplitude * across(
            result.model, np.column_stack([*pose, ground * np.cos(phase), ground * np.sin(phase)])
        )
        unexplained = unexplained_error(one, PLACE_M, NOISE.unexplained * pulses.weakening[k])[0]
        own = np.square(unexplained * amplitude * result.model)
        expected = nuisance @ nuisance.T + np.diag(own + 0.01**2 + TINY_VARIANCE)
        np.testing.assert_allclose(result.covariance, expected, atol=2e-5 * expected.max())
        assert shared == pytest.approx(np.square(nuisance[:, :3]).sum() + own.sum(), rel=1e-4)
        of_shared = result.shared @ result.shared.T
        np.testing.assert_allclose(result.covariance, of_shared + (0.01**2 + TINY_VARIANCE) * np.eye(6))


def compared(pulses: PooledPulses, array: ArrayModel, state: FloatArray, uncertainty: FloatArray) -> FloatArray:
    """Return all results of `compare`, shape (n, 4)."""
    n, sight = len(pulses.pose), PLACE_M[:2] - pulses.pose[:, :2]
    azimuth, result = np.arctan2(sight[:, 1], sight[:, 0]) - pulses.pose[:, 2], np.empty((n, 4))
    compare(np.arange(n), PLACE_M, state, uncertainty, pulses, nominal_array(array), NOISE, azimuth, result)
    return result


def uncertainty_of(state: FloatArray) -> FloatArray:
    """Return the prior covariance of the states of the array, with 0.1 m of position."""
    result = np.zeros((3 + state.size,) * 2)
    result[:3, :3], result[3:, 3:] = 0.01 * np.eye(3), np.linalg.inv(array_prior(ARRAY, START).information)
    return result


def test_unusable_channel_has_no_influence() -> None:
    """A pulse without a usable channel is compared as by an array without that element."""
    pulses, state, kept = drawn_pulses(), state_of(NATURE), np.array([0, 1, 3, 4, 5])
    without = of_channels(pulses, kept)
    of_kept = np.concatenate([np.arange(4), *(4 + 6 * kind + kept for kind in range(3)), np.arange(22, state.size)])
    own = np.concatenate([np.arange(3), 3 + of_kept])
    uncertainty = uncertainty_of(state)
    expected = compared(without, ARRAY.take(kept), state[of_kept], uncertainty[np.ix_(own, own)])
    strengths, usable, variance = pulses.strengths.copy(), pulses.is_usable.copy(), pulses.variance.copy()
    strengths[:, 2], usable[:, 2], variance[:, 2] = 0.0, False, 0.0
    pulses = pulses._replace(strengths=strengths, variance=variance, is_usable=usable)
    found = compared(pulses, ARRAY, state, uncertainty)
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_slopes_are_finite_at_any_height_and_ground() -> None:
    """Nothing is singular where the elevation is zero, below the ground, or without a ground wave."""
    level, without = replace(ARRAY, positions_m=BOARDS_M), state_of(replace(NATURE, permittivity=1.0))
    for height_m in BOARDS_M[0, 2] * np.array([1.0, -1.0, -3.0]):
        place_m = np.array([3.0, 2.0, height_m])
        for state in (without, without + 1e3 * (np.arange(without.size) == GROUND)):
            predicted = prediction(drawn_pulses(), 0, level, place_m, state)[0]
            assert all(np.isfinite(column).all() for column in predicted)


@pytest.mark.parametrize("height_m", [1.5, -1.5])
def test_ground_like_air_does_not_reflect(height_m: float) -> None:
    """Strengths are those of the direct wave, also at a height below the ground, which a fit may pass through."""
    nature, place_m = replace(NATURE, permittivity=1.0), np.array([3.0, 2.0, height_m])
    direct = modelled(POSE[:1], place_m[np.newaxis], ARRAY, nature, np.zeros((1, 6)))[0]
    model = prediction(drawn_pulses(), 0, place_m=place_m, state=state_of(nature))[0].model
    np.testing.assert_allclose(model, direct, rtol=1e-6)


def test_density_integrates_to_one() -> None:
    """The density of strengths is normalised over directions of the strengths near the prediction."""
    rng, state = np.random.default_rng(3), state_of(NATURE)
    n, pose, noise = 4000, POSE[:1], 2e-3
    clean = modelled(pose, PLACE_M[np.newaxis], ARRAY, NATURE)[0]
    unit = clean / np.linalg.norm(clean)
    basis = np.linalg.svd(unit[np.newaxis])[2][1:].T
    result, _ = prediction(pulses_at(pose, unit[np.newaxis], noise), 0)
    flat = np.linalg.inv(basis.T @ result.covariance @ basis + 1e-12 * np.eye(5))
    root = 1.3 * np.linalg.cholesky(np.linalg.inv(flat))
    drawn = rng.normal(size=(n, 5))
    log_drawn = -0.5 * np.square(drawn).sum(axis=-1) - 2.5 * np.log(2 * np.pi) - np.log(np.diag(root)).sum()
    strengths = unit + drawn @ root.T @ basis.T
    pulses = pulses_at(np.repeat(pose, n, axis=0), strengths, noise)
    log_density = compared(pulses, ARRAY, state, np.zeros((3 + state.size,) * 2))[:, 0]
    ratio = np.exp(log_density - log_drawn)
    assert ratio.mean() == pytest.approx(1.0, abs=4 * ratio.std() / np.sqrt(n))
    assert ratio.std() / np.sqrt(n) < 0.02


def test_offset_of_likely_bearings_is_standard_normal() -> None:
    """With states, pose and noise drawn as believed, offsets of bearings have mean 0 and variance 1."""
    rng, state = np.random.default_rng(4), np.zeros(22 + N_TERMS)
    state[3] = np.log(GRAVEL)
    uncertainty = 0.1 * uncertainty_of(state)  # so small that the model is linear
    pose = np.repeat(POSE, 150, axis=0)
    drawn, strengths = rng.multivariate_normal(np.zeros(len(uncertainty)), uncertainty, size=len(pose)), []
    true_pose = pose + rng.normal(size=pose.shape) * [0.05, 0.05, 0.01]
    for k, own in enumerate(drawn):
        errors = ElementErrors(gain=own[7:13], pointing_rad=own[13:19], offset=own[19:25])
        nature = Nature(widening=own[3], tilt_rad=(own[4], own[5]), errors=errors, terms=own[25:])
        nature = replace(nature, permittivity=GRAVEL * np.exp(own[6]))
        one, place_m = true_pose[k : k + 1], (PLACE_M + own[:3])[np.newaxis]
        image = gains(sights(one, image_of(place_m), ARRAY), ARRAY, nature)
        phase, (cos, sin) = ground_phase(one, place_m, ARRAY), np.sqrt(0.5) * rng.normal(size=2)
        image *= MANIFOLD.gain_factors * ground_effect(one, place_m, ARRAY, nature.permittivity)[1]
        image *= cos * np.cos(phase) + sin * np.sin(phase)
        range_m = np.linalg.norm(sights(one, place_m, ARRAY), axis=0)
        clean = (modelled(one, place_m, ARRAY, nature) + image / range_m)[0]
        clean *= 1 + unexplained_error(one, PLACE_M, NOISE.unexplained)[0] * rng.normal(size=6)
        noisy = clean + 0.01 * np.linalg.norm(clean) * rng.normal(size=6)
        strengths.append(noisy / np.linalg.norm(noisy))
    offset = compared(pulses_at(pose, np.array(strengths)), ARRAY, state, uncertainty)[:, 3]
    assert offset.mean() == pytest.approx(0.0, abs=0.1)
    assert offset.std() == pytest.approx(1.0, rel=0.05)


def test_whitened_residual_is_that_of_the_best_amplitude() -> None:
    """Misfit and determinant equal those on a basis across the model, by dense matrices."""
    rng = np.random.default_rng(6)
    model, residual, slope, factor = (rng.normal(size=shape) for shape in (5, 5, (5, 3), (5, 5)))
    covariance = factor @ factor.T + 0.1 * np.eye(5)
    basis = np.linalg.svd(model[np.newaxis])[2][1:].T
    flat = basis.T @ covariance @ basis
    weight = basis @ np.linalg.solve(flat, basis.T)
    expected = residual @ weight @ residual, slope.T @ weight @ slope
    log_det = whiten(Prediction(model, residual, slope, covariance, np.empty((5, 0))))
    assert log_det == pytest.approx(np.linalg.slogdet(flat)[1])
    assert residual @ residual == pytest.approx(expected[0])
    np.testing.assert_allclose(slope.T @ slope, expected[1])
