"""Errors of the estimators compared with the Cramer-Rao bound and with the deviations that they state."""

from dataclasses import replace

import numpy as np
import pytest

from dirmusic import (
    ArrayModel,
    Bearings,
    ElementSpread,
    UniformOffsets,
    bearing_bound,
    bearings_from_covariance,
    estimate_bearings,
    manifold_error_std,
    pseudo_spectrum,
    pulse_strengths,
    sample_covariance,
    source_count,
    spectrum_peaks,
    strength_variance,
)
from dirmusic.angles import difference
from dirmusic.array.element_errors import EstimatedErrors
from dirmusic.array.manifold import SEARCH_AZIMUTHS_RAD
from pdpatrol.missions.reproduction.simulation import SAMPLE_RATE_HZ
from pdpatrol.sensing.nature.pulses import damped_pulse, unit_pulse_energy
from pdpatrol.sensing.quantities import SPEED_OF_LIGHT_MPS
from tests.dirmusic.scenes import RING, drawn_errors, normalised_error_variance, rho, rms, rms_error

GRID = np.radians(np.arange(360.0))


def gates_of(
    azimuth: np.ndarray, snr_db: float, rng: np.random.Generator, *, radius_m: float = 0.0, n_samples: int = 60
) -> np.ndarray:
    """Draw gates (n, 6, n_samples) of plane waves in unit noise, with a few samples before the pulse."""
    ahead_m = radius_m * np.cos(RING.boresights_rad[:, np.newaxis] - azimuth)
    delay_s = (ahead_m.max(axis=0) - ahead_m).T / SPEED_OF_LIGHT_MPS
    n_before = 2 if n_samples < 100 else 10
    since_s = (np.arange(n_samples) - n_before - rng.random((azimuth.size, 1, 1))) / SAMPLE_RATE_HZ
    pulse = np.sqrt(rho(snr_db) / unit_pulse_energy(SAMPLE_RATE_HZ)) * damped_pulse(since_s - delay_s[..., np.newaxis])
    return RING.gain(azimuth).T[..., np.newaxis] * pulse + rng.standard_normal((azimuth.size, 6, n_samples))


def plane_waves(n: int, snr_db: float, rng: np.random.Generator, **ring: float) -> tuple[np.ndarray, np.ndarray]:
    """Draw azimuths (n,) and gates (n, 6, n_samples) of a ring; see `gates_of`."""
    azimuth = rng.uniform(-np.pi, np.pi, n)
    return azimuth, gates_of(azimuth, snr_db, rng, **ring)  # pyright: ignore[reportArgumentType]


def states_its_error(bearings: Bearings, azimuth: np.ndarray, tolerance: float = 0.2) -> bool:
    """Return True if errors agree with the stated deviations."""
    return normalised_error_variance(bearings, azimuth) == pytest.approx(1.0, abs=tolerance)


@pytest.mark.parametrize(("snr_db", "most"), [(10, 1.05), (0, 1.05), (-5, 1.05), (-10, 1.05), (-15, 1.05), (-20, 1.10)])
def test_covariance_of_gate_reaches_bound(snr_db: int, most: float) -> None:
    azimuth, gates = plane_waves(8000, snr_db, np.random.default_rng(snr_db + 40))
    bearings = bearings_from_covariance(sample_covariance(gates), RING, n_snapshots=60, noise_variance=1.0)
    bound = bearing_bound(RING, azimuth, rho(snr_db))
    assert 0.97 < rms_error(bearings, azimuth) / rms(bound) <= most
    assert states_its_error(bearings, azimuth, 0.1)


def test_pooling_twenty_pulses_reaches_one_degree() -> None:
    rng = np.random.default_rng(7)
    azimuth = rng.uniform(-np.pi, np.pi, 1500)
    pooled = np.mean([sample_covariance(gates_of(azimuth, -20, rng)) for _ in range(20)], axis=0)
    bearings = bearings_from_covariance(pooled, RING, n_snapshots=1200, noise_variance=1.0)
    assert np.degrees(rms_error(bearings, azimuth)) <= 1.1
    assert states_its_error(bearings, azimuth)


@pytest.mark.parametrize("snr_db", [10, 0, -10])
def test_strengths_reach_bound_for_any_ring_radius(snr_db: int) -> None:
    alone = None
    for radius_m in (0.0, 0.05, 0.12, 0.20):
        rng = np.random.default_rng(snr_db + 60)
        azimuth, gates = plane_waves(5000, snr_db, rng, radius_m=radius_m, n_samples=90)
        strengths = pulse_strengths(gates, 1.0)
        variance = strength_variance(strengths, 1.0, 90)
        bearings = estimate_bearings(strengths[:, np.newaxis], RING, strength_variance=variance[:, np.newaxis])
        error = rms_error(bearings, azimuth)
        alone = alone or error
        assert error == pytest.approx(alone, rel=0.10)
        assert error <= 1.15 * rms(bearing_bound(RING, azimuth, rho(snr_db)))
        assert states_its_error(bearings, azimuth)
    # reference value: bearings from X X^T are off by 58 deg at 0.20 m
    assert np.degrees(rms_error(bearings_from_covariance(sample_covariance(gates), RING), azimuth)) > 20.0


def test_subset_of_elements_reaches_its_bound() -> None:
    rng = np.random.default_rng(5)
    for elements in ([0, 1, 2, 3], [1, 3, 5], [0, 2, 3, 4, 5]):
        manifold, azimuth = RING.take(elements), np.repeat(np.radians([-60.0, -20.0, 0.0, 45.0, 70.0]), 2000)
        strengths = np.sqrt(rho(10)) * manifold.gain(azimuth) + rng.standard_normal((len(elements), azimuth.size))
        bearings = estimate_bearings(np.abs(strengths).T[:, np.newaxis], manifold, strength_variance=1.0)
        bound = bearing_bound(manifold, azimuth, rho(10))
        assert rms_error(bearings, azimuth) == pytest.approx(rms(bound), rel=0.1)
        assert states_its_error(bearings, azimuth)


@pytest.mark.parametrize("snr_db", [10, -10])
def test_prior_on_offsets_corrects_deviation_and_bearing(snr_db: int) -> None:
    rng = np.random.default_rng(6)
    azimuth = rng.uniform(-np.pi, np.pi, 1500)
    gain = RING.gain(azimuth).T + rng.uniform(-0.1, 0.1, (1500, 6))
    pulses = np.abs(np.sqrt(rho(snr_db)) * gain + rng.standard_normal((1500, 6)))[:, np.newaxis]
    plain = estimate_bearings(pulses, RING, strength_variance=1.0)
    assert normalised_error_variance(plain, azimuth) > 5.0  # 4 deg of error, stated as 0.1 to 1.4
    for prior in (UniformOffsets(half_width=0.1), ElementSpread(offset=0.1 / np.sqrt(3))):
        bayes = estimate_bearings(pulses, RING, strength_variance=1.0, prior=prior)
        assert states_its_error(bayes, azimuth)
        # a normal prior of equal spread is nearly least squares; the box prior improves the bearing
        most = 0.975 if isinstance(prior, UniformOffsets) else 1.01
        assert rms_error(bayes, azimuth) < most * rms_error(plain, azimuth)


def test_array_bearing_std_decreases_with_known_errors() -> None:
    spread = ElementSpread(gain=0.05, pointing_rad=0.03, offset=0.02, pattern=0.01)
    array = ArrayModel(manifold=RING, positions_m=np.zeros((6, 3)), spread=spread)
    assert array.bearing_std_rad == pytest.approx(rms(manifold_error_std(RING, SEARCH_AZIMUTHS_RAD, spread)))
    known = replace(array, errors=EstimatedErrors.of_spread(ElementSpread(gain=0.01, pointing_rad=0.006), 6))
    of_pattern = rms(manifold_error_std(RING, SEARCH_AZIMUTHS_RAD, ElementSpread(pattern=0.01)))
    assert of_pattern < known.bearing_std_rad < 0.5 * array.bearing_std_rad


def test_pooling_averages_noise_but_not_manifold_error() -> None:
    prior = ElementSpread(offset=0.05)
    strengths = np.abs(np.sqrt(rho(-20)) * RING.gain(0.4) + np.random.default_rng(9).standard_normal((400, 6)))
    few, many = (
        estimate_bearings(pooled, RING, strength_variance=1.0, prior=prior).std_rad
        for pooled in (strengths[:1], strengths)
    )
    floor = manifold_error_std(RING, 0.4, prior)
    assert few > 1.1 * floor
    assert many == pytest.approx(floor, rel=0.05)


def test_channel_of_zeros_is_nan_and_refused_by_name() -> None:
    _, gates = plane_waves(5, 10, np.random.default_rng(14))
    gates[:, 3] = 0.0
    strengths = pulse_strengths(gates, 1.0)
    assert np.isnan(strengths[:, 3]).all()
    assert np.isfinite(np.delete(strengths, 3, axis=1)).all()
    with pytest.raises(ValueError, match="channels 4"):
        estimate_bearings(strengths[:, np.newaxis], RING)
    assert not pulse_strengths(np.zeros((6, 60)), 1.0).any()  # no signal in any channel is not a fault


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: bearings_from_covariance(np.eye(5), RING), r"\(\.\.\., 6, 6\)"),
        (lambda: bearings_from_covariance(np.full((6, 6), np.nan), RING), "finite"),
        (lambda: bearings_from_covariance(np.eye(6), RING, n_snapshots=0), "n_snapshots"),
        (lambda: source_count(np.eye(6), 5), "n_snapshots"),
        (lambda: ElementSpread(gain=-0.1), "gain"),
        (lambda: UniformOffsets(half_width=0.0), "half_width"),
        (lambda: estimate_bearings(np.ones((1, 5)), RING), "strengths"),
        (lambda: estimate_bearings(np.full((1, 6), np.inf), RING), "strengths"),
        (lambda: estimate_bearings(-np.ones((1, 6)), RING), "strengths"),
        (lambda: pseudo_spectrum(np.eye(6), RING.gain(GRID), 6), "n_sources"),
        (lambda: pseudo_spectrum(np.eye(6), RING.gain(GRID)[:4]), r"\(6, n_angles\)"),
        (lambda: pulse_strengths(np.full((6, 60), np.nan), 1.0), "finite"),
        (lambda: pulse_strengths(np.ones((6, 60)), -1.0), "noise_variance"),
        (lambda: sample_covariance(np.full((6, 60), np.nan)), "finite"),
        (lambda: spectrum_peaks(np.ones(180), GRID[:180], 1), "over one turn"),
    ],
)
def test_invalid_arguments_are_refused(call, message: str) -> None:  # noqa: ANN001
    with pytest.raises(ValueError, match=message):
        call()


def test_posterior_equals_quadrature_over_amplitude() -> None:
    # x_i ~ N(alpha g_i, (alpha s)^2) with a scale-free prior d alpha / alpha, summed on a separate fine grid
    spread, true = 0.12, 0.35
    manifold = RING.take([0, 1, 2, 3])
    x = np.abs(7.0 * (manifold.gain(true) + spread * np.random.default_rng(15).standard_normal(4)))
    azimuth = true + np.radians(np.linspace(-60, 60, 961))
    alpha = 7.0 * np.exp(np.linspace(-1.2, 1.2, 401))[:, np.newaxis]
    off = (x[:, np.newaxis, np.newaxis] / alpha - manifold.gain(azimuth)[:, np.newaxis]) / spread
    log_density = -0.5 * np.square(off).sum(axis=0) - 4 * np.log(alpha)  # steps of log alpha are d alpha / alpha
    weight = np.exp(log_density - log_density.max()).sum(axis=0)
    weight /= weight.sum()
    mean = (weight * azimuth).sum()
    std = np.sqrt((weight * np.square(azimuth - mean)).sum())
    posterior = estimate_bearings(x[np.newaxis], manifold, prior=ElementSpread(offset=spread))
    assert difference(posterior.azimuth_rad, mean) == pytest.approx(0.0, abs=0.005 * std)
    assert posterior.std_rad == pytest.approx(std, rel=0.005)


def test_subset_of_corrected_manifold_keeps_corrections() -> None:
    rng = np.random.default_rng(16)
    errors = replace(drawn_errors(rng), offset=rng.uniform(-0.05, 0.05, 6))
    corrected = errors.correct(RING)
    for elements in (np.array([False, True, True, False, True, False]), [4, 1, 2]):
        np.testing.assert_array_equal(corrected.take(elements).gain(GRID), corrected.gain(GRID)[elements])
    np.testing.assert_allclose(
        corrected.gain(GRID)[3], (1 + errors.gain[3]) * RING.gain(GRID - errors.pointing_rad[3])[3] + errors.offset[3]
    )
