"""Rejection of bursts in the shipped yards, with all their multipath."""

from dataclasses import replace

import numpy as np
import pytest

from pdpatrol.envs import load_scenario, shipped_scenarios
from pdpatrol.envs.scenario.radio import RadioConfig, surroundings_of
from pdpatrol.sensing import DischargeSource, HelicalArray, ReceiverConfig, Scene, level_transform
from pdpatrol.sensing.receiver.bank import listen_once
from pdpatrol.sensing.receiver.receiver import Receiver
from tests.sensing.listening import arrivals_of

CONFIG = ReceiverConfig()
N_PLACES, N_SHOTS, RATE_HZ = 400, 2, 1000.0


def share_rejected(name: str, burst_s: float, *, second_order: bool = False) -> float:
    """Return the share of triggers rejected as bursts, for emissions from random sites.

    The emissions are 6 to 20 dB above the trigger level. Polarisations and the places of the robot are random.
    """
    scenario, rng = load_scenario(name), np.random.default_rng(0)
    yard, array = scenario.yard, HelicalArray.nominal(scenario.array)
    threshold_v = Receiver(CONFIG, array.n_elements).threshold_v
    surroundings = surroundings_of(yard, RadioConfig(second_order=second_order))
    n_rejected = n_triggered = 0
    for _ in range(N_PLACES):
        axis, turn_rad = rng.standard_normal(3), rng.uniform(-np.pi, np.pi)
        x, y, *_ = yard.free_place(rng, scenario.robot.description.room_m)
        world_from_array = level_transform(np.array([x, y, turn_rad]))
        source = DischargeSource(
            name="source",
            position_m=yard.site_position(str(rng.choice(yard.site_names()))),
            amplitude_v=1.0,
            pulse_rate_hz=RATE_HZ,
            axis=axis / np.linalg.norm(axis),
            n_shots=N_SHOTS,
            burst_s=burst_s,
        )
        strongest = np.abs(arrivals_of(Scene([source], surroundings), array, world_from_array).amplitude).max()
        peak_v = 10 ** (rng.uniform(6.0, 20.0) / 20) * threshold_v
        scene = Scene([replace(source, amplitude_v=float(peak_v / strongest))], surroundings)
        duration_s = N_SHOTS / RATE_HZ
        detected = listen_once(CONFIG, array, scene, rng, world_from_array=world_from_array, duration_s=duration_s)
        n_rejected += detected.n_rejected
        n_triggered += detected.n_rejected + detected.pulses.n_pulses
    assert n_triggered > 0.9 * N_PLACES * N_SHOTS
    return n_rejected / n_triggered


YARDS = [name for name in shipped_scenarios() if load_scenario(name).yard.equipment]


@pytest.mark.whole
@pytest.mark.parametrize("name", YARDS)
def test_bursts_are_rejected_and_pulses_pass_in_yards(name: str) -> None:
    assert share_rejected(name, 0.0) < 0.01
    assert share_rejected(name, 0.0, second_order=True) < 0.01
    assert share_rejected(name, 3 * CONFIG.longest_echo_s) > 0.95
