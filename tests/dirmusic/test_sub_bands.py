"""Strengths in sub-bands, and bearings from them."""

import numpy as np
import pytest
from scipy.linalg import toeplitz

from dirmusic import ESTIMATORS, ArrayModel, ElementSpread, GainManifold, strength_variance
from dirmusic.angles import difference
from dirmusic.array.bounds import bearing_bound
from dirmusic.array.pattern import GainPattern, TabulatedPattern
from dirmusic.array.spatial_pattern import halves
from dirmusic.arrays import FloatArray
from dirmusic.bearing.sub_bands import SubBands
from tests.dirmusic.scenes import detected, rms, rms_error

RATE_HZ, N = 20e9, 120
EDGES_HZ = [1.4e9, 1.6e9, 1.9e9, 2.2e9]
OFF = np.radians(np.arange(0.0, 360.0, 5.0))


def beam(sharpness: float) -> GainPattern:
    return TabulatedPattern(OFF, 0.1 + np.exp(sharpness * (np.cos(OFF) - 1.0)) * (1.0 + 0.1 * np.sin(OFF)))


ARRAY = ArrayModel(
    manifold=GainManifold.ring(6, beam(1.1)),
    positions_m=np.zeros((6, 3)),
    spread=ElementSpread(),
    band_manifolds=tuple(GainManifold.ring(6, beam(sharpness)) for sharpness in (0.6, 0.8, 1.0, 1.2, 1.4, 1.6)),
)
"""Ring whose beams have a different sharpness in each half sub-band, and the mean pattern in the full band."""


def test_band_energies_sum_to_gate_energy() -> None:
    bands = SubBands(np.linspace(0.0, 0.5 * RATE_HZ, 9), RATE_HZ, N, np.ones(1))
    gate = np.random.default_rng(0).normal(size=(N, 15))
    energy = np.square(bands.lines @ gate).sum(axis=(0, 1))
    np.testing.assert_allclose(energy, np.square(gate).sum(axis=0), rtol=0.02)


@pytest.mark.parametrize("noise_correlation", [0.0, 0.6])
def test_noise_energies_have_stated_mean_and_variance(noise_correlation: float) -> None:
    correlation = np.power(noise_correlation, np.arange(N), dtype=np.float64)
    bands = SubBands(EDGES_HZ, RATE_HZ, N, correlation)
    drawn = np.linalg.cholesky(toeplitz(correlation)) @ np.random.default_rng(1).normal(size=(N, 20_000))
    energy = np.square(bands.lines @ drawn).sum(axis=1)
    np.testing.assert_allclose(energy.mean(axis=1), bands.noise_samples, rtol=0.02)
    np.testing.assert_allclose(energy.var(axis=1), 2 * bands.energy_spread, rtol=0.08)


def test_band_strengths_have_stated_variance() -> None:
    bands, rng = SubBands(EDGES_HZ, RATE_HZ, N, np.ones(1)), np.random.default_rng(2)
    time_s = np.arange(N) / RATE_HZ
    pulse = 30.0 * np.exp(-(((time_s - 3e-9) / 0.5e-9) ** 2)) * np.sin(2 * np.pi * 1.75e9 * time_s)
    energy = np.square(bands.lines @ (pulse + rng.normal(size=(20_000, N))).T).sum(axis=1)
    strengths = np.sqrt(np.maximum(energy - bands.noise_samples[:, np.newaxis], 0.0))
    for strength, spread, on_pulse in zip(strengths, bands.energy_spread, bands.noise_on(pulse), strict=True):
        stated = strength_variance(strength.mean(), 1.0, 1, energy_spread=spread, noise_on_pulse=on_pulse)
        assert strength.var() == pytest.approx(float(stated), rel=0.06)


def strengths_of(azimuth_rad: FloatArray, spectrum: list[float]) -> FloatArray:
    """Compute strengths (n, n_bands, n_elements) for powers (2 n_bands,) in the half sub-bands."""
    gains = [manifold.gain(azimuth_rad).T for manifold in ARRAY.band_manifolds]
    power = [of_half * np.square(gain) for of_half, gain in zip(spectrum, gains, strict=True)]
    return np.sqrt(np.stack([low + high for low, high in zip(power[::2], power[1::2], strict=True)], axis=1))


@pytest.mark.parametrize(
    "spectrum",
    [[1.0] * 6, [1.0, 1.2, 1.5, 1.8, 2.2, 2.7], [4.0, 3.3, 2.6, 2.0, 1.6, 1.3]],
    ids=["flat", "rises", "falls"],
)
def test_sub_bands_are_exact_for_any_smooth_spectrum(spectrum: list[float]) -> None:
    azimuth = np.random.default_rng(3).uniform(-np.pi, np.pi, 300)
    bands = strengths_of(azimuth, spectrum)
    whole = np.sqrt(np.square(bands).sum(axis=1))
    pulses = detected(whole, 1e-6)._replace(band_strengths_v=bands, band_variance_v2=np.full_like(bands, 1e-12))
    errors = {
        name: np.degrees(rms_error(ESTIMATORS[name](pulses, ARRAY), azimuth))
        for name in ("sub_bands", "maximum_likelihood")
    }
    assert errors["sub_bands"] < 0.05
    assert errors["maximum_likelihood"] > 4 * errors["sub_bands"]


def test_sub_bands_reach_bound_with_stated_deviation() -> None:
    rng = np.random.default_rng(4)
    azimuth = rng.uniform(-np.pi, np.pi, 4000)
    bands = 40.0 * strengths_of(azimuth, [1.0] * 6)
    noisy = bands + rng.normal(size=bands.shape)
    pulses = detected(noisy[:, 0], 1.0)._replace(band_strengths_v=noisy, band_variance_v2=np.ones_like(noisy))
    found = ESTIMATORS["sub_bands"](pulses, ARRAY)
    error = difference(found.azimuth_rad, azimuth)
    middles = [GainManifold.ring(6, _mean(pair)) for pair in zip(*[iter(ARRAY.band_manifolds)] * 2, strict=True)]
    of_bands = [bearing_bound(manifold, azimuth, 2 * 40.0**2) for manifold in middles]
    limit = np.sum(np.power(of_bands, -2.0), axis=0) ** -0.5  # the amplitude of each band is unknown
    assert rms(error / limit) == pytest.approx(1.0, abs=0.04)
    assert rms(error / found.std_rad) == pytest.approx(1.0, abs=0.04)
    assert found.misfit.min() >= 0.0


def _mean(pair: tuple[GainManifold, ...]) -> GainPattern:
    return TabulatedPattern(OFF, np.sqrt(np.mean([np.square(each.pattern(OFF)) for each in pair], axis=0)))


def test_halves_divide_each_sub_band() -> None:
    assert halves([1.0, 2.0, 4.0]) == [(1.0, 1.5), (1.5, 2.0), (2.0, 3.0), (3.0, 4.0)]
