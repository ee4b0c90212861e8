"""A scenario: everything that a mission needs to be told.

Composes the configurations that each package owns. Of MuJoCo it needs no more than the robot's file, and Rerun not at
all, so that a wrong file is refused at once.
"""

from __future__ import annotations

from difflib import get_close_matches
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Discriminator, Field, Tag, model_validator

from pdpatrol.envs.scenario.array_section import ArraySection, data_sheet
from pdpatrol.envs.scenario.base import Config, MissionName
from pdpatrol.envs.scenario.calibration import CalibratedArray
from pdpatrol.envs.scenario.limits import growth_faults, level_faults, place_faults, pulse_faults
from pdpatrol.envs.scenario.locating import EstimatorConfig, LocatingConfig
from pdpatrol.envs.scenario.map_section import GeoreferenceConfig, MapConfig
from pdpatrol.envs.scenario.robot_config import RobotConfig
from pdpatrol.envs.scenario.robot_sensors import BatteryConfig, LidarConfig, OdometryConfig, PoseSensorConfig
from pdpatrol.envs.scenario.sources import CampaignConfig, CarrierConfig, InterfererConfig, SourceConfig
from pdpatrol.robot_models.yard.quantities import MOST_YARD_M, Coordinate
from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing import ReceiverConfig
from pdpatrol.sensing.quantities import PLAIN_ZERO, Degree
from pdpatrol.sensing.radio.materials import KIND_MATERIALS

FloatArray = NDArray[np.float64]


PLANNED = "planned"
"""In the place of waypoints: they are to be planned."""


def _is_word(value: object) -> str:
    return "[planned]" if isinstance(value, str) else "[given]"


MOST_WAYPOINTS = 1000
MOST_SOURCES = 64
"""Sources of a scenario, and interferers beyond its fence."""
MOST_CARRIERS = 16

Place = tuple[Coordinate, Coordinate]
Waypoints = Annotated[
    Annotated[tuple[Place, ...], Field(max_length=MOST_WAYPOINTS), Tag("[given]")]
    | Annotated[Literal["planned"], Tag("[planned]")],
    Discriminator(_is_word),
]
"""x, y of each, or `PLANNED`."""


Distance = Annotated[float, Field(ge=0.01, le=MOST_YARD_M), PLAIN_ZERO]
Reward = Annotated[float, Field(ge=-1e6, le=1e6), PLAIN_ZERO]


class RouteConfig(Config, frozen=True):
    """Where the robot lives and what it patrols. Without waypoints it stands at its dock and listens."""

    dock_m: Place
    dock_yaw_deg: Degree | None = None
    """Heading at the start, counter-clockwise from x; left out, it is drawn per mission."""
    waypoints_m: Waypoints = ()
    """In order; or `"planned"`: a mission plans them on the map when it starts, as `pdpatrol plan` does."""

    @property
    def stops_m(self) -> tuple[tuple[float, float], ...]:
        """The waypoints.

        Raises:
            ValueError: If they are still to be planned.
        """
        if self.waypoints_m == PLANNED:
            raise ValueError(
                f'route.waypoints_m: got "{PLANNED}", and nothing is planned here; allowed are points, as '
                "`pdpatrol plan` writes them or missions.planning.with_planned_route puts them in"
            )
        return self.waypoints_m


class TaskConfig(Config, frozen=True):
    """What counts as done, and how long it may take; the defaults are assumed."""

    time_limit_s: Annotated[float, Field(ge=0.1, le=86_400.0)] = 600.0
    standoff_m: Distance = 2.5
    """A source is approached when the robot is within this horizontal distance."""
    waypoint_radius_m: Distance = 0.6
    """A waypoint, or the dock, is reached within this distance."""
    reward_per_metre: Reward = 1.0
    """For every metre by which the robot came nearer to the nearest source not yet approached."""
    reward_per_second: Reward = -0.05
    """The default makes a second cost 5 cm of progress."""
    reward_per_contact_step: Reward = -1.0
    """For each control step in contact with anything but the floor; the default makes it cost a metre."""


class RadioConfig(Config, frozen=True):
    """What is told of how waves travel."""

    second_order: bool = False
    """Whether waves count that two walls mirror, one after the other; by a wall and the ground they always do. They are
    late and weak, and cost time."""


class Scenario(Config, frozen=True):
    """A yard, a route, what discharges in it, and how good robot and array are."""

    name: MissionName
    yard: Yard
    map: MapConfig = MapConfig()
    route: RouteConfig
    array: ArraySection
    estimator: EstimatorConfig = EstimatorConfig()
    robot: RobotConfig = Field(default_factory=RobotConfig)
    sources: tuple[SourceConfig, ...] = Field(default=(), max_length=MOST_SOURCES)
    interferers: tuple[InterfererConfig, ...] = Field(default=(), max_length=MOST_SOURCES)
    carriers: tuple[CarrierConfig, ...] = Field(default=(), max_length=MOST_CARRIERS)
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
        """The yard as the map has it, which is what robot and operator know: `yard` itself where they do not differ.

        Made anew on each call, so that a copy of the scenario with another yard has the map of that one: keep it.
        """
        return self.map.of(self.yard)

    @property
    def grown_sources(self) -> tuple[SourceConfig, ...]:
        """The sources as they are on the day of the inspection."""
        return tuple(source.after(self.campaign.weeks) for source in self.sources)

    def candidate_sites(self, source: SourceConfig) -> tuple[str, ...]:
        """The sites from which one is drawn for `source`, as `equipment/site`; empty for a source at a position."""
        known = self.yard.site_names()
        expanded = [
            [site for site in known if site.partition("/")[0] == entry[:-2]] if entry.endswith("/*") else [entry]
            for entry in source.sites
        ]
        return tuple(dict.fromkeys(site for group in expanded for site in group))

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        faults = [
            *self._equipment_faults(),
            *self.map.faults(self.yard),
            *self._route_faults(),
            *self._task_faults(),
            *self._source_faults(),
            *self._interferer_faults(),
            *self._receiver_faults(),
            *self._calibration_faults(),
            *(self.campaign.faults() or growth_faults(self.sources, self.campaign.weeks)),
        ]
        faults = faults or self._limit_faults()
        if faults:
            raise ValueError("\n".join(faults))
        return self

    def _equipment_faults(self) -> list[str]:
        return [
            f"{key}.{i}.kind: no kind `{item.kind}`; allowed are {', '.join(KIND_MATERIALS)}"
            for key, pieces in (("yard.equipment", self.yard.equipment), ("map.extra", self.map.extra))
            for i, item in enumerate(pieces)
            if item.kind not in KIND_MATERIALS
        ]

    def _task_faults(self) -> list[str]:
        side_m = min(self.yard.size_m)
        distances_m = {key: getattr(self.task, key) for key in ("standoff_m", "waypoint_radius_m")}
        return [
            f"task.{key}: got {distance_m:g}; allowed is less than the shorter side of the yard, {side_m:g}"
            for key, distance_m in distances_m.items()
            if distance_m >= side_m
        ]

    def _limit_faults(self) -> list[str]:
        """What only shows in all of it together, once each part is in order."""
        limit_s, sites = self.task.time_limit_s, [self.candidate_sites(source) for source in self.sources]
        sources = self.grown_sources
        return [
            *pulse_faults(sources, self.interferers, self.receiver, self.array.n_channels, limit_s),
            *level_faults(sources, self.interferers, self.carriers, self.receiver, limit_s),
            *place_faults(self.sources, sites, self.yard, self.robot.description.room_m),
        ]

    def _receiver_faults(self) -> list[str]:
        n, faults = self.array.n_channels, list[str]()
        channels = [fault.channel for fault in self.receiver.faults]
        for i, fault in enumerate(self.receiver.faults):
            for key, channel in (("channel", fault.channel), ("other", fault.other or 1)):
                if channel > n:
                    faults.append(f"receiver.faults.{i}.{key}: got {channel}; allowed is 1 to {n}")
            if channels.index(fault.channel) != i:
                faults.append(f"receiver.faults.{i}.channel: {fault.channel} has a fault already; allowed is one each")
        if self.estimator.method == "sub_bands" and self.receiver.n_bands == 0:
            faults.append("estimator.method: got sub_bands with receiver.n_bands 0; allowed are 1 to 8")
        return faults

    def _calibration_faults(self) -> list[str]:
        calibration, number = self.locating.calibration, self.array.serial_number
        if calibration is None:
            return []
        if number is None:
            return [
                "array.serial_number: none with a calibration, so that each mission has another array; allowed is that "
                "of the calibrated one"
            ]
        faults = calibration.faults(CalibratedArray.of(data_sheet(self.array), number))
        return [f"locating.calibration: {fault}" for fault in faults]

    def _route_faults(self) -> list[str]:
        stops = {"route.dock_m": self.route.dock_m}
        if self.route.waypoints_m != PLANNED:
            stops |= {f"route.waypoints_m.{i}": point for i, point in enumerate(self.route.stops_m)}
        known = self.yard if self.map.faults(self.yard) else self.known_yard
        return [
            f"{key}: {fault}"
            for key, point in stops.items()
            for fault in self._stop_faults(point, self.yard) or self._stop_faults(point, known, " on the map")
        ]

    def _stop_faults(self, point: tuple[float, float], yard: Yard, where: str = "") -> list[str]:
        inside, room_m = yard.covering_equipment(point), self.robot.description.room_m
        if not yard.contains(point):
            return [f"{point} is outside the yard; allowed is (0, 0) to {yard.size_m}"]
        if inside is not None:
            return [f"{point} is inside equipment `{inside}`{where}; allowed is free ground"]
        if yard.clearance(point) < room_m:
            return [
                f"{point} is {yard.clearance(point):.2f} m from equipment or fence{where}; "
                f"allowed is {room_m:.3g} m or more, or the robot does not fit"
            ]
        return []

    def _source_faults(self) -> list[str]:
        faults: list[str] = []
        known = self.yard.site_names()
        names = [source.name for source in (*self.sources, *self.interferers)]
        for index, source in enumerate(self.sources):
            key = f"sources.{index}"
            if names.count(source.name) > 1:
                faults.append(f"{key}.name: `{source.name}` is used {names.count(source.name)} times; allowed is once")
            if source.position_m is not None:
                faults += self._position_faults(f"{key}.position_m", np.array(source.position_m))
            for entry in source.sites:
                sites = [s for s in known if s.partition("/")[0] == entry[:-2]] if entry.endswith("/*") else [entry]
                if not sites or any(site not in known for site in sites):
                    near = get_close_matches(entry, known, n=3) or known[:12]
                    faults.append(
                        f"{key}.sites: no site `{entry}`; allowed are {', '.join(near) or 'none: no equipment has any'}"
                    )
                    continue
                for site in sites:
                    faults += self._position_faults(f"{key}.sites ({site})", self.yard.site_position(site))
        return faults

    def _position_faults(self, key: str, position_m: FloatArray) -> list[str]:
        shown = tuple(round(float(x), 3) for x in position_m)
        enclosing = self.yard.enclosing_equipment(position_m)
        if not self.yard.contains(position_m):
            return [f"{key}: {shown} is outside the yard; allowed is (0, 0) to {self.yard.size_m}"]
        if position_m[2] <= 0:
            return [f"{key}: {shown} is below ground; allowed is a height above 0 m"]
        if enclosing is not None:
            return [f"{key}: {shown} is enclosed by equipment `{enclosing}`; allowed is a surface or free air"]
        return []

    def _interferer_faults(self) -> list[str]:
        faults = list[str]()
        for i, item in enumerate(self.interferers):
            if self.yard.contains(item.position_m):
                faults.append(
                    f"interferers.{i}.position_m: {item.position_m} is inside the yard; allowed is beyond the fence of "
                    f"{self.yard.size_m} (inside, make it one of [[sources]])"
                )
            elif item.moves_to_m is not None and self.yard.is_crossed(item.position_m, item.moves_to_m):
                faults.append(
                    f"interferers.{i}.moves_to_m: the line from {item.position_m} to {item.moves_to_m} crosses the "
                    f"yard; allowed is a line beyond the fence of {self.yard.size_m}"
                )
        return faults
