"""Preprocessing of records keeps bearings and removes interferers."""

import numpy as np
import pytest

from dirmusic import GainManifold, band_pass, bearings_from_covariance, prepare_records, pulse_start, sample_covariance
from dirmusic.angles import difference
from pdpatrol.missions.reproduction.simulation import SAMPLE_RATE_HZ, draw_records, energy_to_noise

RING = GainManifold.ring(6)


def records(n: int, snr_db: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Draw azimuths (n,) and records (n, 6, 10 000) with one pulse each."""
    rng = np.random.default_rng(seed)
    azimuth = rng.uniform(-np.pi, np.pi, n)
    return azimuth, draw_records(RING.gain(azimuth).T, np.full(n, energy_to_noise(snr_db)), rng)


def bearings_of(windows: np.ndarray) -> np.ndarray:
    return bearings_from_covariance(sample_covariance(windows), RING).azimuth_rad


def rms_deg(errors: np.ndarray) -> float:
    return float(np.degrees(np.sqrt(np.mean(np.square(errors)))))


def test_only_a_common_scale_keeps_bearings() -> None:
    azimuth, x = records(60, 10.0, seed=1)
    windows = prepare_records(x, SAMPLE_RATE_HZ)
    assert np.abs(windows.waveforms).max(axis=(-1, -2)) == pytest.approx(1.0)
    unscaled = windows.waveforms * windows.scale_v[:, np.newaxis, np.newaxis]
    common = bearings_of(windows.waveforms)
    np.testing.assert_allclose(difference(common, bearings_of(unscaled)), 0.0, atol=1e-7)
    assert rms_deg(difference(common, azimuth)) < 1.0
    assert rms_deg(difference(bearings_of(0.5 * (windows.waveforms + 1.0)), azimuth)) > 10.0
    per_channel = windows.waveforms / np.abs(windows.waveforms).max(axis=-1, keepdims=True)
    assert rms_deg(difference(bearings_of(per_channel), azimuth)) > 45.0


def test_window_holds_the_pulse() -> None:
    rng = np.random.default_rng(3)
    x = rng.standard_normal((50, 6, 4000))
    at = rng.integers(0, 3900, 50)
    for k in range(50):
        x[k, :, at[k] : at[k] + 20] += 6.0
    start = pulse_start(x, 40)
    assert np.all((start <= at) & (start + 40 >= at + 20))
    np.testing.assert_array_equal(pulse_start(1000 * x, 40), start)


def test_interferer_outside_band_is_removed() -> None:
    azimuth, x = records(40, 10.0, seed=4)
    time_s = np.arange(x.shape[-1]) / SAMPLE_RATE_HZ
    hum = 100.0 * np.sin(2 * np.pi * 948e6 * time_s)  # that of the paper, as strong as the pulse
    with_band = prepare_records(x + hum, SAMPLE_RATE_HZ)
    without = prepare_records(x + hum, SAMPLE_RATE_HZ, band_hz=None)
    assert rms_deg(difference(bearings_of(with_band.waveforms), azimuth)) < 1.5
    assert rms_deg(difference(bearings_of(without.waveforms), azimuth)) > 10.0


def test_band_pass_has_unit_gain_and_no_delay_inside() -> None:
    time_s = np.arange(4000) / SAMPLE_RATE_HZ
    inside = np.sin(2 * np.pi * 1.7e9 * time_s)
    passed = band_pass(inside, SAMPLE_RATE_HZ, (1.2e9, 2.3e9))
    np.testing.assert_allclose(passed[1000:3000], inside[1000:3000], atol=0.02)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: prepare_records(np.ones((6, 50)), SAMPLE_RATE_HZ), "n_record >= 90"),
        (lambda: prepare_records(np.full((6, 500), np.nan), SAMPLE_RATE_HZ), "finite"),
        (lambda: prepare_records(np.ones((6, 500)), 2e9), "half the sample rate"),
        (lambda: prepare_records(np.ones((6, 500)), SAMPLE_RATE_HZ, band_hz=(2e9, 1e9)), "rise"),
    ],
)
def test_invalid_records_are_refused(call, message: str) -> None:  # noqa: ANN001
    with pytest.raises(ValueError, match=message):
        call()
