"""What is drawn for one episode: sources, interferers, and the array as it was really built."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdpatrol.envs.core.arguments import Fixed
from pdpatrol.envs.core.generators import Generators
from pdpatrol.envs.scenario.scenario import Scenario
from pdpatrol.envs.scenario.sources import SourceConfig
from pdpatrol.sensing import Carrier, DischargeSource, HelicalArray, PulseTrain, Scene, Surroundings

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Episode:
    """Nature's draw for one episode; what only nature knows.

    Attributes:
        sources: What discharges.
        interferers: What is heard like a discharge and lies beyond the fence.
        array: As it was really built.
        scene: All that radiates.
        start_pose: Where the robot starts, x m, y m, yaw rad, shape (3,).
        truth: The same as plain data, for logs and scores.
    """

    sources: tuple[DischargeSource, ...]
    interferers: tuple[DischargeSource, ...]
    array: HelicalArray
    scene: Scene
    start_pose: FloatArray
    truth: dict[str, Any]

    @classmethod
    def draw(cls, scenario: Scenario, surroundings: Surroundings, generators: Generators, fixed: Fixed) -> Episode:
        """Draw all that a scenario leaves open, but for what is fixed."""
        rng = generators.episode
        sources = _draw_sources(scenario, generators, fixed.sources_m)
        interferers = tuple(
            DischargeSource(
                name=item.name,
                position_m=np.array(item.position_m),
                amplitude_v=_draw_amplitude(item.amplitude_v, item.amplitude_range_db, rng),
                pulse_rate_hz=item.pulse_rate_hz,
                axis=_draw_axis(item.polarisation, generators.polarisation),
                burst_s=item.burst_s,
                moves_to_m=None if item.moves_to_m is None else np.array(item.moves_to_m),
                speed_mps=item.speed_mps or 0.0,
            )
            for item in scenario.interferers
        )
        carriers = [
            Carrier(
                frequency_hz=item.frequency_hz,
                amplitude_v=item.amplitude_v,
                bearing_rad=float(np.radians(item.bearing_deg)),
            )
            for item in scenario.carriers
        ]
        yaw_rad, fixed_deg = float(rng.uniform(-np.pi, np.pi)), scenario.route.dock_yaw_deg
        yaw_rad = yaw_rad if fixed_deg is None else float(np.radians(fixed_deg))
        array = HelicalArray.draw(scenario.array, rng)  # last: arrays of other sizes shift nothing
        start = (*scenario.route.dock_m, yaw_rad) if fixed.start_pose is None else fixed.start_pose
        return cls(
            sources=sources,
            interferers=interferers,
            array=array,
            scene=Scene([*sources, *interferers], surroundings, carriers),
            start_pose=np.array(start, dtype=np.float64),
            truth=_truth(scenario, sources, interferers, array),
        )


def _draw_sources(
    scenario: Scenario, generators: Generators, fixed: Mapping[str, FloatArray]
) -> tuple[DischargeSource, ...]:
    number = scenario.campaign.number
    if number is not None:
        generators = Generators.spawn(np.random.default_rng(number))
    sources, rng = list[DischargeSource](), generators.episode
    taken: set[str] = set()
    for config in scenario.grown_sources:
        position_m = _draw_position(config, scenario, rng, taken)
        sources.append(
            DischargeSource(
                name=config.name,
                position_m=fixed.get(config.name, position_m),
                amplitude_v=_draw_amplitude(config.amplitude_v, config.amplitude_range_db, rng),
                pulse_rate_hz=config.pulse_rate_hz,
                axis=_draw_axis(config.polarisation, generators.polarisation),
                train=_draw_train(config, scenario, rng),
                active_s=config.active_s or (0.0, np.inf),
                drift_db_per_min=config.drift_db_per_min,
                n_shots=config.n_shots,
                first_shot_s=config.first_shot_s,
            )
        )
    return tuple(sources)


def _draw_position(config: SourceConfig, scenario: Scenario, rng: np.random.Generator, taken: set[str]) -> FloatArray:
    if config.position_m is not None:
        return np.array(config.position_m)
    if config.anywhere_at_m is not None:
        return np.append(scenario.yard.free_place(rng, scenario.robot.description.room_m), config.anywhere_at_m)
    sites = [site for site in scenario.candidate_sites(config) if site not in taken]
    site = sites[int(rng.integers(len(sites)))]
    taken.add(site)
    return scenario.yard.site_position(site)


def _draw_train(config: SourceConfig, scenario: Scenario, rng: np.random.Generator) -> PulseTrain | None:
    if config.kind is None:
        return None
    drawn_deg = float(rng.choice((0.0, 120.0, 240.0)))
    conductor_deg = drawn_deg if config.conductor_deg is None else config.conductor_deg
    return PulseTrain.draw(config.kind, scenario.receiver.mains_hz, float(np.radians(conductor_deg)), rng)


def _draw_axis(stated: tuple[float, float, float] | None, rng: np.random.Generator) -> FloatArray:
    """A stated direction as a unit vector, or any direction of space alike."""
    drawn = rng.standard_normal(3)
    axis = drawn if stated is None else np.array(stated)
    return axis / np.linalg.norm(axis)


def _draw_amplitude(amplitude_v: float, range_db: float, rng: np.random.Generator) -> float:
    """Uniform in decibels over a range centred on `amplitude_v`."""
    return amplitude_v * 10 ** (float(rng.uniform(-0.5, 0.5)) * range_db / 20)


def _truth(
    scenario: Scenario,
    sources: tuple[DischargeSource, ...],
    interferers: tuple[DischargeSource, ...],
    array: HelicalArray,
) -> dict[str, Any]:
    def describe(source: DischargeSource) -> dict[str, Any]:
        to_m = source.moves_to_m
        motion = {} if to_m is None else {"moves_to_m": to_m.tolist(), "speed_mps": source.speed_mps}
        return {
            "name": source.name,
            "position_m": source.position_m.tolist(),
            "amplitude_v": source.amplitude_v,
            "polarisation": source.axis.tolist(),
            "pulse_rate_hz": source.pulse_rate_hz,
            **motion,
        }

    return {
        "sources": [
            {**describe(source), "kind": config.kind} for source, config in zip(sources, scenario.sources, strict=True)
        ],
        "interferers": [describe(source) for source in interferers],
        "array": {
            "boresights_rad": array.boresights_rad.tolist(),
            "boresight_elevations_rad": array.boresight_elevations_rad.tolist(),
            "gain_factors": array.gain_factors.tolist(),
            "gain_offsets": array.gain_offsets.tolist(),
            "positions_m": array.positions_m.tolist(),
        },
    }
