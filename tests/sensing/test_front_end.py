"""Response of the band-pass filter to noise and pulses, and comparison of the receiver with an independent one."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfilt, sosfreqz
from scipy.stats import ks_2samp

from dirmusic import estimate_bearings, pulse_strengths
from dirmusic.angles import difference
from dirmusic.arrays import FloatArray
from pdpatrol.sensing import (
    ArrayConfig,
    DischargeSource,
    HelicalArray,
    ReceiverConfig,
    Scene,
    Surroundings,
    level_transform,
)
from pdpatrol.sensing.nature.pulses import damped_pulse
from pdpatrol.sensing.radio.materials import GRAVEL
from pdpatrol.sensing.receiver.bank import listen_once
from pdpatrol.sensing.receiver.front_end import FILTER_ORDER, FrontEnd
from pdpatrol.sensing.receiver.receiver import Receiver
from tests.sensing import reference_receiver
from tests.sensing.listening import arrivals_of, noise_of
from tests.sensing.scenes import wall_face

N_SHOTS, N_PLAIN = 20_000, 600
RATE_HZ, BAND_HZ = 20e9, (1.4e9, 2.2e9)
FILTERED = FrontEnd(RATE_HZ, BAND_HZ, 90)
WHITE = FrontEnd(RATE_HZ, "all", 90)
SECTIONS = butter(FILTER_ORDER, BAND_HZ, btype="bandpass", fs=RATE_HZ, output="sos")
REAL = HelicalArray.draw(ArrayConfig(), np.random.default_rng(3))


def test_noise_power_matches_frequency_response() -> None:
    frequency_hz, response = sosfreqz(SECTIONS, worN=1 << 16, fs=RATE_HZ)
    by_theory = np.trapezoid(np.square(np.abs(response)), frequency_hz) / (0.5 * RATE_HZ)
    drawn = noise_of(FILTERED, 400, 20_000).var()
    assert FILTERED.noise_power == pytest.approx(by_theory, rel=1e-3)
    assert drawn == pytest.approx(by_theory, rel=0.01)


def test_noise_is_stationary_from_first_sample() -> None:
    noise = noise_of(FILTERED, 100_000, 40)
    np.testing.assert_allclose(noise.var(axis=0), FILTERED.noise_power, rtol=0.03)
    by_lag = (noise[:, :1] * noise).mean(axis=0) / FILTERED.noise_power
    np.testing.assert_allclose(by_lag, FILTERED.correlation[:40], atol=0.015)


def test_tabulated_pulse_matches_filter_between_samples() -> None:
    for late in (0.0, 3.37, 7.9):
        at: FloatArray = np.arange(400.0) - late
        np.testing.assert_allclose(FILTERED.pulse(at), sosfilt(SECTIONS, damped_pulse(at / RATE_HZ)), atol=2e-3)
        np.testing.assert_allclose(WHITE.pulse(at), damped_pulse(at / RATE_HZ), atol=2e-3)
    assert not FILTERED.pulse(np.array([-5.0, -1.0, 1e6])).any()


def test_tone_response_at_edge_and_interferer() -> None:
    frequency_hz, response = sosfreqz(SECTIONS, worN=[948e6, 1.4e9, 1.75e9], fs=RATE_HZ)
    for f, h in zip(frequency_hz, np.abs(response), strict=True):
        assert FILTERED.response(f) == pytest.approx(h, rel=1e-2, abs=1e-6)
    assert 20 * np.log10(FILTERED.response(1.4e9)) == pytest.approx(-3.0, abs=0.1)
    assert 20 * np.log10(FILTERED.response(948e6)) < -50
    assert WHITE.response(948e6) == pytest.approx(1.0)


@pytest.mark.parametrize(
    "scene_number", [1, *(pytest.param(number, marks=pytest.mark.whole) for number in (0, *range(2, 20)))]
)
def test_detections_match_reference_receiver(scene_number: int) -> None:
    """Compare rate, strengths and bearings near the trigger level, in scenes with reflections."""
    rng = np.random.default_rng(scene_number)
    wall_m, azimuth = rng.uniform(1.0, 6.0), rng.uniform(-np.pi, np.pi)
    turn = level_transform(np.array([0.0, 0.0, azimuth]))[:3, :3]
    wall = wall_face(turn @ [-wall_m, 0.0, 2.0], (turn[0, 0], turn[1, 0]), (20.0, 4.0))
    around = Surroundings(wall, GRAVEL)
    at_m = turn @ [rng.uniform(3.0, 12.0), rng.uniform(-3.0, 3.0), rng.uniform(0.3, 3.0)]
    config = ReceiverConfig(false_alarm_rate_hz=1e-3)
    source = DischargeSource(name="s", position_m=at_m, amplitude_v=1.0, pulse_rate_hz=1e4, n_shots=1)
    arrivals = arrivals_of(Scene([source], around), REAL, np.eye(4))
    receiver = Receiver(config, 6)
    level_db = rng.uniform(-6.0, 6.0)
    strongest = float(arrivals.peak.max()) * receiver.front_end.pulse_peak
    source = replace(source, amplitude_v=receiver.threshold_v * 10 ** (level_db / 20) / strongest, n_shots=N_SHOTS)
    scene = Scene([source], around)
    delay_s, amplitude = arrivals.delay_s, arrivals.amplitude[:, :, 0]
    plain = reference_receiver.sample(delay_s, amplitude, source.amplitude_v, REAL.aperture_m, 1e-3, N_PLAIN, rng)
    detected = listen_once(config, REAL, scene, rng, world_from_array=np.eye(4), duration_s=N_SHOTS / 1e4)
    share, expected = detected.pulses.n_pulses / N_SHOTS, len(plain.gates_v) / N_PLAIN
    assert detected.n_rejected == plain.n_bursts == 0
    assert share == pytest.approx(expected, abs=0.02 + 3 * np.sqrt(0.25 / N_PLAIN))
    if len(plain.gates_v) < 100:
        return
    strengths = pulse_strengths(plain.gates_v, noise_variance=reference_receiver.noise_variance_v2())
    for k in range(6):
        assert ks_2samp(strengths[:, k], detected.pulses.strengths_v[:, k]).pvalue > 1e-4
    spreads = [
        np.std(
            difference(estimate_bearings(x[:, np.newaxis], REAL.manifold()).azimuth_rad, np.arctan2(at_m[1], at_m[0]))
        )
        for x in (strengths, detected.pulses.strengths_v)
    ]
    assert spreads[0] == pytest.approx(spreads[1], rel=0.05 + 3 / np.sqrt(2 * len(strengths)))
