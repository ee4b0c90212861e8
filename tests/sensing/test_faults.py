"""Disturbances of the receiver: faulty channels and carriers."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dirmusic import GainManifold, estimate_bearings
from dirmusic.angles import difference
from pdpatrol.sensing import Carrier, DetectedPulses, DischargeSource, ReceiverConfig
from pdpatrol.sensing.nature.pulses import unit_pulse_energy
from pdpatrol.sensing.receiver.faults import ChannelFault
from tests.sensing.listening import NOMINAL, listen

RING = GainManifold.ring(6)
SOURCE = DischargeSource(name="s", position_m=np.array([5.0, 1.0, 0.6]), amplitude_v=0.27, pulse_rate_hz=300.0)


def detect(
    faults: tuple[ChannelFault, ...] = (),
    source: DischargeSource = SOURCE,
    **settings: Any,  # noqa: ANN401 - settings are of many types
) -> DetectedPulses:
    return listen(source, faults=faults, false_alarm_rate_hz=1e-9, **settings)


def test_each_fault_changes_its_channel_as_documented() -> None:
    healthy = np.median(detect().pulses.strengths_v, axis=0)

    def of(fault: ChannelFault) -> np.ndarray:
        return np.median(detect((fault,)).pulses.strengths_v, axis=0) / healthy

    np.testing.assert_allclose(of(ChannelFault(channel=2, kind="dead"))[[0, 2, 3, 4, 5]], 1.0, rtol=0.02)
    assert of(ChannelFault(channel=2, kind="dead"))[1] < 0.05
    assert of(ChannelFault(channel=2, kind="gain_drift", gain_db=-6.0))[1] == pytest.approx(0.501, rel=0.02)
    swapped = of(ChannelFault(channel=2, kind="swapped", other=5)) * healthy
    np.testing.assert_allclose(swapped[[1, 4]], healthy[[4, 1]], rtol=0.03)
    stuck = detect((ChannelFault(channel=3, kind="stuck"),)).pulses.strengths_v[:, 2]
    assert np.ptp(stuck) == 0.0
    assert stuck[0] == pytest.approx(np.sqrt(90) * 0.25 * 0.5, rel=0.01)


def test_saturated_channel_is_limited_to_its_level() -> None:
    detected = detect((ChannelFault(channel=2, kind="saturation", level_v=0.01),))
    assert np.abs(detected.waveforms_v[:, 1]).max() <= 0.0103
    assert np.abs(detected.waveforms_v[:, 2]).max() > 0.02


def test_fault_starts_and_drifts_at_its_times() -> None:
    fault = ChannelFault(channel=2, kind="gain_drift", gain_db=-12.0, start_s=10.0, ramp_s=20.0)
    level_db = [
        20 * np.log10(np.median(detect((fault,), start_s=start_s).pulses.strengths_v[:, 1]))
        for start_s in (0.0, 20.0, 40.0)
    ]
    np.testing.assert_allclose(np.diff(level_db), -6.0, atol=0.2)


def test_filter_removes_carrier_10_db_above_pulse() -> None:
    """The 948 MHz of the Dir-MUSIC paper at SNR 0 dB: errors within a tenth of those without the carrier."""
    config = ReceiverConfig(bits=16)
    range_m = 8.0
    amplitude_v = range_m * config.noise_v * np.sqrt(28_070 / unit_pulse_energy(config.sample_rate_hz))
    rmse = {}
    for strength in (0.0, np.sqrt(10.0)):
        errors = []
        for k, azimuth in enumerate(np.radians(np.arange(0.0, 360.0, 30.0))):
            place = np.array([range_m * np.cos(azimuth), range_m * np.sin(azimuth), 0.6])
            gun = DischargeSource(
                name="gun", position_m=place, amplitude_v=amplitude_v, pulse_rate_hz=300.0, n_shots=150
            )
            carrier = Carrier(frequency_hz=948e6, amplitude_v=strength * amplitude_v / range_m, bearing_rad=0.9 * k)
            detected = detect(source=gun, carriers=(carrier,), bits=16)
            assert detected.pulses.time_s.size == 150
            found = estimate_bearings(detected.pulses.strengths_v[:, np.newaxis], RING).azimuth_rad
            errors.append(difference(found, azimuth))
        rmse[strength] = np.sqrt(np.mean(np.square(errors)))
    assert rmse[np.sqrt(10.0)] <= 1.1 * rmse[0.0]
    assert np.degrees(rmse[0.0]) < 0.55


def test_carrier_spoils_bearings_without_filter() -> None:
    carrier = Carrier(frequency_hz=948e6, amplitude_v=0.17, bearing_rad=2.0)
    assert detect(carriers=(carrier,), band_hz="all").pulses.time_s.size == 0  # the trigger must be raised above it
    weak = Carrier(frequency_hz=948e6, amplitude_v=0.02, bearing_rad=2.0)
    clean, spoiled = (
        np.std(estimate_bearings(detect(carriers=c, band_hz="all").pulses.strengths_v[:, np.newaxis], RING).azimuth_rad)
        for c in ((), (weak,))
    )
    assert spoiled > 3 * clean


def test_carrier_power_is_subtracted_from_strengths() -> None:
    ahead_of_2 = np.pi / 6
    carrier = Carrier(frequency_hz=1.8e9, amplitude_v=0.01, bearing_rad=ahead_of_2)  # in the band
    often = replace(SOURCE, pulse_rate_hz=1500.0)
    clean, carried = (np.square(detect(source=often, carriers=c).pulses.strengths_v[:, 1]) for c in ((), (carrier,)))
    power = 90 * 0.5 * (0.01 * float(NOMINAL.gain(np.full(6, ahead_of_2), np.zeros(6))[1])) ** 2
    assert power > 0.05 * clean.mean()
    error = carried.std() / np.sqrt(carried.size)
    assert carried.mean() == pytest.approx(clean.mean(), abs=4 * error)
    assert 4 * error < 0.5 * power
