"""Robots from MJCF files: reading, checks and measures.

A file describes one robot without a world around it, in the frame of its body `base`: x forward, y left, z up, origin
on the floor under the middle between left and right wheels. It holds

- the body `base`, a child of the world, with the free joint `floating_base`;
- one or more hinges on each side, about +y, whose names begin with `left_wheel` and `right_wheel`, in bodies with a
  geom that stands on the floor (conaffinity 1), all of one radius; and for each an actuator whose name begins the same
  way and which takes the speed of the wheel in rad/s: `<velocity>`, or `<dcmotor input="vel">`;
- the site `imu`, in the orientation of the base, with the sensor `gyro`; the site `lidar` above the x axis of the base,
  at the start of the beam that points ahead: the others start at the same distance from the origin;
- a hull: geoms that obstacles touch (conaffinity 2), and that cover the wheels as seen from above. All contype are 0;
- the custom numerics `max_speed`, m/s, `max_yaw_rate`, rad/s, `max_acceleration`, m/s^2, each above 0; and
  `yaw_rate_gain`, 1/s, for a robot with feedback of its gyro on the yaw rate, because its wheels skid when it turns;
- a keyframe `home` in which it rests at the origin; without one, it is simulated until it rests when it is loaded.

Lidar beams, contact sensors of the hull and antenna elements are added when a world is built: see `world.py`.

After a change of the file of a shipped robot, measure it again: `uv run python -m
pdpatrol.robot_models.description.robot_file`.
"""
# pyright: reportAttributeAccessIssue=false
# The compiled bindings of MuJoCo carry no types for their enums and spec elements.

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from functools import cache
from pathlib import Path

import mujoco
import numpy as np

from pdpatrol.robot_models.antenna_elements import MAX_ELEMENTS, AntennaElements
from pdpatrol.robot_models.description import robot_parts as parts
from pdpatrol.robot_models.description.robot_description import (
    SHIPPED,
    RobotDescription,
    RobotFileError,
    Wheel,
    is_path,
    xml_path,
)
from pdpatrol.robot_models.description.robot_measures import SPIN_RADPS, SPIN_S, Measures, measure
from pdpatrol.robot_models.sensors import LIDAR_PERIOD_S
from pdpatrol.robot_models.world import build_spec
from pdpatrol.robot_models.yard.yard import ROBOT_HEIGHT_M, Yard

TOLERANCE_M = 0.005
"""Tolerance of positions (assumed)."""


def load_robot(model: str | Path) -> RobotDescription:
    """Load the description of a robot.

    Args:
        model: Name of a shipped robot, or path of an MJCF file, which is then read and measured.

    Raises:
        RobotFileError: If the name is unknown, or the file does not describe one; all errors are listed.
    """
    if is_path(model):
        return read_robot(Path(model))
    if str(model) not in SHIPPED:
        raise RobotFileError([f"{model}: must be one of {', '.join(SHIPPED)}, or the path of an MJCF file, in .xml"])
    return _shipped(str(model))


@cache
def _shipped(name: str) -> RobotDescription:
    path = xml_path(name)
    record = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
    record["wheels"] = tuple(Wheel(**wheel) for wheel in record["wheels"])
    record["home_qpos"] = tuple(record["home_qpos"])
    return RobotDescription(name=name, xml_path=path, **record)


def write_record(robot: RobotDescription) -> None:
    """Store the measures of a robot next to its file."""
    record = {key: value for key, value in asdict(robot).items() if key not in ("name", "xml_path")}
    record["wheels"] = [wheel._asdict() for wheel in robot.wheels]
    text = json.dumps(record, indent=2) + "\n"
    robot.xml_path.with_suffix(".json").write_text(text, encoding="utf-8")


def read_robot(path: Path) -> RobotDescription:
    """Read and measure a robot; see this module for the contents of its file.

    Raises:
        RobotFileError: If the file cannot be read, or does not describe a robot; all errors are listed.
    """
    if not path.is_file():
        raise RobotFileError([f"{path}: no such file; it must be an MJCF file"])
    with _collected_warnings() as warnings:
        robot = _read(path)
    if warnings:
        raise RobotFileError([f"{path}: MuJoCo warns: {_one_line(warning)}" for warning in warnings])
    return robot


@contextmanager
def _collected_warnings() -> Iterator[list[str]]:
    """Collect the warnings of MuJoCo, which it would print and write to a log file otherwise."""
    warnings: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(warnings.append)
    try:
        yield warnings
    finally:
        mujoco.set_mju_user_warning(before)


def _read(path: Path) -> RobotDescription:
    try:
        spec = mujoco.MjSpec.from_file(str(path))
    except ValueError as error:
        raise RobotFileError([f"{path}: not MJCF: {_one_line(error)}"]) from None
    errors, model = list(parts.part_errors(spec)), None
    try:
        model = spec.compile()
    except ValueError as error:
        errors.append(f"refused by MuJoCo: {_one_line(error)}")
    if model is None or errors:
        raise RobotFileError([f"{path}: {error}" for error in errors])
    wheels = parts.wheels_of(spec)
    measures = measure(spec, model, wheels)
    robot = _describe(path, spec, wheels, measures)
    errors = [
        *_wheel_errors(robot, measures),
        *_speed_errors(robot, measures, model),
        *_body_errors(robot, measures),
        *_world_errors(robot),
    ]
    if errors:
        raise RobotFileError([f"{path}: {error}" for error in errors])
    return robot


def _world_errors(robot: RobotDescription) -> Iterator[str]:
    """Yield a line if no world can be built around the robot, for example because of a name that the world needs."""
    try:
        elements = AntennaElements(np.zeros((MAX_ELEMENTS, 3)), *np.zeros((2, MAX_ELEMENTS)))
        build_spec(robot, Yard(size_m=(5.0, 5.0)), elements).compile()
    except ValueError as error:
        yield f"world: cannot be built around the robot: {_one_line(error)}"


def _one_line(error: ValueError | str) -> str:
    return " ".join(str(error).removeprefix("Error: ").split())


def _describe(path: Path, spec: mujoco.MjSpec, wheels: tuple[Wheel, ...], measures: Measures) -> RobotDescription:
    return RobotDescription(
        name=path.stem,
        xml_path=path,
        wheels=wheels,
        home_qpos=tuple(measures.home.tolist()),
        wheel_radius_m=float(measures.radius_m[0]),
        track_m=measures.track_m,
        turning_track_m=measures.turning_track_m,
        footprint_radius_m=float(measures.outline_m.max()),
        inner_radius_m=float(measures.hull_m.min()),
        height_m=measures.top_m,
        max_speed_mps=parts.limit_of(spec, "max_speed"),
        max_yaw_rate_radps=parts.limit_of(spec, "max_yaw_rate"),
        max_acceleration_mps2=parts.limit_of(spec, "max_acceleration"),
        yaw_rate_gain=parts.limit_of(spec, "yaw_rate_gain"),
        lidar_start_m=float(measures.lidar_m[0]),
        lidar_height_m=float(measures.lidar_m[2]),
    )


def _wheel_errors(robot: RobotDescription, measures: Measures) -> Iterator[str]:
    rows = zip(robot.wheels, measures.axis, measures.radius_m, measures.place_m, strict=True)
    for wheel, axis, radius_m, place_m in rows:
        if not np.allclose(axis, [0.0, 1.0, 0.0], atol=1e-3):
            shown = " ".join(f"{value:.3g}" for value in axis.tolist())
            yield f"{wheel.joint}: axis must be 0 1 0, so that a positive speed drives forward, got {shown}"
        if abs(radius_m - robot.wheel_radius_m) > TOLERANCE_M:
            yield (
                f"{wheel.joint}: radius must be that of {robot.wheels[0].joint}, {robot.wheel_radius_m:.3f} m, "
                f"got {radius_m:.3f} m"
            )
        if abs(place_m[2] - radius_m) > TOLERANCE_M:
            yield (
                f"{wheel.joint}: must stand at the height of the origin of the base, which lies on the floor; it is "
                f"{place_m[2] - radius_m:.3f} m above"
            )
    if not robot.track_m > 0:
        yield f"left_wheel: must be to the left of right_wheel, at a larger y; got {-robot.track_m:.3f} m to the right"
    else:
        sides_m = [measures.place_m[mask].mean(axis=0)[:2] for mask in (measures.is_left, ~measures.is_left)]
        x, y = (0.5 * (sides_m[0] + sides_m[1])).tolist()
        if max(abs(x), abs(y)) > TOLERANCE_M:
            yield f"base: the middle between its wheels must be its origin, got x {x:.3f} m, y {y:.3f} m"
    excess_m = float((measures.outline_m - measures.hull_m).max())
    if excess_m > TOLERANCE_M:
        yield f"hull: must cover wheels and casters, which extend beyond it by {excess_m:.3f} m"


def _speed_errors(robot: RobotDescription, measures: Measures, model: mujoco.MjModel) -> Iterator[str]:
    needed = robot.max_speed_mps + 0.5 * robot.turning_track_m * robot.max_yaw_rate_radps
    needed_radps = needed / robot.wheel_radius_m
    for wheel, spin_radps in zip(robot.wheels, measures.spin_radps.tolist(), strict=True):
        if not abs(spin_radps - SPIN_RADPS) <= 0.05 * SPIN_RADPS:
            yield (
                f"{wheel.actuator}: must be a servo that takes the speed of the wheel, <velocity> or "
                f'<dcmotor input="vel">; {SPIN_S:g} s after {SPIN_RADPS:g} rad/s was commanded in the air, its wheel '
                f"turns at {spin_radps:.3g} rad/s"
            )
        actuator = model.actuator(wheel.actuator)
        if actuator.ctrllimited[0] and not (-actuator.ctrlrange[0] >= needed_radps <= actuator.ctrlrange[1]):
            low, high = actuator.ctrlrange.tolist()
            yield (
                f"{wheel.actuator}: ctrlrange must hold {-needed_radps:.3g} to {needed_radps:.3g}, which "
                f"max_speed and max_yaw_rate need together, got {low:g} {high:g}"
            )


def _body_errors(robot: RobotDescription, measures: Measures) -> Iterator[str]:
    if robot.height_m > ROBOT_HEIGHT_M:
        yield (
            f"hull: must be at most {ROBOT_HEIGHT_M} m high, because paths are planned below equipment that begins "
            f"higher, got {robot.height_m:.2f} m"
        )
    x, y, z = measures.lidar_m.tolist()
    if abs(y) > 1e-6 or not 0.0 <= x <= robot.inner_radius_m + 1e-6 or not 0.0 < z <= robot.height_m:
        yield (
            f"{parts.LIDAR}: must have x from 0 to {robot.inner_radius_m:.3f}, within the hull, y 0, and z from the "
            f"floor to {robot.height_m:.2f}, got {x:g} {y:g} {z:g}"
        )
    if not np.allclose(np.abs(measures.imu_quat), [1.0, 0.0, 0.0, 0.0], atol=1e-3):
        yield f"{parts.IMU}: must have the orientation of the base"
    steps = LIDAR_PERIOD_S / measures.timestep_s
    if steps < 1 or abs(steps - round(steps)) > 1e-6:
        yield (
            f"option: timestep must be a whole fraction of {LIDAR_PERIOD_S} s, the time between two commands, got "
            f"{measures.timestep_s:g} s"
        )
    if not (
        measures.home_tilt_rad <= np.radians(10.0)
        and measures.home_radps <= 0.05
        and np.abs(measures.home_base[:2]).max() <= TOLERANCE_M
    ):
        yield f"{parts.HOME}: the robot must stand by itself, upright and at rest at the origin"


if __name__ == "__main__":
    for name in SHIPPED:
        write_record(read_robot(xml_path(name)))
