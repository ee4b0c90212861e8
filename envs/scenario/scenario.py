"""The scenario: all settings of a mission."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Discriminator, Field, Tag, model_validator

from dirmusic import ArrayModel
from pdpatrol.envs.scenario.array import ArraySection, data_sheet
from pdpatrol.envs.scenario.base import Config, MissionName
from pdpatrol.envs.scenario.checks import scenario_errors
from pdpatrol.envs.scenario.locating import EstimatorConfig, LocatingConfig
from pdpatrol.envs.scenario.map import GeoreferenceConfig, MapConfig
from pdpatrol.envs.scenario.radio import RadioConfig
from pdpatrol.envs.scenario.robot import BatteryConfig, LidarConfig, OdometryConfig, PoseSensorConfig, RobotConfig
from pdpatrol.envs.scenario.sources import CampaignConfig, CarrierConfig, InterfererConfig, SourceConfig
from pdpatrol.robot_models.yard.quantities import MOST_YARD_M, Coordinate
from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing import ReceiverConfig
from pdpatrol.sensing.quantities import PLAIN_ZERO, Degree

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
    def is_planned(self) -> bool:
        """Whether a mission plans its own waypoints."""
        return self.waypoints_m == PLANNED

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
        return tuple(dict.fromkeys(site for entry in source.sites for site in self.expand_site(entry)))

    def expand_site(self, entry: str) -> list[str]:
        """Return the sites that `equipment/*` stands for; any other entry stands for itself."""
        if not entry.endswith("/*"):
            return [entry]
        return [site for site in self.yard.site_names() if site.partition("/")[0] == entry[:-2]]

    @model_validator(mode="after")
    def _check_combinations(self) -> Self:
        if errors := scenario_errors(self):  # pyright: ignore[reportArgumentType] - the same class by another path
            raise ValueError("\n".join(errors))
        return self
