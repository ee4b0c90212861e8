"""A scenario: everything that a mission needs to be told, and the strict loader of its TOML file.

Composes the configurations that each package owns. Needs neither MuJoCo nor Rerun, so that a wrong file is refused
at once.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, Self, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, NonNegativeFloat, PositiveFloat, PositiveInt, ValidationError, model_validator

from dirmusic import InputFileError
from dirmusic.discharge_kinds import KindName
from envs.battery import BatteryConfig
from envs.lidar import LidarConfig
from envs.odometry import OdometryConfig
from envs.pose_sensor import PoseSensorConfig
from robot_models.yard import Yard
from sensing import ArrayConfig, ReceiverConfig
from sensing.materials import KIND_MATERIALS

FloatArray = NDArray[np.float64]
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]

SHIPPED = Path(__file__).parent / "scenarios"

ROBOT_CLEARANCE_M = 0.25
"""Free ground that a waypoint needs around it: the chassis radius of 0.20 m and a little."""


class ScenarioError(InputFileError):
    """A scenario that cannot be used; one line per fault, each with file, key, what came and what is allowed."""


class _Config(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """Frozen, strict, closed to unknown keys and to NaN."""


class SourceConfig(_Config, frozen=True):
    """A discharge on a site drawn from `sites` (`equipment/site`, or `equipment/*` for all of it), or at a position."""

    name: Name
    sites: tuple[str, ...] = ()
    position_m: tuple[float, float, float] | None = None
    anywhere_at_m: PositiveFloat | None = None
    """It hangs at this height over some free ground, which is drawn per mission."""
    amplitude_v: PositiveFloat = 0.27
    """Peak of a pulse in a unit-gain channel 1 m away. The default puts the bearing bound of one pulse at 0.44 degrees
    from 5 m and 1.3 degrees from 15 m, with the default receiver."""
    amplitude_range_db: NonNegativeFloat = 6.0
    """Width of the range, centred on `amplitude_v`, from which the amplitude is drawn per mission."""
    pulse_rate_hz: float = Field(default=20.0, ge=0.0, le=1e4)
    kind: KindName | None = None
    """How its pulses lie over the phase of the mains; left out, they come at any phase."""
    conductor_deg: float | None = Field(default=None, ge=-360.0, le=360.0)
    """Phase of its conductor against the receiver's mains; left out, 0, 120 or 240 is drawn per mission."""
    active_s: tuple[NonNegativeFloat, PositiveFloat] | None = None
    """From when to when it discharges; left out, always."""
    drift_db_per_min: float = Field(default=0.0, ge=-60.0, le=60.0)
    n_shots: PositiveInt | None = None
    """A discharge gun: this many pulses, evenly at the pulse rate from `first_shot_s` on, and then no more."""
    first_shot_s: NonNegativeFloat = 0.0

    @model_validator(mode="after")
    def _stops_after_it_starts(self) -> Self:
        if self.active_s is not None and self.active_s[0] >= self.active_s[1]:
            raise ValueError(f"active_s: got {self.active_s}; allowed is a start before the end")
        if self.kind is not None and self.n_shots is not None:
            raise ValueError("kind, n_shots: both given; allowed is one: a gun fires at no phase of the mains")
        return self

    @model_validator(mode="after")
    def _fires_at_some_rate(self) -> Self:
        if self.n_shots is not None and self.pulse_rate_hz == 0:
            raise ValueError("pulse_rate_hz: got 0; allowed is above 0, or the shots never come")
        return self

    @model_validator(mode="after")
    def _is_somewhere(self) -> Self:
        given = [key for key in ("sites", "position_m", "anywhere_at_m") if getattr(self, key) not in (None, ())]
        if len(given) != 1:
            came = " and ".join(given) or "none of them"
            raise ValueError(f"sites, position_m, anywhere_at_m: {came} given; allowed is one of them")
        return self


class InterfererConfig(_Config, frozen=True):
    """Something impulsive beyond the fence that is heard like a discharge and must not become a finding."""

    name: Name
    position_m: tuple[float, float, float]
    amplitude_v: PositiveFloat
    amplitude_range_db: NonNegativeFloat = 6.0
    pulse_rate_hz: float = Field(default=20.0, ge=0.0, le=1e4)
    burst_s: NonNegativeFloat = 0.0
    """Length of each burst of a carrier in the band, as from a switch or a radar; 0 for impulses like discharges."""


class CarrierConfig(_Config, frozen=True):
    """A narrowband transmitter far away, such as the 948 MHz that the Dir-MUSIC paper met; on all the time."""

    name: Name
    frequency_hz: PositiveFloat = 948e6
    amplitude_v: PositiveFloat
    """Peak in a unit-gain channel at the array, before the band-pass."""
    bearing_deg: float = Field(ge=-360.0, le=360.0)
    """Direction it comes from, counter-clockwise from x (east)."""


class RouteConfig(_Config, frozen=True):
    """Where the robot lives and what it patrols. Without waypoints it stands at its dock and listens."""

    dock_m: tuple[float, float]
    dock_yaw_deg: float | None = Field(default=None, ge=-360.0, le=360.0)
    """Heading at the start, counter-clockwise from x; left out, it is drawn per mission."""
    waypoints_m: tuple[tuple[float, float], ...] = ()


class TaskConfig(_Config, frozen=True):
    """What counts as done, and how long it may take; the defaults are assumed."""

    time_limit_s: float = Field(default=600.0, gt=0.0, le=86_400.0)
    standoff_m: PositiveFloat = 2.5
    """A source is approached when the robot is within this horizontal distance."""
    waypoint_radius_m: PositiveFloat = 0.6
    """A waypoint, or the dock, is reached within this distance."""


class Scenario(_Config, frozen=True):
    """A yard, a route, what discharges in it, and how good robot and array are."""

    name: str
    yard: Yard
    route: RouteConfig
    array: ArrayConfig
    sources: tuple[SourceConfig, ...] = ()
    interferers: tuple[InterfererConfig, ...] = ()
    carriers: tuple[CarrierConfig, ...] = ()
    receiver: ReceiverConfig = ReceiverConfig()
    pose_sensor: PoseSensorConfig = PoseSensorConfig()
    lidar: LidarConfig = LidarConfig()
    odometry: OdometryConfig = OdometryConfig()
    battery: BatteryConfig = BatteryConfig()
    task: TaskConfig = TaskConfig()

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
            *self._route_faults(),
            *self._source_faults(),
            *self._interferer_faults(),
            *self._receiver_faults(),
        ]
        if faults:
            raise ValueError("\n".join(faults))
        return self

    def _equipment_faults(self) -> list[str]:
        return [
            f"yard.equipment.{i}.kind: no kind `{item.kind}`; allowed are {', '.join(KIND_MATERIALS)}"
            for i, item in enumerate(self.yard.equipment)
            if item.kind not in KIND_MATERIALS
        ]

    def _receiver_faults(self) -> list[str]:
        n, faults = self.array.n_elements, list[str]()
        channels = [fault.channel for fault in self.receiver.faults]
        for i, fault in enumerate(self.receiver.faults):
            for key, channel in (("channel", fault.channel), ("other", fault.other or 1)):
                if channel > n:
                    faults.append(f"receiver.faults.{i}.{key}: got {channel}; allowed is 1 to {n}")
            if channels.index(fault.channel) != i:
                faults.append(f"receiver.faults.{i}.channel: {fault.channel} has a fault already; allowed is one each")
        return faults

    def _route_faults(self) -> list[str]:
        stops = {"route.dock_m": self.route.dock_m}
        stops |= {f"route.waypoints_m.{i}": point for i, point in enumerate(self.route.waypoints_m)}
        faults: list[str] = []
        for key, point in stops.items():
            inside = self.yard.covering_equipment(point)
            if not self.yard.contains(point):
                faults.append(f"{key}: {point} is outside the yard; allowed is (0, 0) to {self.yard.size_m}")
            elif inside is not None:
                faults.append(f"{key}: {point} is inside equipment `{inside}`; allowed is free ground")
            elif self.yard.clearance(point) < ROBOT_CLEARANCE_M:
                faults.append(
                    f"{key}: {point} is {self.yard.clearance(point):.2f} m from equipment or fence; "
                    f"allowed is {ROBOT_CLEARANCE_M} m or more, or the robot does not fit"
                )
        return faults

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
        return [
            f"interferers.{i}.position_m: {item.position_m} is inside the yard; allowed is beyond the fence of "
            f"{self.yard.size_m} (inside, make it one of [[sources]])"
            for i, item in enumerate(self.interferers)
            if self.yard.contains(item.position_m)
        ]


def shipped_scenarios() -> tuple[str, ...]:
    """Names of the scenarios that come with the package."""
    return tuple(sorted(path.stem for path in SHIPPED.glob("*.toml")))


def load_scenario(scenario: str | Path | Scenario) -> Scenario:
    """A scenario by the name of a shipped one, from a TOML file, or as it is.

    Raises:
        ScenarioError: If there is no such scenario or file, or the file has faults; all of them are listed.
    """
    if isinstance(scenario, Scenario):
        return scenario
    path = Path(scenario)
    if path.suffix != ".toml" and path.name == str(scenario):
        if path.name not in shipped_scenarios():
            raise ScenarioError(
                [
                    f"{scenario}: no such scenario; known are {', '.join(shipped_scenarios())}, "
                    "or give a path ending in .toml"
                ]
            )
        path = SHIPPED / f"{scenario}.toml"
    data = _read(path)
    try:
        return Scenario.model_validate({"name": path.stem, **data})
    except ValidationError as error:
        raise ScenarioError(_faults(path, error)) from None


def _read(path: Path) -> dict[str, Any]:
    try:
        text = path.read_bytes().decode("utf-8")
    except UnicodeDecodeError as error:
        raise ScenarioError([f"{path}: byte {error.start} is not UTF-8 text; a scenario is a TOML text file"]) from None
    except OSError as error:
        raise ScenarioError([f"{path}: cannot be read ({error.strerror}); give a TOML file"]) from None
    try:
        return {key: _as_tuples(value) for key, value in tomllib.loads(text).items()}
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise ScenarioError([f"{path}: not TOML: {error}"]) from None


def _as_tuples(value: Any) -> Any:  # noqa: ANN401 - TOML holds values of many types
    """TOML arrays as tuples, which the strict models want."""
    if isinstance(value, list):
        return tuple(_as_tuples(item) for item in value)
    if isinstance(value, dict):
        return {key: _as_tuples(item) for key, item in value.items()}
    return value


def _faults(path: Path, error: ValidationError) -> list[str]:
    """One line per fault: file, key path, what came, what is allowed."""
    lines: list[str] = []
    for item in error.errors(include_url=False):
        parts = [str(part) for part in item["loc"] if part not in ("box", "cylinder", "catalogue", "[key]")]
        key = ".".join(parts)
        if item["type"] == "value_error":  # our own checks, each line `key: what came; allowed is ...`
            prefix = f"{key}." if key else ""
            lines += [
                f"{path}: {prefix}{line}" for line in str(item.get("ctx", {}).get("error", item["msg"])).splitlines()
            ]
        elif item["type"] == "missing":
            lines.append(f"{path}: {key}: missing; it is required")
        elif item["type"] == "extra_forbidden":
            known = _known_keys(item["loc"])
            lines.append(f"{path}: {key}: unknown key; allowed are {', '.join(known)}")
        else:
            came = repr(item["input"])
            came = came if len(came) <= 60 else came[:57] + "..."
            lines.append(f"{path}: {key}: got {came}; {item['msg'][0].lower()}{item['msg'][1:]}")
    return lines


def _known_keys(location: tuple[int | str, ...]) -> list[str]:
    """Fields of the model in which the last part of `location` is unknown."""
    model: Any = Scenario
    for part in location[:-1]:
        model = _step_into(model, part)
    fields: Mapping[str, Any] = getattr(model, "model_fields", {})
    return [name for name in fields if not (model is Scenario and name == "name")]


def _step_into(annotation: Any, part: int | str) -> Any:  # noqa: ANN401 - walks type annotations
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation.model_fields[str(part)].annotation
    options = [option for option in get_args(annotation) if option is not Ellipsis]
    for option in options:
        bare = [getattr(o, "__origin__", o) if hasattr(o, "__metadata__") else o for o in (option, *get_args(option))]
        inner = [o for o in bare if isinstance(o, type) and issubclass(o, BaseModel)]
        for model in inner:
            tag = model.model_fields.get("shape")
            if isinstance(part, int) or (tag is not None and part in get_args(tag.annotation)):
                return option if isinstance(part, int) else model
    deeper = [_step_into(option, part) for option in options if get_args(option)]
    return next((found for found in deeper if found is not None), None)
