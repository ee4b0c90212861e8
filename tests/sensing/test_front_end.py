"""The band-pass: what it makes of noise and pulse; and the exact law of a gate's energy behind it."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import butter, sosfilt, sosfreqz
from scipy.stats import ks_2samp

from dirmusic import estimate_bearings
from dirmusic.angles import difference
from sensing import (
    ArrayConfig,
    Detections,
    DischargeSource,
    Faces,
    HelicalArray,
    Obstacles,
    ReceiverConfig,
    Scene,
    Surroundings,
    level_transform,
)
from sensing.nature.pulse_shape import damped_pulse, unit_pulse_energy
from sensing.receiver.bank import listen_once
from sensing.receiver.front_end import FILTER_ORDER, FrontEnd

FloatArray = NDArray[np.float64]
RATE_HZ, BAND_HZ = 20e9, (1.4e9, 2.2e9)
FILTERED = FrontEnd(RATE_HZ, BAND_HZ, 90)
WHITE = FrontEnd(RATE_HZ, None, 90)
REAL = HelicalArray.draw(ArrayConfig(), np.random.default_rng(3))


def test_noise_power_behind_the_filter_is_that_of_its_frequency_response() -> None:
    sections = butter(FILTER_ORDER, BAND_HZ, btype="bandpass", fs=RATE_HZ, output="sos")
    frequency_hz, response = sosfreqz(sections, worN=1 << 16, fs=RATE_HZ)
    by_theory = np.trapezoid(np.square(np.abs(response)), frequency_hz) / (0.5 * RATE_HZ)
    drawn = FILTERED.noise(np.random.default_rng(0), (400, 20_000)).var()
    assert FILTERED.noise_power == pytest.approx(by_theory, rel=1e-3)
    assert drawn == pytest.approx(by_theory, rel=0.01)


def test_noise_is_settled_from_its_first_sample_on_and_correlated_as_said() -> None:
    noise = FILTERED.noise(np.random.default_rng(1), (100_000, 40))
    np.testing.assert_allclose(noise.var(axis=0), FILTERED.noise_power, rtol=0.03)
    by_lag = (noise[:, :1] * noise).mean(axis=0) / FILTERED.noise_power
    np.testing.assert_allclose(by_lag, FILTERED.correlation[:40], atol=0.015)


def test_the_tabulated_pulse_is_the_filtered_pulse_at_any_fraction_of_a_sample() -> None:
    sections = butter(FILTER_ORDER, BAND_HZ, btype="bandpass", fs=RATE_HZ, output="sos")
    for late in (0.0, 3.37, 7.9):
        at: FloatArray = np.arange(400.0) - late
        np.testing.assert_allclose(FILTERED.pulse(at), sosfilt(sections, damped_pulse(at / RATE_HZ)), atol=2e-3)
        np.testing.assert_allclose(WHITE.pulse(at), damped_pulse(at / RATE_HZ), atol=2e-3)
    assert not FILTERED.pulse(np.array([-5.0, -1.0, 1e6])).any()


def test_the_response_to_a_tone_is_the_filters() -> None:
    sections = butter(FILTER_ORDER, BAND_HZ, btype="bandpass", fs=RATE_HZ, output="sos")
    frequency_hz, response = sosfreqz(sections, worN=[948e6, 1.4e9, 1.75e9], fs=RATE_HZ)
    for f, h in zip(frequency_hz, np.abs(response), strict=True):
        assert FILTERED.response(f) == pytest.approx(h, rel=1e-2, abs=1e-6)
    assert 20 * np.log10(FILTERED.response(1.4e9)) == pytest.approx(-3.0, abs=0.1)
    assert 20 * np.log10(FILTERED.response(948e6)) < -50
    assert WHITE.response(948e6) == pytest.approx(1.0)


def test_modes_hold_the_energy_of_the_noise_of_a_gate() -> None:
    modes = FILTERED.modes
    assert modes is not None
    assert 10 <= modes[0].size <= 20
    assert modes[0].sum() == pytest.approx(90, rel=1e-3)
    assert np.square(modes[0]).sum() == pytest.approx(FILTERED.energy_spread, rel=1e-3)
    np.testing.assert_allclose(modes[1].T @ modes[1], np.eye(modes[0].size), atol=1e-9)
    assert WHITE.modes is None
    assert WHITE.energy_spread == 90
    assert WHITE.noise_on_pulse == pytest.approx(1.0)


def test_two_paths_interfere_as_their_sum_says() -> None:
    """Strengths against the closed form: a direct pulse and one from the ground, some samples later."""
    element = HelicalArray.nominal(ArrayConfig())
    energies: list[float] = []
    expected: list[float] = []
    for distance in (3.0, 5.0, 8.0, 12.0):
        source = DischargeSource(
            name="s", position_m=np.array([distance, 0.0, 1.5]), amplitude_v=1.0, pulse_rate_hz=1e3, n_shots=1
        )
        config = ReceiverConfig(
            fidelity="energy", noise_v=1e-9, trigger_jitter=False, false_alarm_rate_hz=1e-9, band_hz="all"
        )
        scene = Scene([source], Surroundings(ground(), np.array([-0.5]), np.empty(0), Obstacles.none()))
        rng = np.random.default_rng(0)
        detected = listen_once(config, element, scene, rng, world_from_array=np.eye(4), duration_s=0.1)
        gate_s = np.arange(90) / RATE_HZ
        for k, (x, y, z) in enumerate(element.positions_m):
            direct, mirrored = (np.sqrt((distance - x) ** 2 + y**2 + (1.5 + sign * z) ** 2) for sign in (-1, 1))
            azimuth = np.arctan2(-y, distance - x)
            gains = [
                element.gain(np.full(6, azimuth), np.full(6, np.arctan2(up, np.hypot(distance - x, y))))[k]
                for up in (1.5 - z, -1.5 - z)
            ]
            nearest = min(np.hypot(np.hypot(distance - a, b), 1.5 - c) for a, b, c in element.positions_m)
            since_s = gate_s + nearest / 299_792_458.0 + (WHITE.pulse_lag - 20) / RATE_HZ
            both = gains[0] / direct * damped_pulse(since_s - direct / 299_792_458.0)
            both -= 0.5 * gains[1] / mirrored * damped_pulse(since_s - mirrored / 299_792_458.0)
            expected.append(float(np.square(both).sum()))
            energies.append(float(detected.pulses.strengths_v[0, k] ** 2))
    np.testing.assert_allclose(energies, expected, rtol=2e-3)


def ground() -> Faces:
    return Faces(np.zeros((1, 3)), np.eye(3)[2:], np.eye(3)[np.newaxis, :2], np.full((1, 2), np.inf), np.array([-1]))


def ground_and_wall() -> Faces:
    """The ground, and a wall half a metre behind the array: its reflection comes within the gate."""
    wall = Faces(
        np.array([[-0.5, 0.0, 2.0]]), np.eye(3)[:1], np.eye(3)[np.newaxis, 1:], np.array([[5.0, 2.0]]), np.array([0])
    )
    return Faces(
        np.concatenate([ground().centre_m, wall.centre_m]),
        np.concatenate([ground().normal, wall.normal]),
        np.concatenate([ground().axes, wall.axes]),
        np.concatenate([ground().half_size_m, wall.half_size_m]),
        np.concatenate([ground().owner, wall.owner]),
    )


def detect(fidelity: str, snr_db: float, seed: int, n: int, *, reflections: bool, band_hz: object) -> Detections:
    """Shots from one place at an SNR as facts define it, from a gate that noise does not move."""
    config = ReceiverConfig(
        fidelity=fidelity,  # pyright: ignore[reportArgumentType]
        band_hz=band_hz,  # pyright: ignore[reportArgumentType]
        trigger_jitter=False,
        false_alarm_rate_hz=1e-9,
        bits=24,
        full_scale_v=10.0,
    )
    range_m = 8.0
    amplitude_v = range_m * config.noise_v * np.sqrt(28_070 * 10 ** (snr_db / 10) / unit_pulse_energy(RATE_HZ))
    at_m = np.array([range_m * np.cos(0.4), range_m * np.sin(0.4), 1.6])
    source = DischargeSource(name="s", position_m=at_m, amplitude_v=amplitude_v, pulse_rate_hz=1e4, n_shots=n)
    around = (
        Surroundings(ground_and_wall(), np.array([-0.3, -0.8]), np.zeros(1), Obstacles.none()) if reflections else None
    )
    scene, rng = Scene([source], around), np.random.default_rng(seed)
    return listen_once(config, REAL, scene, rng, world_from_array=level_transform(np.zeros(3)), duration_s=10.0)


@pytest.mark.parametrize("band_hz", [BAND_HZ, "all"])
@pytest.mark.parametrize("reflections", [False, True])
def test_energies_by_their_law_are_distributed_as_those_of_waveforms(band_hz: object, reflections: bool) -> None:
    """A fixed part of the 20 000 pulses at three levels, which the benchmark runs."""
    whole, drawn = (
        detect(fidelity, 0.0, seed, 4000, reflections=reflections, band_hz=band_hz)
        for seed, fidelity in enumerate(("waveform", "energy"))
    )
    assert whole.pulses.time_s.size == drawn.pulses.time_s.size == 4000
    for k in range(6):
        assert (
            ks_2samp(whole.pulses.strengths_v[:, k], drawn.pulses.strengths_v[:, k]).statistic < 0.043
        )  # 0.1 % by chance
    for detected in (whole, drawn):  # what the estimator is told holds for a pulse that comes straight
        variance = detected.pulses.strengths_v.var(axis=0)
        np.testing.assert_allclose(variance, detected.pulses.variance_v2.mean(axis=0), rtol=0.3 if reflections else 0.1)
    azimuths = [
        estimate_bearings(x.pulses.strengths_v[:, np.newaxis], REAL.manifold()).azimuth_rad for x in (whole, drawn)
    ]
    spreads = [np.std(difference(a, 0.4)) for a in azimuths]
    assert spreads[0] == pytest.approx(spreads[1], rel=0.05)
