"""Robots from MJCF files: what a file must hold, and what is measured of it.

A file describes one robot without a world around it, in the frame of its body `base`: x forward, y left, z up, origin
on the floor under the middle between left and right wheels. It holds

- the body `base`, right below the world, with the free joint `floating_base`;
- hinges whose names are or begin with `left_wheel` and `right_wheel`, one or more a side, about +y, in bodies with a
  geom that stands on the floor (conaffinity 1), all of one radius; and for each an actuator, of a name that begins
  likewise, that takes the speed of the wheel in rad/s: `<velocity>`, or `<dcmotor input="vel">`;
- the site `imu`, in the orientation of the base, and at it the sensor `gyro`; the site `lidar` above the x axis of the
  base, where the beam that looks ahead starts: the others start all round, as far from the origin;
- a hull: geoms that obstacles meet (conaffinity 2), and that cover the wheels as seen from above. All contype are 0;
- the custom numerics `max_speed`, m/s, `max_yaw_rate`, rad/s, `max_acceleration`, m/s^2, each above 0; and
  `yaw_rate_gain`, 1/s, for a robot that closes its yaw rate on its gyro, because its wheels skid when it turns;
- a keyframe `home` in which it rests at the origin; without one, it is let come to rest when it is loaded.

Lidar beams, contact sensors of the hull and antenna elements are added by whoever builds a world: see `world.py`.
"""
# pyright: reportAttributeAccessIssue=false
# The compiled bindings of MuJoCo carry no types for their enums and spec elements.

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import mujoco
import numpy as np

from pdpatrol.robot_models.antenna.elements import MAX_ELEMENTS, AntennaElements
from pdpatrol.robot_models.description import robot_parts as parts
from pdpatrol.robot_models.description.robot_description import RobotDescription, RobotFileError, Wheel
from pdpatrol.robot_models.description.robot_measures import SPIN_RADPS, SPIN_S, Measures, measure
from pdpatrol.robot_models.world import build_spec
from pdpatrol.robot_models.yard.yard import ROBOT_HEIGHT_M, Yard

TOLERANCE_M = 0.005
"""By how much places may be off (assumed)."""

CONTROL_STEP_S = 0.1
"""Commands change, and the lidar scans, as often; a whole number of physics steps fits in."""

SPIN_SHARE = 0.05
"""By how much the speed of a wheel in the air may miss its command (assumed)."""

REST_TILT_RAD = np.radians(10.0)
REST_RADPS = 0.05
"""A robot at rest tilts, and moves, by no more (assumed)."""


def read_robot(path: Path) -> RobotDescription:
    """Read and measure a robot; see this module for what its file has to hold.

    Raises:
        RobotFileError: If the file cannot be read, or does not describe a robot; all faults are listed.
    """
    if not path.is_file():
        raise RobotFileError([f"{path}: no such file; give an MJCF file"])
    with _collected_warnings() as warnings:
        robot = _read(path)
    if warnings:
        raise RobotFileError([f"{path}: MuJoCo warns: {_one_line(warning)}" for warning in warnings])
    return robot


@contextmanager
def _collected_warnings() -> Iterator[list[str]]:
    """What MuJoCo warns of, which it would print and write to a file of its own otherwise."""
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
    faults, model = list(parts.part_faults(spec)), None
    try:
        model = spec.compile()
    except ValueError as error:
        faults.append(f"refused by MuJoCo: {_one_line(error)}")
    if model is None or faults:
        raise RobotFileError([f"{path}: {fault}" for fault in faults])
    wheels = parts.wheels_of(spec)
    measures = measure(spec, model, wheels)
    robot = _describe(path, spec, wheels, measures)
    faults = [
        *_wheel_faults(robot, measures),
        *_speed_faults(robot, measures, model),
        *_body_faults(robot, measures),
        *_world_faults(robot),
    ]
    if faults:
        raise RobotFileError([f"{path}: {fault}" for fault in faults])
    return robot


def _world_faults(robot: RobotDescription) -> Iterator[str]:
    """A line if no world can be built around the robot, for example because it has a name that the world needs."""
    try:
        elements = AntennaElements.checked(np.zeros((MAX_ELEMENTS, 3)), np.zeros(MAX_ELEMENTS))
        build_spec(robot, Yard(size_m=(5.0, 5.0)), elements).compile()
    except ValueError as error:
        yield f"world: none can be built around the robot: {_one_line(error)}"


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
        max_speed_mps=parts.limit_of(spec, parts.MAX_SPEED),
        max_yaw_rate_radps=parts.limit_of(spec, parts.MAX_YAW_RATE),
        max_acceleration_mps2=parts.limit_of(spec, parts.MAX_ACCELERATION),
        yaw_rate_gain=parts.limit_of(spec, parts.YAW_RATE_GAIN),
        lidar_start_m=float(measures.lidar_m[0]),
        lidar_height_m=float(measures.lidar_m[2]),
    )


def _wheel_faults(robot: RobotDescription, measures: Measures) -> Iterator[str]:
    rows = zip(robot.wheels, measures.axis, measures.radius_m, measures.place_m, strict=True)
    for wheel, axis, radius_m, place_m in rows:
        if not np.allclose(axis, [0.0, 1.0, 0.0], atol=1e-3):
            shown = " ".join(f"{value:.3g}" for value in axis.tolist())
            yield f"{wheel.joint}: axis {shown}; allowed is 0 1 0, so that a positive speed drives forward"
        if abs(radius_m - robot.wheel_radius_m) > TOLERANCE_M:
            yield (
                f"{wheel.joint}: radius {radius_m:.3f} m beside {robot.wheel_radius_m:.3f} m of "
                f"{robot.wheels[0].joint}; allowed is one radius for all"
            )
        if abs(place_m[2] - radius_m) > TOLERANCE_M:
            yield (
                f"{wheel.joint}: stands {place_m[2] - radius_m:.3f} m above the origin of the base; allowed is 0 m, "
                "for that lies on the floor"
            )
    if not robot.track_m > 0:
        yield f"left_wheel: {-robot.track_m:.3f} m to the right of right_wheel; allowed is to the left, at a larger y"
    else:
        sides_m = [measures.place_m[mask].mean(axis=0)[:2] for mask in (measures.is_left, ~measures.is_left)]
        x, y = (0.5 * (sides_m[0] + sides_m[1])).tolist()
        if max(abs(x), abs(y)) > TOLERANCE_M:
            yield f"base: the middle between its wheels is at x {x:.3f} m, y {y:.3f} m; allowed is its origin"
    excess_m = float((measures.outline_m - measures.hull_m).max())
    if excess_m > TOLERANCE_M:
        yield f"hull: wheels or casters stick out of it by {excess_m:.3f} m; allowed is a hull that covers them"


def _speed_faults(robot: RobotDescription, measures: Measures, model: mujoco.MjModel) -> Iterator[str]:
    needed = robot.max_speed_mps + 0.5 * robot.turning_track_m * robot.max_yaw_rate_radps
    needed_radps = needed / robot.wheel_radius_m
    for wheel, spin_radps in zip(robot.wheels, measures.spin_radps.tolist(), strict=True):
        if not abs(spin_radps - SPIN_RADPS) <= SPIN_SHARE * SPIN_RADPS:
            yield (
                f"{wheel.actuator}: turns its wheel at {spin_radps:.3g} rad/s in the air, {SPIN_S:g} s after "
                f"{SPIN_RADPS:g} rad/s was commanded; allowed is a servo that takes the speed of the wheel: "
                '<velocity>, or <dcmotor input="vel">'
            )
        actuator = model.actuator(wheel.actuator)
        if actuator.ctrllimited[0] and not (-actuator.ctrlrange[0] >= needed_radps <= actuator.ctrlrange[1]):
            low, high = actuator.ctrlrange.tolist()
            yield (
                f"{wheel.actuator}: ctrlrange {low:g} {high:g}; allowed is at least {-needed_radps:.3g} "
                f"{needed_radps:.3g}, which {parts.MAX_SPEED} and {parts.MAX_YAW_RATE} need together"
            )


def _body_faults(robot: RobotDescription, measures: Measures) -> Iterator[str]:
    if robot.height_m > ROBOT_HEIGHT_M:
        yield (
            f"hull: {robot.height_m:.2f} m high; allowed is up to {ROBOT_HEIGHT_M} m, for on a plan the way is free "
            "below what begins higher"
        )
    x, y, z = measures.lidar_m.tolist()
    if abs(y) > 1e-6 or not 0.0 <= x <= robot.inner_radius_m + 1e-6 or not 0.0 < z <= robot.height_m:
        yield (
            f"{parts.LIDAR}: at {x:g} {y:g} {z:g}; allowed is x from 0 to {robot.inner_radius_m:.3f}, within the hull "
            f"all round, y 0, and z from the floor to {robot.height_m:.2f}"
        )
    if not np.allclose(np.abs(measures.imu_quat), [1.0, 0.0, 0.0, 0.0], atol=1e-3):
        yield f"{parts.IMU}: is turned; allowed is the orientation of the base"
    steps = CONTROL_STEP_S / measures.timestep_s
    if steps < 1 or abs(steps - round(steps)) > 1e-6:
        yield (
            f"option: timestep {measures.timestep_s:g} s; allowed is a whole fraction of {CONTROL_STEP_S} s, the time "
            "between two commands"
        )
    if not (
        measures.home_tilt_rad <= REST_TILT_RAD
        and measures.home_radps <= REST_RADPS
        and np.abs(measures.home_base[:2]).max() <= TOLERANCE_M
    ):
        yield f"{parts.HOME}: not upright and at rest at the origin; allowed is a robot that stands by itself"
