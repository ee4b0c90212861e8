"""Receiver: spreading, delay, obstruction, trigger, gate, ADC and schedule."""

from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from dirmusic import bearing_bound, estimate_bearings
from dirmusic.angles import difference
from pdpatrol.sensing import (
    ArrayConfig,
    DischargeSource,
    HelicalArray,
    ReceiverConfig,
)
from pdpatrol.sensing.nature.pulses import damped_pulse, unit_pulse_energy
from pdpatrol.sensing.nature.sources import Emissions
from pdpatrol.sensing.receiver.bank import Listener
from pdpatrol.sensing.receiver.front_end import FrontEnd
from pdpatrol.sensing.receiver.receiver import Receiver
from tests.sensing import reference_receiver
from tests.sensing.listening import NOMINAL, listen, listener, noise_of, source_at
from tests.sensing.scenes import around, lossy, wall_across, wall_face


def test_pulse_has_unit_peak_and_lasts_2_5_ns() -> None:
    time_s = np.arange(-2e-9, 20e-9, 1e-12)
    pulse = damped_pulse(time_s)
    assert not pulse[time_s < 0].any()
    assert np.abs(pulse).max() == pytest.approx(1.0, abs=1e-4)
    energy = np.cumsum(np.square(pulse))
    assert time_s[np.searchsorted(energy, 0.98 * energy[-1])] == pytest.approx(2.5e-9, abs=0.5e-9)


@pytest.mark.parametrize(("range_m", "degrees"), [(5.0, 0.45), (15.0, 1.3)])
def test_default_amplitude_gives_stated_bearing_bound(range_m: float, degrees: float) -> None:
    config = ReceiverConfig()
    rho = unit_pulse_energy(config.sample_rate_hz) * (0.27 / range_m / config.noise_v) ** 2
    azimuth = np.radians(np.arange(360.0))
    bound = np.sqrt(np.mean(np.square(bearing_bound(NOMINAL.manifold(), azimuth, rho))))
    assert np.degrees(bound) == pytest.approx(degrees, rel=0.05)


def test_bearing_errors_reach_bound_all_around() -> None:
    rho = unit_pulse_energy(20e9) * (0.27 / 15.0 / 1e-3) ** 2
    over_bound: list[float] = []
    for azimuth in np.radians(np.arange(0.0, 360.0, 25.0)):
        source = source_at(15.0 * np.cos(azimuth), 15.0 * np.sin(azimuth))
        detected = listen(source, duration_s=2.0, false_alarm_rate_hz=1e-9, band_hz="all")
        error = difference(
            estimate_bearings(detected.pulses.strengths_v[:, np.newaxis], NOMINAL.manifold()).azimuth_rad, azimuth
        )
        spread = float(np.std(error))  # about its mean: the ring's parallax is a bias
        over_bound.append(spread / float(bearing_bound(NOMINAL.manifold(), azimuth, rho)))
    assert np.sqrt(np.mean(np.square(over_bound))) == pytest.approx(1.0, abs=0.12)


def test_false_alarms_have_set_rate_and_noise_strength() -> None:
    detected = listen(duration_s=2000.0, false_alarm_rate_hz=0.1)
    time_s = detected.pulses.time_s
    assert time_s.size == pytest.approx(200, abs=45)  # three sigma
    strongest = detected.pulses.strengths_v.max(axis=-1)
    sigma = Receiver(ReceiverConfig(), 6).noise_variance_v2 ** 0.5
    assert 10 < np.median(strongest) / sigma < 40  # a crossing at 7 sigma, with correlated samples around it
    assert (np.diff(time_s) >= 0).all()
    np.testing.assert_allclose(detected.pulses.mains_phase_rad, np.mod(2 * np.pi * 50 * time_s, 2 * np.pi))


def test_threshold_keeps_false_alarm_rate_in_white_noise() -> None:
    receiver = Receiver(ReceiverConfig(band_hz="all"), 6)
    rate = 2 * norm.sf(receiver.threshold_v / 1e-3) * 6 * 20e9
    assert rate == pytest.approx(0.1, rel=1e-3)


def test_threshold_keeps_false_alarm_rate_in_filtered_noise() -> None:
    receiver = Receiver(ReceiverConfig(false_alarm_rate_hz=1e4), 6)
    often = Receiver(receiver.config.model_copy(update={"false_alarm_rate_hz": 6e6}), 6)
    assert receiver.threshold_v == pytest.approx(reference_receiver.threshold_v(1e4), rel=1e-4)
    above = np.abs(noise_of(receiver.front_end, 6, 4_000_000, 1e-3)) > often.threshold_v
    crossings = (above[:, 1:] & ~above[:, :-1]).sum()
    assert crossings / (4e6 / 20e9) == pytest.approx(6e6, rel=0.15)  # 1200 of them


@pytest.mark.parametrize("band_hz", ["all", (1.4e9, 2.2e9)])
def test_gate_holds_whole_pulse_in_every_channel(band_hz: Any) -> None:  # noqa: ANN401
    detected = listen(source_at(-20.0, 0.0), noise_v=1e-6, bits=24, band_hz=band_hz)
    front_end = FrontEnd(20e9, band_hz, 90)
    energy = np.square(front_end.pulse(np.arange(2000.0))).sum()
    whole = 0.27 / 20 * np.sqrt(energy) * NOMINAL.gain(np.full(6, np.pi), np.zeros(6))
    np.testing.assert_allclose(detected.pulses.strengths_v.mean(axis=0), whole, rtol=0.03)


@pytest.mark.parametrize("range_m", [5.0, 15.0])
@pytest.mark.parametrize("band_hz", ["all", (1.4e9, 2.2e9)])
def test_reported_variance_matches_strengths(band_hz: Any, range_m: float) -> None:  # noqa: ANN401
    detected = listen(source_at(range_m, 0.0), duration_s=5.0, false_alarm_rate_hz=1e-9, band_hz=band_hz)
    np.testing.assert_allclose(
        detected.pulses.strengths_v.var(axis=0), detected.pulses.variance_v2.mean(axis=0), rtol=0.15
    )


def test_drawn_arrays_have_configured_errors() -> None:
    config = ArrayConfig(gain_error=0.05, pointing_error_deg=2.0, position_error_m=0.002)
    rng = np.random.default_rng(0)
    drawn = [HelicalArray.draw(config, rng) for _ in range(500)]
    pointing = np.array([a.boresights_rad for a in drawn]) - NOMINAL.boresights_rad
    assert np.degrees(pointing.std()) == pytest.approx(2.0, rel=0.05)
    assert np.log([a.gain_factors for a in drawn]).std() == pytest.approx(0.05, rel=0.05)
    assert (np.array([a.positions_m for a in drawn]) - NOMINAL.positions_m).std() == pytest.approx(0.002, rel=0.05)


def drawn_between(ahead: Listener, start_s: float, duration_s: float) -> Emissions:
    return ahead.emissions(round(start_s, 9), round(start_s + duration_s, 9), 1e-9)


def test_shot_at_interval_border_is_fired_once() -> None:
    gun = DischargeSource(
        name="gun", position_m=np.ones(3), amplitude_v=1.0, pulse_rate_hz=10.0, n_shots=90, first_shot_s=0.3
    )
    anew = np.concatenate([drawn_between(listener(gun), k * 0.1, 0.1).time_s for k in range(200)])
    ahead = listener(gun)
    in_turn = np.concatenate([drawn_between(ahead, k * 0.1, 0.1).time_s for k in range(200)])
    for fired in (anew, in_turn):
        np.testing.assert_allclose(fired, 0.3 + np.arange(90) / 10, atol=1e-9)


def test_listener_keeps_rates_and_restarts_on_step_back() -> None:
    ahead = listener(source_at(5.0, 0.0, rate_hz=50.0), source_at(9.0, 0.0, rate_hz=20.0))
    pulses = [drawn_between(ahead, k * 0.1, 0.1) for k in range(3000)]
    for k, part in enumerate(pulses):
        assert ((part.time_s >= k * 0.1 - 1e-9) & (part.time_s < (k + 1) * 0.1 + 1e-9)).all()
        assert (np.diff(part.time_s) >= 0).all()
    times = np.concatenate([part.time_s for part in pulses])
    assert np.unique(times).size == times.size == pytest.approx(300 * 70, abs=4 * np.sqrt(300 * 70))
    sources = np.concatenate([part.source for part in pulses])
    assert (sources == 1).mean() == pytest.approx(20 / 70, abs=0.015)
    again = drawn_between(ahead, 0.0, 300.0).time_s
    assert again.size == pytest.approx(300 * 70, abs=4 * np.sqrt(300 * 70))


def test_gate_follows_first_path_not_strongest() -> None:
    source = source_at(8.0, 0.0, amplitude_v=2.7)
    to_the_left = wall_face((4.0, 6.0, 2.0), (0.0, -1.0), (5.0, 2.0), lossy(0.0, 0.8))
    surroundings = around(12.0, wall_across(4.0), to_the_left)
    detected = listen(source, duration_s=0.1, surroundings=surroundings, false_alarm_rate_hz=1e-6)
    ahead, left = detected.pulses.strengths_v[:, 1:3].min(axis=-1), detected.pulses.strengths_v[:, 0]
    assert ahead.size > 50
    assert (ahead > 1.3 * left).all()  # from the left, element 1, which points there, would receive most


@pytest.mark.parametrize("bits", [6, 8, 12])
def test_adc_rounds_and_rounding_counts_as_noise(bits: int) -> None:
    config: dict[str, Any] = {"bits": bits, "full_scale_v": 0.1, "noise_v": 2e-3, "band_hz": "all"}
    receiver, detected = Receiver(ReceiverConfig(**config), 6), listen(source_at(10.0, 0.0), duration_s=0.5, **config)
    counts = detected.waveforms_v / receiver.step_v
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-9)
    assert np.abs(counts).max() <= 2 ** (bits - 1) - 1
    before = detected.waveforms_v[:, :, :10]  # before the trigger
    assert before.var() == pytest.approx(receiver.noise_variance_v2, rel=0.05)
    assert not detected.pulses.is_clipped.any()


def test_clipped_pulses_are_flagged() -> None:
    clipped, weak = (
        listen(source_at(3.0, 0.0, amplitude_v=v), full_scale_v=0.1, false_alarm_rate_hz=1e-9) for v in (3.0, 0.2)
    )
    assert clipped.pulses.is_clipped.any(axis=-1).all()
    assert np.abs(clipped.waveforms_v).max() == pytest.approx(0.1)
    assert not weak.pulses.is_clipped.any()
