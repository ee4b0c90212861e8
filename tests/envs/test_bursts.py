"""In every shipped yard: hardly a discharge is taken for a burst, and nearly every burst is."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from envs import load_scenario
from sensing import DischargeSource, Faces, HelicalArray, Scene, Solids, Surroundings, level_transform
from sensing.receiver.bank import listen_once
from sensing.receiver.receiver import Receiver
from tests.sensing.reference_receiver import arrivals_of

FloatArray = NDArray[np.float64]

YARDS = ("one_source", "two_sources", "switchyard", "gis_hall", "twin_transformers", "transformer_bay", "quiet_yard")
LEVELS_DB = (6.0, 10.0, 14.0, 20.0)
N_PLACES, N_SHOTS, RATE_HZ = 12, 100, 1000.0


def counts(name: str, burst_s: float, *, second_order: bool = False) -> tuple[int, int]:
    """How many emissions were taken for pulses and for bursts, at levels above the trigger's, in random places."""
    scenario, rng = load_scenario(name), np.random.default_rng(8)
    yard, config = scenario.yard, scenario.receiver.model_copy(update={"faults": ()})
    around = Surroundings.of_kinds(
        [item.kind for item in yard.equipment],
        Faces(**yard.faces()._asdict()),
        Solids(**yard.obstacles()._asdict()),
    )._replace(by_two_walls=second_order)
    array, sites = HelicalArray.nominal(scenario.array), yard.site_names()
    receiver = Receiver(config, array.n_elements)
    n_pulses = n_bursts = n_places = 0
    while n_places < N_PLACES:
        at_m = (
            yard.site_position(sites[rng.integers(len(sites))]) if sites else np.array([*rng.uniform(5.0, 15.0, 2), 1])
        )
        place_m = rng.uniform((1.0, 1.0), np.array(yard.size_m) - 1.0)
        gun = DischargeSource(
            name="gun",
            position_m=at_m,
            amplitude_v=1.0,
            pulse_rate_hz=RATE_HZ,
            n_shots=N_SHOTS,
            burst_s=burst_s,
            axis=rng.normal(size=3),
        )
        pose = level_transform(np.array([*place_m, rng.uniform(-np.pi, np.pi)]))
        loudest = arrivals_of(Scene([gun], around), array, pose).loudest
        if loudest.size == 0:
            continue
        n_places += 1
        for level_db in LEVELS_DB:
            peak = 1.0 if burst_s else receiver.front_end.pulse_peak
            level_v = receiver.threshold_v * 10 ** (level_db / 20) / (loudest.max() * peak)
            louder = replace(gun, amplitude_v=float(level_v))
            found = listen_once(
                config, array, Scene([louder], around), rng, world_from_array=pose, duration_s=N_SHOTS / RATE_HZ
            )
            n_pulses, n_bursts = n_pulses + found.pulses.n_pulses, n_bursts + found.n_rejected
    return n_pulses, n_bursts


@pytest.mark.parametrize("name", YARDS)
@pytest.mark.parametrize("second_order", [False, True])
def test_discharges_are_not_taken_for_bursts(name: str, second_order: bool) -> None:
    n_pulses, n_bursts = counts(name, 0.0, second_order=second_order)
    assert n_pulses > 0.5 * N_PLACES * len(LEVELS_DB) * N_SHOTS
    assert n_bursts < 0.01 * (n_pulses + n_bursts)


@pytest.mark.parametrize("name", YARDS)
def test_bursts_three_times_as_long_as_echoes_are_rejected(name: str) -> None:
    n_pulses, n_bursts = counts(name, 3 * load_scenario(name).receiver.longest_echo_s)
    assert n_bursts > 0.95 * (n_pulses + n_bursts)
    assert n_bursts > 0.5 * N_PLACES * len(LEVELS_DB) * N_SHOTS
