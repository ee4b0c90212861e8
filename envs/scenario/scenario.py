"""The scenario: all settings of a mission."""

from __future__ import annotations

from difflib import get_close_matches
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Discriminator, Field, Tag, model_validator

from dirmusic import ArrayModel
from pdpatrol.envs.scenario.array import ArraySection, CalibratedArray, data_sheet
from pdpatrol.envs.scenario.base import Config, MissionName
from pdpatrol.envs.scenario.limits import growth_errors, level_errors, place_errors, pulse_errors
from pdpatrol.envs.scenario.locating import EstimatorConfig, LocatingConfig
from pdpatrol.envs.scenario.map import GeoreferenceConfig, MapConfig
from pdpatrol.envs.scenario.radio import RadioConfig
from pdpatrol.envs.scenario.robot import BatteryConfig, LidarConfig, OdometryConfig, PoseSensorConfig, RobotConfig
from pdpatrol.envs.scenario.sources import CampaignConfig, CarrierConfig, InterfererConfig, SourceConfig
from pdpatrol.robot_models.yard.quantities import MOST_YARD_M, Coordinate
from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing import ReceiverConfig
from pdpatrol.sensing.quantities import PLAIN_ZERO, Degree
from pdpatrol.sensing.radio.materials import KIND_MATERIALS

PLANNED = "planned"
"""Value of `waypoints_m` with which a mission plans its own waypoints."""

Place = tuple[Coordinate, Coordinate]
Waypoints = Annotated[
    Annotated[tuple[Place, ...], Field(max_length=1000), Tag("[given]")]
    | Annotated[Literal["planned"], Tag("[planned]")],
    Discriminator(lambda value: "[planned]" if isinstance(value, str) else "[given]"),
]
Distance = Annotated[float, Field(ge=0.01, le=MOST_YARD_M), PLAIN_ZERO]
Reward = Annotated[float, Field(ge=-1e6, le=1e6), PLAIN_ZERO]


class RouteConfig(Config, frozen=True):
    """Dock and patrol route of the robot. Without waypoints it stands at its dock and listens."""

    dock_m: Place
    dock_yaw_deg: Degree | None = None
    """Heading at the start, counter-clockwise from x; by default drawn per mission."""
    waypoints_m: Waypoints = ()
    """Waypoints in order, or `"planned"`: the mission plans them on the map when it starts, as `pdpatrol plan` does."""

    @property
    def stops_m(self) -> tuple[tuple[float, float], ...]:
        """Waypoints in order.

        Raises:
            ValueError: If they are still to be planned.
        """
        if self.waypoints_m == PLANNED:
            raise ValueError(
                f'route.waypoints_m: must be points, got "{PLANNED}"; write them with `pdpatrol plan` or '
                "missions.planning.with_planned_route"
            )
        return self.waypoints_m


class TaskConfig(Config, frozen=True):
    """Conditions of success, time limit and reward; all defaults are assumed."""

    time_limit_s: Annotated[float, Field(ge=0.1, le=86_400.0)] = 600.0
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


class Scenario(Config, frozen=True):
    """A yard, a route, the sources in it, and the properties of robot, array and receiver."""

    name: MissionName
    yard: Yard
    map: MapConfig = MapConfig()
    route: RouteConfig
    array: ArraySection
    estimator: EstimatorConfig = EstimatorConfig()
    robot: RobotConfig = Field(default_factory=RobotConfig)
    sources: tuple[SourceConfig, ...] = Field(default=(), max_length=64)
    interferers: tuple[InterfererConfig, ...] = Field(default=(), max_length=64)
    carriers: tuple[CarrierConfig, ...] = Field(default=(), max_length=16)
    receiver: ReceiverConfig = ReceiverConfig()
    radio: RadioConfig = RadioConfig()
    pose_sensor: PoseSensorConfig = PoseSensorConfig()
    lidar: LidarConfig = LidarConfig()
    odometry: OdometryConfig = OdometryConfig()
    battery: BatteryConfig = BatteryConfig()
    task: TaskConfig = TaskConfig()
    campaign: CampaignConfig = CampaignConfig()
    georeference: GeoreferenceConfig | None = None
    locating: LocatingConfig = LocatingConfig()

    @property
    def known_yard(self) -> Yard:
        """Yard as the map shows it, which is what robot and operator know. It is made anew on each access."""
        return self.map.of(self.yard)

    @property
    def known_array(self) -> ArrayModel:
        """Array as the robot knows it: its data sheet, or that with the errors of a calibration."""
        array, calibration = data_sheet(self.array, self.receiver.band_edges_hz), self.locating.calibration
        return array if calibration is None else calibration.applied_to(array)

    @property
    def grown_sources(self) -> tuple[SourceConfig, ...]:
        """Sources as they are on the day of the inspection."""
        return tuple(source.after(self.campaign.weeks) for source in self.sources)

    def candidate_sites(self, source: SourceConfig) -> tuple[str, ...]:
        """Return the sites, `equipment/site`, from which the place of a source is drawn; empty if it has a position."""
        return tuple(dict.fromkeys(site for entry in source.sites for site in self._expand(entry)))

    def _expand(self, entry: str) -> list[str]:
        """Return the sites that `equipment/*` stands for; any other entry stands for itself."""
        if not entry.endswith("/*"):
            return [entry]
        return [site for site in self.yard.site_names() if site.partition("/")[0] == entry[:-2]]

    @model_validator(mode="after")
    def _check_combinations(self) -> Self:
        errors = [
            *self._equipment_errors(),
            *self.map.errors(self.yard),
            *self._route_errors(),
            *self._task_errors(),
            *self._source_errors(),
            *self._interferer_errors(),
            *self._receiver_errors(),
            *self._calibration_errors(),
            *growth_errors(self.sources, self.campaign.weeks),
        ]
        errors = errors or self._limit_errors()
        if errors:
            raise ValueError("\n".join(errors))
        return self

    @property
    def _size(self) -> str:
        return "{:g} x {:g} m".format(*self.yard.size_m)

    def _equipment_errors(self) -> list[str]:
        return [
            f"{key}.{i}.kind: no kind `{item.kind}`; known are {', '.join(KIND_MATERIALS)}"
            for key, pieces in (("yard.equipment", self.yard.equipment), ("map.extra", self.map.extra))
            for i, item in enumerate(pieces)
            if item.kind not in KIND_MATERIALS
        ]

    def _task_errors(self) -> list[str]:
        side_m = min(self.yard.size_m)
        return [
            f"task.{key}: must be less than the shorter side of the yard, {side_m:g}, got {distance_m:g}"
            for key in ("standoff_m", "waypoint_radius_m")
            if (distance_m := getattr(self.task, key)) >= side_m
        ]

    def _limit_errors(self) -> list[str]:
        """Check limits that need every table to be valid."""
        limit_s, sites = self.task.time_limit_s, [self.candidate_sites(source) for source in self.sources]
        sources = self.grown_sources
        return [
            *pulse_errors(sources, self.interferers, self.receiver, self.array.n_channels, limit_s),
            *level_errors(sources, self.interferers, self.carriers, self.receiver, limit_s),
            *place_errors(self.sources, sites, self.yard, self.robot.description.room_m),
        ]

    def _receiver_errors(self) -> list[str]:
        n, errors = self.array.n_channels, list[str]()
        channels = [fault.channel for fault in self.receiver.faults]
        for i, fault in enumerate(self.receiver.faults):
            for key, channel in (("channel", fault.channel), ("other", fault.other or 1)):
                if channel > n:
                    errors.append(f"receiver.faults.{i}.{key}: must be a channel from 1 to {n}, got {channel}")
            if channels.index(fault.channel) != i:
                errors.append(f"receiver.faults.{i}.channel: must have one fault only, got {fault.channel} again")
        if self.estimator.method == "sub_bands" and self.receiver.n_bands == 0:
            errors.append("estimator.method: sub_bands needs receiver.n_bands from 1 to 8, got 0")
        return errors

    def _calibration_errors(self) -> list[str]:
        calibration, number = self.locating.calibration, self.array.serial_number
        if calibration is None:
            return []
        if number is None:
            return ["array.serial_number: is required with a calibration; without it each mission draws another array"]
        mismatch = calibration.mismatch(CalibratedArray.of(data_sheet(self.array), number))
        return [f"locating.calibration: {mismatch}"] if mismatch else []

    def _route_errors(self) -> list[str]:
        stops = {"route.dock_m": self.route.dock_m}
        if self.route.waypoints_m != PLANNED:
            stops |= {f"route.waypoints_m.{i}": point for i, point in enumerate(self.route.stops_m)}
        known = self.yard if self.map.errors(self.yard) else self.known_yard
        found = {
            key: self._stop_error(point, self.yard) or self._stop_error(point, known, " on the map")
            for key, point in stops.items()
        }
        return [f"{key}: {error}" for key, error in found.items() if error]

    def _stop_error(self, point: tuple[float, float], yard: Yard, where: str = "") -> str | None:
        room_m, covering = self.robot.description.room_m, yard.covering_equipment(point)
        if not yard.contains(point):
            return f"must lie inside the yard ({self._size}), got {point}"
        if covering is not None:
            return f"must lie on free ground, got {point} inside equipment `{covering}`{where}"
        clearance_m = float(yard.clearance(point))
        if clearance_m < room_m:
            return (
                f"must be {room_m:.3g} m or more from equipment and fence, so that the robot fits, got {point}, which "
                f"is {clearance_m:.2f} m away{where}"
            )
        return None

    def _source_errors(self) -> list[str]:
        errors, known = list[str](), self.yard.site_names()
        names = [source.name for source in (*self.sources, *self.interferers)]
        for i, source in enumerate(self.sources):
            if names.count(source.name) > 1 and names.index(source.name) == i:
                errors.append(f"sources.{i}.name: must be used once, got `{source.name}` more than once")
            places = {f"sources.{i}.position_m": source.position_m} if source.position_m is not None else {}
            for entry in source.sites:
                sites = self._expand(entry)
                if sites and all(site in known for site in sites):
                    places |= {f"sources.{i}.sites ({site})": self.yard.site_position(site) for site in sites}
                else:
                    near = get_close_matches(entry, known, n=3) or known[:12]
                    errors.append(f"sources.{i}.sites: no site `{entry}`; known are {', '.join(near) or 'none'}")
            found = {key: self.position_error(place) for key, place in places.items()}
            errors += [f"{key}: {error}" for key, error in found.items() if error]
        return errors

    def position_error(self, position_m: ArrayLike) -> str | None:
        """Describe why a source cannot be at a position (x, y, z); None if it can."""
        x, y, z = (float(value) for value in np.asarray(position_m))
        shown = round(x, 3), round(y, 3), round(z, 3)
        enclosing = self.yard.enclosing_equipment(position_m)
        if not self.yard.contains(position_m):
            return f"must lie inside the yard ({self._size}), got {shown}"
        if z <= 0.0:
            return f"must lie above the ground, got {shown}"
        if enclosing is not None:
            return f"must not lie inside equipment `{enclosing}`, got {shown}"
        return None

    def _interferer_errors(self) -> list[str]:
        errors = list[str]()
        for i, item in enumerate(self.interferers):
            if self.yard.contains(item.position_m):
                errors.append(
                    f"interferers.{i}.position_m: must lie outside the yard ({self._size}), got {item.position_m}; "
                    "inside it, use [[sources]]"
                )
            elif item.moves_to_m is not None and self.yard.is_crossed(item.position_m, item.moves_to_m):
                errors.append(
                    f"interferers.{i}.moves_to_m: the path must not cross the yard ({self._size}), got "
                    f"{item.position_m} to {item.moves_to_m}"
                )
        return errors
