"""What is detected: any path may trigger, more of a signal never less often, and no discharge passes for a burst."""

from dataclasses import replace
from typing import Any, cast

import numpy as np

from sensing import (
    Faces,
    Obstacles,
    ReceiverConfig,
    Scene,
    Surroundings,
)
from sensing.receiver.bank import listen_once
from tests.sensing.listening import AT_ORIGIN, NOMINAL, listen, source_at

AXES = np.eye(3)
MIRROR = np.array([-0.8])


def ground() -> Surroundings:
    plane = Faces(np.zeros((1, 3)), AXES[2:], AXES[np.newaxis, :2], np.full((1, 2), np.inf), np.array([-1]))
    return Surroundings.free_space()._replace(faces=plane, reflection=np.array([-0.3]))


def wall(y_m: float) -> Surroundings:
    face = Faces(
        np.array([[5.0, y_m, 2.0]]), AXES[1:2], AXES[np.newaxis, [0, 2]], np.array([[20.0, 3.0]]), np.array([0])
    )
    return Surroundings(face, MIRROR, np.zeros(1), Obstacles.none())


def tank_and_wall() -> Surroundings:
    """The direct path loses 25 dB in a tank; the echo of a wall comes 22 dB above it."""
    one, none = np.ones(1), np.zeros(1)
    tank = Obstacles(np.array([[5.0, 0.0]]), none, np.array([[0.2, 0.5]]), none, none, 3 * one, np.zeros(1, np.intp))
    return wall(-3.75)._replace(log_loss=-np.log(10) / 20 * np.array([25.0]), obstacles=tank)


def share_detected(amplitude_v: float, around: Surroundings, seed: int, n: int = 1000) -> float:
    gun = replace(source_at(10.0, 0.0), amplitude_v=amplitude_v, pulse_rate_hz=2e3, n_shots=n)
    rng = np.random.default_rng(seed)
    detected = listen_once(
        ReceiverConfig(), NOMINAL, Scene([gun], around), rng, world_from_array=AT_ORIGIN, duration_s=n / 2e3
    )
    return detected.pulses.n_pulses / n


def test_an_echo_is_detected_where_a_first_path_just_fails_to_trigger() -> None:
    shares = [share_detected(amplitude_v, tank_and_wall(), 1) for amplitude_v in (0.50, 0.515, 0.53)]
    assert min(shares) == 1.0


def test_no_discharge_is_taken_for_a_burst_though_ground_and_wall_echo_it() -> None:
    pairs = zip(ground().faces, wall(-2.75).faces, strict=True)
    both = Faces(*(np.concatenate(cast("Any", pair)) for pair in pairs))
    around = Surroundings(both, np.array([-0.3, -0.8]), np.zeros(1), Obstacles.none())
    for level_db in (6.0, 13.0, 20.0):
        gun = replace(source_at(10.0, 0.0, 1.5), amplitude_v=0.027 * 10 ** (level_db / 20), pulse_rate_hz=2e3)
        detected = listen(gun, duration_s=0.5, surroundings=around)
        assert detected.n_rejected < 0.01 * detected.pulses.n_pulses


def test_detection_rises_with_the_level() -> None:
    """Within its interval, from 6 dB below the trigger level to 40 dB above it, in fifty random scenes."""
    levels_db = np.arange(-6.0, 41.0, 2.0)
    for seed in range(50):
        rng = np.random.default_rng(seed)
        around = [ground(), wall(-rng.uniform(0.5, 12.0)), tank_and_wall()][seed % 3]
        shares = [share_detected(0.02 * 10 ** (x / 20), around, seed, 300) for x in levels_db + rng.uniform(-1.0, 1.0)]
        highest = np.maximum.accumulate(shares)
        assert (highest - shares < 3.3 * np.sqrt(2 * np.maximum(highest * (1 - highest), 0.003) / 300)).all(), seed
