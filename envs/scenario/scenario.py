"""The scenario: all settings of a mission, and checks across several tables."""

import fnmatch
from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import log10, sqrt
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Discriminator, Field, Tag, model_validator

from dirmusic import ArrayModel
from dirmusic.arrays import FloatArray
from pdpatrol.envs.scenario.array import data_sheet
from pdpatrol.envs.scenario.base import MissionName, known_names
from pdpatrol.envs.scenario.locating import EstimatorConfig, LocatingConfig
from pdpatrol.envs.scenario.map import GeoreferenceConfig, MapConfig
from pdpatrol.envs.scenario.nature import NatureConfig
from pdpatrol.envs.scenario.radio import RadioConfig
from pdpatrol.envs.scenario.robot import BatteryConfig, LidarConfig, OdometryConfig, PoseSensorConfig, RobotConfig
from pdpatrol.envs.scenario.sources import CampaignConfig, CarrierConfig, InterfererConfig, SourceConfig
from pdpatrol.envs.scenario.survey import SurveyConfig
from pdpatrol.envs.scenario.zone import ZoneConfig
from pdpatrol.robot_models.yard.quantities import MOST_YARD_M, Coordinate
from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing import ArrayConfig, HelicalArray, ReceiverConfig
from pdpatrol.sensing.quantities import Config, Degree
from pdpatrol.sensing.radio.materials import KIND_MATERIALS

PLANNED = "planned"
"""Value of `waypoints_m` that makes a mission plan its own waypoints."""

Place = tuple[Coordinate, Coordinate]
Waypoints = Annotated[
    Annotated[tuple[Place, ...], Field(max_length=1000), Tag("[given]")]
    | Annotated[Literal["planned"], Tag("[planned]")],
    Discriminator(lambda value: "[planned]" if isinstance(value, str) else "[given]"),
]
Distance = Annotated[float, Field(ge=0.01, le=MOST_YARD_M)]
Reward = Annotated[float, Field(ge=-1e6, le=1e6)]


MAX_PULSES = 5_000_000
"""Maximum number of pulses in a mission; a log stores 300 bytes per pulse."""

MAX_SAMPLES_PER_S = 3e8
"""Maximum samples per second of simulated time, one path per pulse: several seconds of computing time, and 240 MB of
waveforms per control step."""

MAX_CHANGE_DB = 120.0
"""Maximum change of a source's level, by drift within a mission or by growth over a campaign."""

MAX_DRIFT_DB = 40.0
"""Maximum drift of the receiver's gain within a mission. Assumed; beyond it a receiver is defective."""

MAX_RATE_HZ = 1e4
"""Maximum pulse rate of a source after growth, the same as for a source in the file."""

MAX_PEAK_OVER_NOISE = 1e9
"""Maximum ratio of the peak of a pulse 1 m from its source to the noise, 180 dB."""

MAX_CARRIERS_OVER_NOISE = 1e4
"""Maximum ratio of the sum of all carriers to the noise after the band-pass, 80 dB; above it carriers mask all else."""


class RouteConfig(Config):
    """Dock and patrol route of the robot. Without waypoints, the robot stays at its dock."""

    dock_m: Place
    """Position of the dock, where the mission starts and ends."""
    dock_yaw_deg: Degree | None = None
    """Heading at the start, counter-clockwise from x; by default drawn for each mission."""
    waypoints_m: Waypoints = ()
    """Waypoints in order, or `"planned"` to plan them on the map when the mission starts, as `pdpatrol plan` does."""
    dwell_s: Annotated[float, Field(ge=0.0, le=3600.0)] = 0.0
    """Time for which the robot stands and receives at each waypoint, for discharges of few pulses."""

    @property
    def stops_m(self) -> tuple[tuple[float, float], ...]:
        """Waypoints in order.

        Raises:
            ValueError: If the waypoints have not been planned yet.
        """
        if self.waypoints_m == PLANNED:
            raise ValueError(
                f'route.waypoints_m: must be points, got "{PLANNED}"; write them with `pdpatrol plan` or '
                "missions.planning.with_planned_route"
            )
        return self.waypoints_m


class InspectionConfig(Config):
    """Weakest discharge that an inspection must not miss: `plan` and the report state which sites it is excluded at."""

    level_dbv: Annotated[float, Field(ge=-100.0, le=60.0)] = -20.0
    """Peak of its pulses in a unit-gain channel 1 m away, dB relative to 1 V. Assumed."""
    rate_hz: Annotated[float, Field(ge=1e-3, le=1e4)] = 1.0
    """Its pulses per second. Assumed."""


class TaskConfig(Config):
    """Success criteria, time limit and reward. All defaults are assumed."""

    time_limit_s: Annotated[float, Field(ge=0.1, le=86_400.0)] = 600.0
    """Longest duration of the mission, simulated time."""
    standoff_m: Distance = 2.5
    """Horizontal distance within which a source counts as approached."""
    waypoint_radius_m: Distance = 0.6
    """Distance within which a waypoint or the dock counts as reached."""
    reward_per_metre: Reward = 1.0
    """Reward for each metre of progress towards the nearest source not yet approached."""
    reward_per_second: Reward = -0.05
    """Reward per second; the default makes a second cost 5 cm of progress."""
    reward_per_contact_step: Reward = -1.0
    """Reward per control step in contact with anything but the floor; the default makes it cost a metre."""


class Scenario(Config):
    """A yard, the sources in it, a patrol route, and the properties of robot, array and receiver."""

    name: MissionName
    """Name of the scenario; by default that of its file."""
    yard: Yard
    map: MapConfig = MapConfig()
    route: RouteConfig
    zones: tuple[ZoneConfig, ...] = Field(default=(), max_length=100)
    """Parts of the yard with a speed limit."""
    array: ArrayConfig
    estimator: EstimatorConfig = EstimatorConfig()
    robot: RobotConfig = Field(default_factory=RobotConfig)
    sources: tuple[SourceConfig, ...] = Field(default=(), max_length=64)
    """Discharges."""
    interferers: tuple[InterfererConfig, ...] = Field(default=(), max_length=64)
    """Sources of impulses that are not discharges."""
    carriers: tuple[CarrierConfig, ...] = Field(default=(), max_length=16)
    """Narrowband transmitters."""
    receiver: ReceiverConfig = ReceiverConfig()
    radio: RadioConfig = RadioConfig()
    pose_sensor: PoseSensorConfig = PoseSensorConfig()
    lidar: LidarConfig = LidarConfig()
    odometry: OdometryConfig = OdometryConfig()
    battery: BatteryConfig = BatteryConfig()
    task: TaskConfig = TaskConfig()
    inspection: InspectionConfig = InspectionConfig()
    campaign: CampaignConfig = CampaignConfig()
    georeference: GeoreferenceConfig | None = None
    """Position on Earth, by default unknown."""
    survey: SurveyConfig = SurveyConfig()
    nature: NatureConfig = NatureConfig()
    locating: LocatingConfig = LocatingConfig()

    @property
    def known_yard(self) -> Yard:
        """Yard as shown on the map, the only one that the robot and the operator know. It is rebuilt on each access."""
        return self.map.of(self.yard)

    @property
    def known_array(self) -> ArrayModel:
        """Array model that the robot uses: the data sheet, with the errors of a calibration if one is given."""
        array, calibration = data_sheet(self.array, self.receiver.band_edges_hz), self.locating.calibration
        return array if calibration is None else calibration.applied_to(array)

    @property
    def mounted_array(self) -> HelicalArray:
        """True array without the errors that are drawn."""
        true = self.nature.array
        return HelicalArray.nominal(true.applied_to(self.array)).mounted(true)

    @property
    def true_mains_hz(self) -> float:
        """True frequency of the mains supply."""
        return self.receiver.mains_hz + self.nature.receiver.mains_offset_hz

    @property
    def grown_sources(self) -> tuple[SourceConfig, ...]:
        """Sources as they are on the day of the inspection."""
        return tuple(source.after(self.campaign.weeks) for source in self.sources)

    def candidate_sites(self, source: SourceConfig) -> tuple[str, ...]:
        """Return the sites, `equipment/site`, among which that of a source is drawn; empty if it has a position."""
        known = self.yard.site_names()
        return tuple(dict.fromkeys(site for entry in source.sites for site in fnmatch.filter(known, entry)))

    @model_validator(mode="after")
    def _check_combinations(self) -> Self:
        map_errors = self.map.errors(self.yard)
        errors = [
            *map_errors,
            *_table_errors(self),
            *_route_errors(self, self.yard if map_errors else self.known_yard),
            *_source_errors(self),
            *_moving_errors(self),
            *_growth_errors(self),
        ]
        if errors := errors or [*_signal_errors(self)]:
            raise ValueError("\n".join(errors))
        return self


def _at_most(key: str, value: float, most: float, unit: str) -> Iterator[str]:
    """Yield an error if the magnitude of a value exceeds a limit."""
    if abs(value) > most:
        yield f"{key}: must be at most {most:.3g} {unit}, got {value:.3g}"


def _table_errors(scenario: Scenario) -> Iterator[str]:
    """Check zones, the kinds of equipment, the channel faults, the true mount, the estimator and the calibration."""
    names = [zone.name for zone in scenario.zones]
    for i, name in enumerate(names):
        if name in names[:i]:
            yield f"zones.{i}.name: must be used once, got `{name}` again"
    for key, pieces in (("yard.equipment", scenario.yard.equipment), ("map.extra", scenario.map.extra)):
        for i, item in enumerate(pieces):
            if item.kind not in KIND_MATERIALS:
                yield f"{key}.{i}.kind: no kind `{item.kind}`; available: {', '.join(KIND_MATERIALS)}"
    n = scenario.array.n_channels
    for i, fault in enumerate(scenario.nature.receiver.faults):
        for key, channel in (("channel", fault.channel), ("other", fault.other or 1)):
            if channel > n:
                yield f"nature.receiver.faults.{i}.{key}: must be a channel from 1 to {n}, got {channel}"
    lowest_m, tilt_deg = scenario.mounted_array.positions_m[:, 2].min(), scenario.nature.array.mount_tilt_deg
    if lowest_m <= 0.0:
        yield (
            f"nature.array.mount_tilt_deg: must keep all elements above the ground, got {tilt_deg:g}, lowest element "
            f"at {lowest_m:.2f} m"
        )
    if scenario.estimator.method == "sub_bands" and scenario.receiver.n_bands == 0:
        yield "estimator.method: sub_bands needs receiver.n_bands from 1 to 8, got 0"
    calibration, number = scenario.locating.calibration, scenario.array.serial_number
    if calibration is not None and number is None:
        yield "array.serial_number: is required with a calibration; without it each mission draws another array"
    elif calibration is not None and (mismatch := calibration.mismatch(data_sheet(scenario.array), number)):
        yield f"locating.calibration: {mismatch}"


def position_error(yard: Yard, position_m: Sequence[float] | FloatArray) -> str | None:
    """Explain why a source cannot be at a position (x, y, z), or return None if it can."""
    enclosing = yard.enclosing_equipment(position_m)
    if yard.contains(position_m) and 0.0 < position_m[2] <= MOST_YARD_M and enclosing is None:
        return None
    where = f" inside equipment `{enclosing}`" if enclosing else ""
    place = f"{np.round(position_m, 3).tolist()}{where}"
    return f"must lie in the yard, above the ground and outside equipment, got {place}"


def _source_errors(scenario: Scenario) -> Iterator[str]:
    """Check the names and positions of sources and interferers."""
    yard, known = scenario.yard, scenario.yard.site_names()
    names, earlier = set[str](), list[set[str]]()
    for key in ("sources", "interferers"):
        for i, item in enumerate(getattr(scenario, key)):
            if item.name in names:
                yield f"{key}.{i}.name: must be used once, got `{item.name}` again"
            names.add(item.name)
    for i, source in enumerate(scenario.sources):
        sites = set(scenario.candidate_sites(source))
        for entry in source.sites:
            if not fnmatch.filter(known, entry):
                yield f"sources.{i}.sites: no site `{entry}`; available: {known_names(known, entry)}"
        places = {f"sources.{i}.sites ({site})": yard.site_position(site) for site in sorted(sites)}
        if source.position_m is not None:
            places = {f"sources.{i}.position_m": source.position_m}
        for key, place_m in places.items():
            if error := position_error(yard, place_m):
                yield f"{key}: {error}"
        if sites and sum(bool(sites & other) for other in earlier) >= len(sites):
            yield f"sources.{i}.sites: must be more than the earlier sources on these sites, got {len(sites)}"
        earlier.append(sites)
    for i, item in enumerate(scenario.interferers):
        if name := yard.enclosing_equipment(item.position_m):
            yield f"interferers.{i}.position_m: must lie outside equipment, got {item.position_m} inside `{name}`"
        for start_m, end_m in pairwise([item.position_m, *(item.path_m or ())]):
            if name := yard.enclosing_equipment(np.linspace(start_m, end_m, 1000)[1:]):
                yield f"interferers.{i}.path_m: must not cross equipment, got {end_m}, reached through `{name}`"


def _moving_errors(scenario: Scenario) -> Iterator[str]:
    """Check the names and paths of people and vehicles."""
    names = set[str]()
    for i, item in enumerate(scenario.nature.moving):
        key = f"nature.moving.{i}"
        if item.name in names:
            yield f"{key}.name: must be used once, got `{item.name}` again"
        names.add(item.name)
        room_m = scenario.robot.description.room_m
        yield from (f"{key}.{error}" for error in item.errors(scenario.yard, scenario.route.dock_m, room_m))


def _growth_errors(scenario: Scenario) -> Iterator[str]:
    """Check how much sources change, since the campaign began and within a mission, and how much the gain drifts."""
    weeks, when, minutes = scenario.campaign.weeks, f"on {scenario.campaign.day}", scenario.task.time_limit_s / 60.0
    for key in ("temperature_drift_db_per_min", "temperature_spread_db_per_min"):
        drift_db = getattr(scenario.nature.receiver, key) * minutes
        yield from _at_most(f"nature.receiver.{key}", drift_db, MAX_DRIFT_DB, "dB within task.time_limit_s")
    for i, source in enumerate(scenario.sources):
        drift_db = source.drift_db_per_min * minutes
        yield from _at_most(f"sources.{i}.drift_db_per_min", drift_db, MAX_CHANGE_DB, "dB within task.time_limit_s")
        grown_db = source.growth_db_per_week * weeks
        yield from _at_most(f"sources.{i}.growth_db_per_week", grown_db, MAX_CHANGE_DB, f"dB {when}")
        decades = log10(1.0 + source.rate_growth_per_week) * weeks
        rate_hz = source.max_pulse_rate_hz * 10.0 ** min(decades, 10.0)
        yield from _at_most(f"sources.{i}.rate_growth_per_week", rate_hz, MAX_RATE_HZ, f"pulses per second {when}")


def _route_errors(scenario: Scenario, known_yard: Yard) -> Iterator[str]:
    """Check that the robot fits at dock and waypoints, in the yard and on the map, and where sources may be drawn."""
    stops, room_m = {"route.dock_m": scenario.route.dock_m}, scenario.robot.description.room_m
    if scenario.route.waypoints_m != PLANNED:
        stops |= {f"route.waypoints_m.{i}": point for i, point in enumerate(scenario.route.stops_m)}
    for key, point in stops.items():
        for yard, where in ((scenario.yard, ""), (known_yard, " on the map")):
            clearance_m = yard.clearance(point)
            if clearance_m < room_m:
                (nearest,) = yard.obstacles_at([point])
                yield (
                    f"{key}: must lie in the yard, {room_m:.3g} m or more from any obstacle, so that the robot fits, "
                    f"got {point}, {clearance_m:.2f} m from {nearest}{where}"
                )
                break
    for i, source in enumerate(scenario.sources):
        if source.anywhere_at_m is not None:
            axes = [np.linspace(0.0, size_m, 33) for size_m in scenario.yard.size_m]
            if (scenario.yard.clearance(np.stack(np.meshgrid(*axes), axis=-1)) >= room_m).mean() < 0.01:
                yield f"sources.{i}.anywhere_at_m: the yard must have free ground on which the robot fits"


def _signal_errors(scenario: Scenario) -> Iterator[str]:
    """Check rates against limits of memory and time, levels against the noise, and frequencies of carriers."""
    receiver, unit = scenario.receiver, f"V with its range, {MAX_PEAK_OVER_NOISE:g} times the noise"
    pulses_hz, rate_hz, pulse_s = receiver.false_alarm_rate_hz, receiver.sample_rate_hz, 12e-9
    for key, emitters in (("interferers", scenario.interferers), ("sources", scenario.grown_sources)):
        for i, item in enumerate(emitters):
            pulses_hz += item.max_pulse_rate_hz
            yield from _at_most(
                f"{key}.{i}.amplitude_v", item.max_amplitude_v, MAX_PEAK_OVER_NOISE * receiver.noise_v, unit
            )
    key = "sources, interferers, receiver.false_alarm_rate_hz"
    yield from _at_most(key, pulses_hz * scenario.task.time_limit_s, MAX_PULSES, "pulses within task.time_limit_s")
    nyquist_hz = 0.5 * rate_hz
    width_hz = nyquist_hz if receiver.band_hz == "all" else receiver.band_hz[1] - receiver.band_hz[0]
    ringing = 12.0 * rate_hz / width_hz  # measured
    n_samples = receiver.gate_samples + ringing + (pulse_s + receiver.longest_echo_s) * rate_hz
    samples_hz = pulses_hz * scenario.array.n_channels * n_samples
    yield from _at_most(key, samples_hz, MAX_SAMPLES_PER_S, "computed samples per second, by rate, gate, band, echoes")
    for i, carrier in enumerate(scenario.carriers):
        if carrier.frequency_hz >= nyquist_hz:
            yield (
                f"carriers.{i}.frequency_hz: must be below half of receiver.sample_rate_hz, {nyquist_hz:g}, got "
                f"{carrier.frequency_hz:g}"
            )
    most_v = MAX_CARRIERS_OVER_NOISE * receiver.noise_v * sqrt(width_hz / nyquist_hz)
    sum_v = sum(carrier.amplitude_v for carrier in scenario.carriers)
    unit = f"V together, {MAX_CARRIERS_OVER_NOISE:g} times the noise behind the band-pass"
    yield from _at_most("carriers", sum_v, most_v, unit)
