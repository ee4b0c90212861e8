"""The built-in estimators follow their protocol, and their accuracies rank as expected."""

import numpy as np
import pytest

from dirmusic import ESTIMATORS, ArrayModel, ElementSpread, GainManifold, PulseBatch, bearings_towards, pseudo_spectrum
from dirmusic.angles import difference
from dirmusic.bearing.estimators import GRID_RAD, method_std, music, strongest
from dirmusic.bearing.maximum_likelihood import maximum_likelihood
from tests.dirmusic.scenes import detected, normalised_error_variance, rms_error

NOISE_V = 0.03


def ring(n_elements: int, n_halves: int = 0) -> ArrayModel:
    """Make a ring with the same manifold in each half sub-band."""
    manifold = GainManifold.ring(n_elements)
    positions_m, bands = np.zeros((n_elements, 3)), (manifold,) * n_halves
    return ArrayModel(manifold=manifold, positions_m=positions_m, spread=ElementSpread(), band_manifolds=bands)


def pulses_from(array: ArrayModel, azimuth_rad: np.ndarray, noise_v: float = NOISE_V) -> PulseBatch:
    """Draw a pulse of 1 V from each direction, with white noise."""
    gain = array.manifold.gain(azimuth_rad).T
    return detected(np.abs(gain + np.random.default_rng(0).normal(0.0, noise_v, gain.shape)), noise_v)


def anywhere(n: int = 4000) -> np.ndarray:
    return np.random.default_rng(1).uniform(-np.pi, np.pi, n)


@pytest.mark.parametrize("name", ESTIMATORS)
@pytest.mark.parametrize("n_elements", [4, 6, 8])
def test_error_matches_stated_deviation(name: str, n_elements: int) -> None:
    array, azimuth = ring(n_elements), anywhere()
    found = ESTIMATORS[name](pulses_from(array, azimuth), array)
    assert normalised_error_variance(found, azimuth) == pytest.approx(1.0, abs=0.25)


@pytest.mark.parametrize("n_elements", [4, 6, 8, 12])
def test_estimators_rank_likelihood_grid_strongest(n_elements: int) -> None:
    array, azimuth = ring(n_elements), anywhere()
    pulses = pulses_from(array, azimuth)
    errors = {name: rms_error(find(pulses, array), azimuth) for name, find in ESTIMATORS.items()}
    assert errors["sub_bands"] == errors["maximum_likelihood"]  # the pulses have no sub-bands to read
    assert errors["maximum_likelihood"] <= 1.001 * errors["music"]
    assert errors["music"] < 0.5 * errors["strongest"]


@pytest.mark.parametrize("name", ESTIMATORS)
@pytest.mark.parametrize("n_elements", [3, 6])  # numpy sums eight and more in another order for one row
def test_estimate_is_independent_of_other_pulses(name: str, n_elements: int) -> None:
    array, estimator = ring(n_elements), ESTIMATORS[name]
    pulses = pulses_from(array, anywhere(50))
    whole = estimator(pulses, array)
    for row in range(50):
        single = estimator(pulses.take(slice(row, row + 1)), array)
        assert [column[0] for column in single] == [column[row] for column in whole]


@pytest.mark.whole
@pytest.mark.parametrize("name", ESTIMATORS)
def test_order_of_channels_does_not_matter(name: str) -> None:
    """Renumbering the elements of array and pulses changes no direction, deviation or misfit."""
    order, array = np.array([3, 0, 5, 1, 4, 2]), ring(6, 4)
    pulses = pulses_from(array, anywhere(500))
    bands = pulses.strengths_v[:, np.newaxis] * np.array([[[0.6], [0.8]]])
    pulses = pulses._replace(band_strengths_v=bands, band_variance_v2=np.full(bands.shape, NOISE_V**2))
    estimator = ESTIMATORS[name]
    found, permuted = estimator(pulses, array), estimator(pulses.take_channels(order), array.take(order))
    np.testing.assert_allclose(difference(permuted.azimuth_rad, found.azimuth_rad), 0.0, atol=1e-9)
    np.testing.assert_allclose(permuted.std_rad, found.std_rad, rtol=1e-9)
    np.testing.assert_allclose(permuted.misfit, found.misfit, atol=1e-9)


@pytest.mark.parametrize("name", ESTIMATORS)
def test_pulse_without_strength_has_deviation_pi(name: str) -> None:
    nothing = np.zeros((1, 2, 6))
    pulses = detected(nothing[:, 0], 1e-3)._replace(band_strengths_v=nothing, band_variance_v2=nothing + 1e-6)
    found = ESTIMATORS[name](pulses, ring(6, 4))
    assert found.std_rad[0] == np.pi
    assert found.misfit[0] == 1.0
    assert np.isfinite(found.azimuth_rad).all()


def test_music_is_grid_peak_of_printed_spectrum() -> None:
    array = ring(4)  # whose gain varies in norm: normalised, the peak would lie elsewhere
    pulses = pulses_from(array, anywhere(200))
    outer = pulses.strengths_v[:, :, np.newaxis] * pulses.strengths_v[:, np.newaxis]
    printed = GRID_RAD[pseudo_spectrum(outer, array.manifold.gain(GRID_RAD)).argmax(axis=-1)]
    np.testing.assert_allclose(difference(music(pulses, array).azimuth_rad, printed), 0.0, atol=1e-12)


def test_strongest_is_nearest_boresight_and_turns_with_ring() -> None:
    array, azimuth = ring(6), anywhere(300)
    found = strongest(pulses_from(array, azimuth, 0.0), array).azimuth_rad
    off = np.abs(difference(found[:, np.newaxis], array.manifold.boresights_rad)).min(axis=-1)
    np.testing.assert_allclose(off, 0.0, atol=1e-12)
    assert np.degrees(np.abs(difference(found, azimuth))).max() < 35.0  # not 30: the pattern is not symmetric
    turned = strongest(pulses_from(array, azimuth + np.pi / 3, 0.0), array).azimuth_rad
    np.testing.assert_allclose(difference(turned, found), np.pi / 3, atol=1e-12)


def test_bearings_towards_agrees_with_maximum_likelihood() -> None:
    array = ring(6)
    pulses = pulses_from(array, anywhere(300))
    likeliest = maximum_likelihood(pulses, array)
    judged = bearings_towards(likeliest.azimuth_rad, pulses, array)
    is_same = np.isclose(judged.std_rad, likeliest.std_rad, rtol=1e-3)
    assert is_same.mean() > 0.99  # slopes differ at the pattern's step, 153 degrees off boresight
    np.testing.assert_allclose(judged.misfit, likeliest.misfit, atol=1e-4)  # its last step is not looked up again


def test_method_std_is_deviation_without_noise() -> None:
    assert method_std(maximum_likelihood, ring(6)).max() == 0.0
    assert np.degrees(method_std(music, ring(6))).max() == pytest.approx(1 / np.sqrt(12))
    assert np.degrees(method_std(strongest, ring(6))).mean() == pytest.approx(60 / np.sqrt(12), rel=0.03)
