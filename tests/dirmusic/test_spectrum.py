"""Pseudo-spectra, their peaks, and the number of sources."""

import numpy as np
import pytest

from dirmusic import pseudo_spectrum, source_count, spectrum_peaks
from dirmusic.angles import difference
from pdpatrol.missions.reproduction.simulation import draw_covariances, wishart
from tests.dirmusic.scenes import RING, rho

GRID = np.radians(np.arange(360.0))


def test_two_sources_40_degrees_apart_are_resolved() -> None:
    """Covariances of full records with one pulse from each source, at different times."""
    rng = np.random.default_rng(10)
    azimuth = rng.uniform(-np.pi, np.pi, (3600, 1)) + np.radians([0.0, 40.0])
    signal = np.sqrt(rho(0.0)) * np.moveaxis(RING.gain(azimuth), 0, 1)
    covariance = draw_covariances(signal, 10_000, rng)
    assert np.mean(source_count(covariance, 10_000) == 2) >= 0.99
    peaks = spectrum_peaks(pseudo_spectrum(covariance, RING.gain(GRID), n_sources=2), GRID, 2)
    off = np.abs(difference(peaks[:, :, np.newaxis], azimuth[:, np.newaxis, :])) < np.radians(5.0)
    both = (off[:, 0, 0] & off[:, 1, 1]) | (off[:, 0, 1] & off[:, 1, 0])
    assert both.mean() >= 0.97


@pytest.mark.parametrize("snr_db", [10, 0, -10, -15])
def test_source_count_of_one_and_of_none(snr_db: int) -> None:
    rng = np.random.default_rng(snr_db + 70)
    n = 3600
    signal = np.sqrt(rho(snr_db)) * RING.gain(rng.uniform(-np.pi, np.pi, n)).T
    record = draw_covariances(signal[:, :, np.newaxis], 10_000, rng)
    assert np.mean(source_count(record, 10_000) == 1) >= 0.99
    assert np.mean(source_count(wishart(n, 6, 10_000, rng) / 10_000, 10_000) == 0) >= 0.99


def test_peaks_are_refined_between_grid_angles_and_missing_ones_nan() -> None:
    true_deg = np.array([10.3, 40.0, 77.8, 200.45])
    gain = RING.gain(np.radians(true_deg)).T
    covariance = gain[:, :, np.newaxis] * gain[:, np.newaxis, :]
    peaks = spectrum_peaks(pseudo_spectrum(covariance, RING.gain(GRID)), GRID, 4)
    off_deg = np.degrees(difference(peaks[:, 0], np.radians(true_deg)))
    assert (np.abs(off_deg) < [0.02, 0.01, 0.02, 0.02]).all()
    assert np.isnan(peaks[:, -1]).all()
