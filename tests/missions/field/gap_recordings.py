"""Recordings of a drive around equipment with two discharges, in worlds that differ from the scenario as planted."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from dirmusic.angles import azimuth_of, wrap
from dirmusic.arrays import FloatArray
from pdpatrol.envs.scenario import Scenario, load_scenario
from pdpatrol.envs.scenario.radio import surroundings_of
from pdpatrol.sensing import DischargeSource, HelicalArray, Scene, TrueArrayConfig, level_transform
from pdpatrol.sensing.radio.materials import GroundName
from pdpatrol.sensing.receiver.bank import listen_once

YARD = Path(__file__).with_name("gap_yard.toml")
SITES = ("transformer/tank_south", "breaker/pole", "ct/head")


@dataclass(frozen=True)
class Planted:
    """Differences between the world of a recording and the scenario.

    Attributes:
        noise_db: Noise of the receiver.
        beam_width: Relative width of the beam.
        gain_db: Gain of channel 3.
        ground: Material of the ground.
        pose_ratio: Errors of the poses relative to the stated ones.
    """

    noise_db: float = 0.0
    beam_width: float = 1.0
    gain_db: float = 0.0
    ground: GroundName = "gravel"
    pose_ratio: float = 1.0


FIVE = Planted(noise_db=6.0, beam_width=1.1, gain_db=-3.0, ground="wet_soil", pose_ratio=2.0)


def record(path: Path, seed: int, planted: Planted, n_poses: int = 50) -> FloatArray:
    """Write a recording with two sources, and return the gain of each channel in dB, shape (6,)."""
    rng, scenario = _generator(seed), load_scenario(YARD)
    scenario = scenario.model_copy(update={"radio": scenario.radio.model_copy(update={"ground": planted.ground})})
    sites = _draw_sites(rng)
    sources = [
        DischargeSource(
            name=site,
            position_m=scenario.yard.site_position(site),
            amplitude_v=float(rng.uniform(0.2, 0.5)),
            pulse_rate_hz=10.0,
            axis=_direction(rng),
        )
        for site in sites
    ]
    array = HelicalArray.draw(scenario.array, rng, TrueArrayConfig(beam_width_scale=planted.beam_width))
    factors = array.gain_factors * 10.0 ** (np.array([0, 0, planted.gain_db, 0, 0, 0]) / 20)
    array, scene = replace(array, gain_factors=factors), Scene(sources, surroundings_of(scenario.yard, scenario.radio))
    receiver = scenario.receiver.model_copy(
        update={"noise_v": scenario.receiver.noise_v * 10 ** (planted.noise_db / 20)}
    )
    rows: list[list[float]] = []
    for step, pose in enumerate(loop_poses(scenario, n_poses, rng)):
        detected = listen_once(receiver, array, scene, rng, world_from_array=level_transform(pose), duration_s=1.0)
        pulses = detected.pulses.take(~detected.pulses.is_overdriven)
        measured = pose + rng.normal(0.0, planted.pose_ratio * scenario.pose_sensor.std)
        place = [20.0 * step, *np.round(measured[:2], 3), round(float(np.degrees(wrap(measured[2]))), 2)]
        rows += [[*place, *own, *std] for own, std in zip(pulses.strengths_v, np.sqrt(pulses.variance_v2), strict=True)]
    columns = [f"{kind}_{k}" for kind in ("strength", "std") for k in range(1, 7)]
    pd.DataFrame(rows, columns=["time_s", "x_m", "y_m", "yaw_deg", *columns]).to_csv(path, index=False)
    return 20.0 * np.log10(factors)


def recorded_sites(seed: int) -> list[str]:
    """Return the sites of the sources of a recording."""
    return _draw_sites(_generator(seed))


def _generator(seed: int) -> np.random.Generator:
    return np.random.default_rng([7, seed])


def _draw_sites(rng: np.random.Generator) -> list[str]:
    return rng.choice(SITES, 2, replace=False).tolist()


def _direction(rng: np.random.Generator) -> FloatArray:
    axis = rng.standard_normal(3)
    return axis / np.linalg.norm(axis)


def loop_poses(scenario: Scenario, n: int, rng: np.random.Generator) -> FloatArray:
    """Return true poses along a loop around the equipment, off any obstacle, shape (n, 3)."""
    angle = rng.uniform(0, 2 * np.pi) + np.linspace(0.0, 2 * np.pi, n, endpoint=False)
    radius = 1.0 + 0.15 * np.sin(2 * angle + rng.uniform(0, 6.3)) + rng.normal(0, 0.03, n)
    places_m = np.array([15.0, 13.0]) + (radius * np.array([8.0 * np.cos(angle), 7.0 * np.sin(angle)])).T
    clearance_m = np.array([scenario.yard.clearance(place) for place in places_m])
    towards_m = places_m - np.array([15.0, 13.0])
    places_m = np.where(clearance_m[:, None] < 0.6, places_m + 1.5 * towards_m / 8.0, places_m)
    yaw_rad = azimuth_of(np.roll(places_m, -1, axis=0) - places_m) + rng.normal(0, 0.3, n)
    return np.column_stack([places_m, yaw_rad])
