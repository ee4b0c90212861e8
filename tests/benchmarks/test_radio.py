"""Time that the receiver needs for a pulse."""

import statistics
import time

import numpy as np
import pytest

from pdpatrol.sensing import (
    ArrayConfig,
    DischargeSource,
    HelicalArray,
    ReceiverConfig,
    Scene,
    Surroundings,
    TrueArrayConfig,
    level_transform,
)
from pdpatrol.sensing.radio.materials import GRAVEL
from pdpatrol.sensing.receiver.bank import listen_once
from tests.sensing.scenes import wall_face

pytestmark = pytest.mark.benchmark

N_PULSES = 20_000
OUT_OF_REACH_V = 0.004
"""Amplitude whose four paths together stay below the trigger by the first bound."""
REAL = HelicalArray.draw(ArrayConfig(), np.random.default_rng(3))
OVER_FREQUENCY = HelicalArray.draw(ArrayConfig(), np.random.default_rng(3), TrueArrayConfig(pattern="helix_in_ring"))


def ground_and_wall() -> Surroundings:
    """Make the ground, and a wall half a metre behind the array: both reflections arrive within the gate."""
    return Surroundings(wall_face((-0.5, 0.0, 2.0), (1.0, 0.0), (5.0, 2.0)), GRAVEL)


def seconds_a_pulse(amplitude_v: float, array: HelicalArray = REAL) -> tuple[float, float]:
    """Return the time for one pulse, and the share of pulses that are detected."""
    gun = DischargeSource(
        name="gun", position_m=np.array([10.0, 0.0, 1.5]), amplitude_v=amplitude_v, pulse_rate_hz=2e4, n_shots=N_PULSES
    )
    scene, rng = Scene([gun], ground_and_wall()), np.random.default_rng(0)
    start = time.perf_counter()
    detected = listen_once(
        ReceiverConfig(), array, scene, rng, world_from_array=level_transform(np.zeros(3)), duration_s=N_PULSES / 2e4
    )
    return (time.perf_counter() - start) / N_PULSES, detected.pulses.n_pulses / N_PULSES


def seconds_of_white_noise() -> float:
    """Return the time that NumPy takes for the white noise of six channels over 260 samples."""
    rng, start = np.random.default_rng(0), time.perf_counter()
    for _ in range(1000):
        rng.standard_normal((260, 6))
    return (time.perf_counter() - start) / 1000


def test_pulse_takes_little_more_time_than_its_noise() -> None:
    taken: list[list[float]] = []
    for _ in range(7):
        (strong_s, all_detected), (weak_s, none) = seconds_a_pulse(0.27), seconds_a_pulse(OUT_OF_REACH_V)
        in_bands_s, all_in_bands = seconds_a_pulse(0.27, OVER_FREQUENCY)
        assert min(all_detected, all_in_bands) >= 1.0 > 1e-3 >= none
        taken.append([strong_s, in_bands_s, weak_s, seconds_of_white_noise()])
    strong_s, in_bands_s, weak_s, noise_s = (statistics.median(column) for column in zip(*taken, strict=True))
    print(
        f"\na pulse by three paths takes {1e6 * strong_s:.0f} us, with gains over frequency "
        f"{1e6 * in_bands_s:.0f} us, one out of reach {1e6 * weak_s:.1f} us; "
        f"white noise of 6 x 260 samples takes numpy {1e6 * noise_s:.0f} us"
    )
    assert strong_s <= 2.5 * noise_s
    assert in_bands_s <= 7.0 * noise_s
    assert weak_s <= 0.25 * noise_s
