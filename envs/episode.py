"""Ground truth of one episode: sources, interferers, and the array with its errors, drawn or set at the reset."""

from collections.abc import Mapping
from math import radians
from typing import Any, NamedTuple, Self

import numpy as np

from dirmusic.arrays import FloatArray
from pdpatrol.envs.scenario.scenario import Scenario, position_error
from pdpatrol.envs.scenario.sources import InterfererConfig, SourceConfig
from pdpatrol.robot_models.moving_bodies import Trajectory, describe_moving
from pdpatrol.sensing import Carrier, DischargeSource, HelicalArray, PulseTrain, Scene, Surroundings
from pdpatrol.sensing.nature.sources import SourceChange, Telegraph
from pdpatrol.sensing.receiver.bank import Listener

DRAWN_OF_ARRAY = ("boresights_rad", "boresight_elevations_rad", "gain_factors", "gain_offsets", "positions_m")
"""Properties of the array that are drawn for each episode."""


class Generators(NamedTuple):
    """Random generators of one episode, one per subsystem, so that extra draws in one do not change the others.

    Two policies with the same seed meet the same sources, array and emissions, whatever they do.

    Attributes:
        episode: Draws at the start of the episode: sources, amplitudes, array with its errors, heading at the dock.
        motion: Errors of the pose sensor, the odometry and the gyro.
        lidar: Noise of the lidar.
        nature: Times and strengths of the discharges.
        receiver: Noise of the channels, and the triggers that it causes.
        policy: Draws of a stochastic policy.
        polarisation: Polarisation of the sources.
    """

    episode: np.random.Generator
    motion: np.random.Generator
    lidar: np.random.Generator
    nature: np.random.Generator
    receiver: np.random.Generator
    policy: np.random.Generator
    polarisation: np.random.Generator

    @classmethod
    def spawn(cls, parent: np.random.Generator) -> Self:
        """Spawn independent generators; each call returns new ones, determined by the seed of the parent."""
        return cls(*parent.spawn(len(cls._fields)))


class ResetOptions(NamedTuple):
    """Values that are set at a reset instead of being drawn.

    Attributes:
        start_pose: x m, y m, yaw rad, shape (3,); None to start at the dock.
        sources_m: Positions of the sources to set, by name, each of shape (3,).
    """

    start_pose: FloatArray | None = None
    sources_m: Mapping[str, FloatArray] = {}

    @classmethod
    def parse(cls, options: Any, scenario: Scenario) -> Self:  # noqa: ANN401 - users may pass anything
        """Check and convert the `options` of a reset.

        Raises:
            ValueError: If an option is unknown, or invalid in the scenario.
        """
        options = options or {}
        if not (isinstance(options, Mapping) and options.keys() <= {"start_pose", "sources"}):
            raise ValueError(f"`options` must be a dict with the keys start_pose and sources, got {options!r}")
        start, places, yard = options.get("start_pose"), options.get("sources") or {}, scenario.yard
        if not isinstance(places, Mapping):
            raise ValueError(f"`options`: sources must be a dict from names to positions, got {places!r}")
        if start is not None:
            start = _three_numbers("start_pose", start)
            if not yard.contains(start) or yard.clearance(start) < 0.0 or abs(start[2]) > 2.0 * np.pi:
                raise ValueError(
                    f"`options`: start_pose must be x, y on free ground and a yaw in [-2 pi, 2 pi], got {start}"
                )
        names, sources_m = [source.name for source in scenario.sources], dict[str, FloatArray]()
        for name, place in places.items():
            if name not in names:
                raise ValueError(f"`options`: no source `{name}`; available: {', '.join(names) or 'none'}")
            is_site = isinstance(place, str)
            sources_m[name] = yard.site_position(place) if is_site else _three_numbers(f"source `{name}`", place)
            if error := position_error(yard, sources_m[name]):
                raise ValueError(f"`options`: source `{name}` {error}")
        return cls(start, sources_m)


def _three_numbers(name: str, value: Any) -> FloatArray:  # noqa: ANN401 - users may pass anything
    try:
        numbers = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        numbers = np.empty(0)
    if numbers.shape != (3,) or not np.isfinite(numbers).all():
        raise ValueError(f"`options`: {name} must be three finite numbers, got {value!r}")
    return numbers


class Episode(NamedTuple):
    """Ground truth of one episode.

    Attributes:
        listener: Receiver of the robot: the array with its errors, and all radiating sources, the discharges first.
        start_pose: Pose of the robot at the start, x m, y m, yaw rad, shape (3,).
        truth: Sources, interferers, array, receiver, people and vehicles as plain data, for logs and scores.
        tracks: Tracks of people and vehicles, in the order of the scenario.
    """

    listener: Listener
    start_pose: FloatArray
    truth: dict[str, Any]
    tracks: tuple[Trajectory, ...]

    @classmethod
    def draw(
        cls, scenario: Scenario, surroundings: Surroundings, generators: Generators, options: ResetOptions
    ) -> Self:
        """Draw an episode; values set by the options replace drawn values."""
        rng = generators.episode
        sources = _draw_sources(scenario, generators, options.sources_m)
        interferers = _draw_interferers(scenario, generators)
        carriers = [
            Carrier(frequency_hz=item.frequency_hz, amplitude_v=item.amplitude_v, bearing_rad=radians(item.bearing_deg))
            for item in scenario.carriers
        ]
        yaw_rad = rng.uniform(-np.pi, np.pi)  # drawn even where it is not used, so that it changes nothing else
        if scenario.route.dock_yaw_deg is not None:
            yaw_rad = radians(scenario.route.dock_yaw_deg)
        array = HelicalArray.draw(
            scenario.array, rng, scenario.nature.array
        )  # last, so that the size of the array changes nothing else
        start = (*scenario.route.dock_m, yaw_rad) if options.start_pose is None else options.start_pose
        drift_rng = generators.receiver.spawn(1)[0]
        drift_db_per_min = scenario.nature.receiver.draw_drift(array.n_elements, drift_rng)
        kinds, moving = [{"kind": source.kind} for source in scenario.sources], scenario.nature.moving
        tracks = tuple(
            item.draw(scenario.task.time_limit_s, own_rng)
            for item, own_rng in zip(moving, generators.motion.spawn(len(moving)), strict=True)
        )
        truth = {
            "sources": [_describe(source) | kind for source, kind in zip(sources, kinds, strict=True)],
            "interferers": [_describe(source) for source in interferers],
            "array": {key: getattr(array, key).tolist() for key in DRAWN_OF_ARRAY},
            "moving": [describe_moving(item.body, track) for item, track in zip(moving, tracks, strict=True)],
            "receiver": {} if drift_db_per_min is None else {"drift_db_per_min": drift_db_per_min.tolist()},
        }
        listener = Listener(
            array=array,
            scene=Scene([*sources, *interferers], surroundings, carriers),
            nature_rng=generators.nature,
            receiver_rng=generators.receiver,
            faults=scenario.nature.receiver.faults,
            drift_db_per_min=drift_db_per_min,
        )
        return cls(listener, np.array(start), truth, tracks)


def _draw_sources(
    scenario: Scenario, generators: Generators, given_m: Mapping[str, FloatArray]
) -> list[DischargeSource]:
    number, of_duty = scenario.campaign.number, generators.nature.spawn(len(scenario.sources))
    if number is not None:
        generators = Generators.spawn(np.random.default_rng(number))
    sources, taken = list[DischargeSource](), set[str]()
    of_changes = generators.nature.spawn(len(scenario.sources))
    for config, duty_rng, change_rng in zip(scenario.grown_sources, of_duty, of_changes, strict=True):
        position_m = _draw_position(config, scenario, generators.episode, taken)
        emitter = _draw_emitter(config, generators, duty_rng)
        train, conductor_rad = _draw_train(config, scenario, generators.episode)
        sources.append(
            DischargeSource(
                **emitter,
                position_m=given_m.get(config.name, position_m),
                train=train,
                changes=_draw_changes(config, scenario, train, conductor_rad, change_rng),
                drift_db_per_min=config.drift_db_per_min,
                n_shots=config.n_shots,
                first_shot_s=config.first_shot_s,
            )
        )
    return sources


def _draw_changes(
    config: SourceConfig,
    scenario: Scenario,
    train: PulseTrain | None,
    conductor_rad: float,
    rng: np.random.Generator,
) -> tuple[SourceChange, ...]:
    """Return the later changes of a source; a new kind of discharge is on the same conductor."""
    changes, gain, rate_hz = list[SourceChange](), 1.0, config.pulse_rate_hz
    for change in config.changes or ():
        gain = gain if change.amplitude_db is None else 10 ** (change.amplitude_db / 20)
        rate_hz = rate_hz if change.pulse_rate_hz is None else change.pulse_rate_hz
        if change.kind is not None:
            train = PulseTrain.of_kind(change.kind, scenario.true_mains_hz, conductor_rad, rng)
        changes.append(SourceChange(change.at_s, gain, rate_hz, train))
    return tuple(changes)


def _draw_interferers(scenario: Scenario, generators: Generators) -> list[DischargeSource]:
    n = len(scenario.interferers)
    of_duty, of_train = generators.nature.spawn(n), generators.nature.spawn(n)
    return [
        DischargeSource(
            **_draw_emitter(item, generators, duty_rng),
            position_m=np.array(item.position_m),
            train=_draw_train(item, scenario, train_rng)[0],
            burst_s=item.burst_s,
            path_m=None if item.path_m is None else np.array(item.path_m),
            speed_mps=item.speed_mps or 0.0,
        )
        for item, duty_rng, train_rng in zip(scenario.interferers, of_duty, of_train, strict=True)
    ]


def _draw_position(config: SourceConfig, scenario: Scenario, rng: np.random.Generator, taken: set[str]) -> FloatArray:
    if config.position_m is not None:
        return np.array(config.position_m)
    if config.anywhere_at_m is not None:
        return np.append(scenario.yard.free_place(rng, scenario.robot.description.room_m), config.anywhere_at_m)
    site = str(rng.choice([site for site in scenario.candidate_sites(config) if site not in taken]))
    taken.add(site)
    return scenario.yard.site_position(site)


def _draw_train(
    config: SourceConfig | InterfererConfig, scenario: Scenario, rng: np.random.Generator
) -> tuple[PulseTrain | None, float]:
    """Return the pulse train at the start, None for pulses at any phase, and the phase of the conductor."""
    changes = config.changes or () if isinstance(config, SourceConfig) else ()
    if config.kind is None and all(change.kind is None for change in changes):
        return None, 0.0
    drawn_deg = rng.choice((0.0, 120.0, 240.0))
    conductor_rad = radians(drawn_deg if config.conductor_deg is None else config.conductor_deg)
    if config.kind is None:
        return None, conductor_rad
    return PulseTrain.of_kind(config.kind, scenario.true_mains_hz, conductor_rad, rng), conductor_rad


def _draw_emitter(
    config: SourceConfig | InterfererConfig, generators: Generators, duty_rng: np.random.Generator
) -> dict[str, Any]:
    """Return the properties that sources and interferers share, as arguments of `DischargeSource`.

    The amplitude is drawn uniformly in decibels from its range; the polarisation, unless it is stated, uniformly on the
    sphere.
    """
    level_db = generators.episode.uniform(-0.5, 0.5) * config.amplitude_range_db
    drawn = generators.polarisation.standard_normal(3)
    axis = drawn if config.polarisation is None else np.array(config.polarisation)
    return {
        "name": config.name,
        "amplitude_v": config.amplitude_v * 10 ** (level_db / 20),
        "pulse_rate_hz": config.pulse_rate_hz,
        "axis": axis / np.linalg.norm(axis),
        "active_s": config.active_s or (0.0, np.inf),
        "duty": None if config.duty_s is None else Telegraph(*config.duty_s, duty_rng),
    }


def _describe(source: DischargeSource) -> dict[str, Any]:
    described = {
        "name": source.name,
        "position_m": source.position_m.tolist(),
        "amplitude_v": source.amplitude_v,
        "polarisation": source.axis.tolist(),
        "pulse_rate_hz": source.pulse_rate_hz,
    }
    if source.path_m is not None:
        described |= {"path_m": source.path_m.tolist(), "speed_mps": source.speed_mps}
    return described
