"""The two fidelities of the receiver beside each other: the same law, and how much faster."""

import statistics
import time

import numpy as np
import pytest
from scipy.stats import ks_2samp

from dirmusic import estimate_bearings
from dirmusic.angles import difference
from envs import load_scenario
from envs.patrol_env import PatrolEnv
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
from sensing.nature.pulse_shape import unit_pulse_energy
from sensing.receiver.bank import listen_once

pytestmark = pytest.mark.benchmark

N_PULSES, RANGE_M, AZIMUTH_RAD = 20_000, 8.0, 0.4
REAL = HelicalArray.draw(ArrayConfig(), np.random.default_rng(3))


def ground_and_wall() -> Surroundings:
    """The ground, and a wall half a metre behind the array: both reflections come within the gate."""
    faces = Faces(
        centre_m=np.array([[0.0, 0.0, 0.0], [-0.5, 0.0, 2.0]]),
        normal=np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
        axes=np.array([[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]]),
        half_size_m=np.array([[np.inf, np.inf], [5.0, 2.0]]),
        owner=np.array([-1, 0]),
    )
    return Surroundings(faces, np.array([-0.3, -0.8]), np.zeros(1), Obstacles.none())


def detect(fidelity: str, snr_db: float, seed: int) -> tuple[Detections, float]:
    """Pulses from a gate that noise does not move, and the seconds they took."""
    config = ReceiverConfig(
        fidelity=fidelity,  # pyright: ignore[reportArgumentType]
        trigger_jitter=False,
        false_alarm_rate_hz=1e-9,
        bits=24,
        full_scale_v=10.0,
    )
    amplitude_v = RANGE_M * config.noise_v * np.sqrt(28_070 * 10 ** (snr_db / 10) / unit_pulse_energy(20e9))
    at_m = RANGE_M * np.array([np.cos(AZIMUTH_RAD), np.sin(AZIMUTH_RAD), 0.2])
    gun = DischargeSource(name="gun", position_m=at_m, amplitude_v=amplitude_v, pulse_rate_hz=1e4, n_shots=N_PULSES)
    scene, rng = Scene([gun], ground_and_wall()), np.random.default_rng(seed)
    start = time.perf_counter()
    detected = listen_once(config, REAL, scene, rng, world_from_array=level_transform(np.zeros(3)), duration_s=10.0)
    return detected, time.perf_counter() - start


def test_energies_have_the_law_of_waveforms_and_take_a_fiftieth_of_the_time() -> None:
    ratios: list[float] = []
    for snr_db in (10.0, 0.0, -10.0):
        (whole, slow_s), (drawn, fast_s) = (detect(name, snr_db, k) for k, name in enumerate(("waveform", "energy")))
        ratios.append(slow_s / fast_s)
        distance = [
            ks_2samp(whole.pulses.strengths_v[:, k], drawn.pulses.strengths_v[:, k]).statistic for k in range(6)
        ]
        spread = [
            np.std(
                difference(
                    estimate_bearings(x.pulses.strengths_v[:, np.newaxis], REAL.manifold()).azimuth_rad, AZIMUTH_RAD
                )
            )
            for x in (whole, drawn)
        ]
        print(
            f"\nSNR {snr_db:+.0f} dB: KS distance {max(distance):.4f} at most, spread of bearings "
            f"{spread[1] / spread[0]:.3f}, {ratios[-1]:.0f} times faster"
        )
        assert max(distance) < 0.02
        assert spread[1] / spread[0] == pytest.approx(1.0, abs=0.03)
    assert statistics.median(ratios) >= 50


def test_share_of_an_env_step_that_goes_into_listening_to_three_sources() -> None:
    scenario = load_scenario("two_sources")
    sites = ("reactor_west/*", "transformer_east/*", "vt_west/*")
    sources = tuple(
        scenario.sources[0].model_copy(update={"name": f"source_{k}", "sites": (site,)}) for k, site in enumerate(sites)
    )
    receiver = scenario.receiver.model_copy(update={"fidelity": "energy"})
    env = PatrolEnv(scenario.model_copy(update={"sources": sources, "receiver": receiver}))
    env.reset(seed=0)
    receivers = env.simulation._receivers  # pyright: ignore[reportPrivateUsage]
    assert receivers is not None
    real, spent = receivers.listen, [0.0]

    def timed(*arguments: object, **options: object) -> Detections:
        start = time.perf_counter()
        detections = real(*arguments, **options)  # pyright: ignore[reportArgumentType]
        spent[0] += time.perf_counter() - start
        return detections

    receivers.listen = timed  # pyright: ignore[reportAttributeAccessIssue]
    action, shares = np.array([0.5, 0.3], dtype=np.float32), list[float]()
    for _ in range(7):
        spent[0], start = 0.0, time.perf_counter()
        for _ in range(150):
            env.step(action)
        shares.append(spent[0] / (time.perf_counter() - start))
    print(f"\nlistening takes {statistics.median(shares):.2f} of an env step")
    assert statistics.median(shares) <= 0.3
