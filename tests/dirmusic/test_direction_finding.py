"""Pattern, manifold, strengths, spectrum and bearings without noise, and their published values."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from dirmusic import (
    ElementSpread,
    GaussianPattern,
    TabulatedPattern,
    bearing_bound,
    estimate_bearings,
    manifold_error_std,
    pseudo_spectrum,
    pulse_spectrum,
    pulse_start,
    sample_covariance,
)
from dirmusic.angles import aperture, circular_mean, difference, wrap
from dirmusic.array.bounds import manifold_error
from tests.dirmusic.scenes import RING, SPREAD, drawn_errors, rho, rms

AZIMUTHS = np.radians(np.arange(-179.5, 180.0, 1.0))


@given(st.floats(-1e3, 1e3))
def test_wrap_keeps_direction_in_half_open_turn(angle: float) -> None:
    wrapped = float(wrap(angle))
    assert -np.pi < wrapped <= np.pi
    assert wrap(np.pi) == wrap(-np.pi) == np.pi
    assert np.cos(wrapped) == pytest.approx(np.cos(angle), abs=1e-9)
    assert np.sin(wrapped) == pytest.approx(np.sin(angle), abs=1e-9)


def test_mean_and_aperture_across_the_cut() -> None:
    angles = np.radians([170.0, -170.0, 180.0])
    assert np.degrees(abs(circular_mean(angles))) == pytest.approx(180.0)
    assert np.degrees(aperture(angles)) == pytest.approx(20.0)
    assert aperture(angles[:1]) == 0.0


def test_gaussian_pattern_has_published_figures() -> None:
    # computed separately from eq. (1): peak 1.0058 at 207.0 deg, -3 dB width 101 deg, front to back 16.3 dB
    off = np.radians(np.arange(-180.0, 180.0, 0.05))
    gain = GaussianPattern()(off)
    assert gain.max() == pytest.approx(1.0058, abs=1e-4)
    assert abs(np.degrees(off[gain.argmax()])) < 0.1
    assert 0.05 * (gain > gain.max() / np.sqrt(2)).sum() == pytest.approx(101, abs=0.5)
    assert 20 * np.log10(gain.max() / GaussianPattern()(np.pi)) == pytest.approx(16.3, abs=0.1)


def test_gain_norm_is_flat_for_six_elements_not_for_four() -> None:
    # reference values: ||g|| flat to 0.03 dB for six; 5.4 dB for the first four of six
    of_six, of_four = (np.linalg.norm(RING.gain(AZIMUTHS)[:n], axis=0) for n in (6, 4))
    assert 20 * np.log10(of_six.max() / of_six.min()) < 0.035
    assert 20 * np.log10(of_four.max() / of_four.min()) == pytest.approx(5.4, abs=0.1)


def test_ring_starts_left_and_goes_clockwise() -> None:
    boresights = np.degrees(wrap(RING.boresights_rad))
    np.testing.assert_allclose(boresights, [90, 30, -30, -90, -150, 150], atol=1e-9)
    np.testing.assert_array_equal(RING.gain(RING.boresights_rad).argmax(axis=0), np.arange(6))


@pytest.mark.parametrize(
    ("angle", "gain"),
    [
        ([0, 2, 1, 3], np.ones(4)),
        ([0, 1, 2, np.nan], np.ones(4)),
        (range(4), [1, -1, 1, 1]),
    ],
)
def test_invalid_pattern_table_is_refused(angle: ArrayLike, gain: ArrayLike) -> None:
    with pytest.raises(ValueError, match=r"gain|off_boresight"):
        TabulatedPattern(angle, gain)


@pytest.mark.parametrize("n_elements", [4, 6])
def test_bearing_without_noise_is_exact(n_elements: int) -> None:
    manifold = RING.take(range(n_elements))
    bearings = estimate_bearings(0.3 * manifold.gain(AZIMUTHS).T[:, np.newaxis, :], manifold)
    np.testing.assert_allclose(difference(bearings.azimuth_rad, AZIMUTHS), 0.0, atol=1e-8)
    assert bearings.misfit.max() < 1e-12
    assert np.isnan(bearings.std_rad).all()


def test_zero_strengths_have_no_bearing() -> None:
    bearings = estimate_bearings(np.zeros((2, 1, 6)), RING, strength_variance=1.0)
    assert np.isnan(bearings.azimuth_rad).all()
    assert estimate_bearings(np.zeros((0, 1, 6)), RING).azimuth_rad.shape == (0,)


def test_bound_at_published_signal_levels() -> None:
    # reference values: sqrt(CRB) for N = 6 at 10, 0, -10 dB
    for snr_db, degrees in ((10, 0.138), (0, 0.438), (-10, 1.385)):
        bound = bearing_bound(RING, AZIMUTHS, rho(snr_db))
        assert np.degrees(rms(bound)) == pytest.approx(degrees, rel=0.01)


def test_array_errors_bias_bearings_as_predicted() -> None:
    errors = drawn_errors(np.random.default_rng(3), ElementSpread(gain=0.01, pointing_rad=np.radians(0.3)))
    strengths = errors.correct(RING).gain(AZIMUTHS).T
    pooled = estimate_bearings(np.repeat(strengths[:, np.newaxis], 50, axis=1), RING).azimuth_rad
    error = difference(pooled, AZIMUTHS)
    unexplained = error - manifold_error(RING, AZIMUTHS, errors)
    assert np.degrees(np.std(error)) > 0.3
    assert np.std(unexplained) < 0.2 * np.std(error)


def test_shipped_spread_causes_two_and_a_half_degrees() -> None:
    # reference value: 2.5 deg RMSE for 5 % gain and 2 deg pointing
    std = manifold_error_std(RING, AZIMUTHS, SPREAD)
    assert np.degrees(rms(std)) == pytest.approx(2.5, abs=0.1)


@pytest.mark.parametrize("n_elements", [4, 6])
def test_pulse_spectrum_equals_pseudo_spectrum(n_elements: int) -> None:
    rng, azimuths = np.random.default_rng(0), np.radians(np.arange(0.0, 360.0, 5.0))
    gain = RING.take(range(n_elements)).gain(azimuths)
    unit = gain / np.linalg.norm(gain, axis=0)
    strengths = rng.uniform(0.1, 1.0, (20, n_elements))
    closed_form = pulse_spectrum(strengths, np.tile(unit, (20, 1, 1)))
    by_subspace = [pseudo_spectrum(sample_covariance(row[:, np.newaxis]), unit) for row in strengths]
    np.testing.assert_allclose(closed_form, by_subspace, rtol=1e-9)
    assert not pulse_spectrum(np.zeros((1, n_elements)), unit[np.newaxis]).any()


def test_gate_holds_the_pulse() -> None:
    rng = np.random.default_rng(3)
    at = rng.integers(0, 3900, 50)
    since = np.arange(4000) - at[:, np.newaxis, np.newaxis]
    x = rng.standard_normal((50, 6, 4000)) + 6.0 * ((since >= 0) & (since < 20))
    start = pulse_start(x, 40)
    assert np.all((start <= at) & (start + 40 >= at + 20))
    np.testing.assert_array_equal(pulse_start(1000 * x, 40), start)
