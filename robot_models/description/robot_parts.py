"""The named parts that an MJCF file needs to be a robot here, and what is said of one that is missing or misnamed."""
# pyright: reportAttributeAccessIssue=false
# The compiled bindings of MuJoCo carry no types for their enums and spec elements.

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np

from pdpatrol.robot_models.description.robot_description import LEFT, RIGHT, Wheel

BASE, FLOATING_BASE, IMU, GYRO, LIDAR, HOME = "base", "floating_base", "imu", "gyro", "lidar", "home"
WHEEL_NAMES = {LEFT: "left_wheel", RIGHT: "right_wheel"}

MAX_SPEED, MAX_YAW_RATE, MAX_ACCELERATION, YAW_RATE_GAIN = (
    "max_speed",
    "max_yaw_rate",
    "max_acceleration",
    "yaw_rate_gain",
)

FLOOR_CONTYPE = 1
"""Contact bit that wheels and casters answer to."""

OBSTACLE_CONTYPE = 2
"""Contact bit that the robot's hull answers to: equipment and fence."""


def part_faults(spec: mujoco.MjSpec) -> Iterator[str]:
    """A line for each part that is missing or misnamed, and for each limit that makes no sense."""
    yield from _base_faults(spec)
    for side in WHEEL_NAMES:
        yield from _wheel_faults(spec, side)
    yield from _sensor_faults(spec)
    yield from _contact_faults(spec)
    for name in (MAX_SPEED, MAX_YAW_RATE, MAX_ACCELERATION, YAW_RATE_GAIN):
        yield from _limit_faults(spec, name)


def wheels_of(spec: mujoco.MjSpec) -> tuple[Wheel, ...]:
    """The driven wheels of a file without faults, in the order of its joints."""
    return tuple(
        Wheel(joint.name, actuator.name, side)
        for side in WHEEL_NAMES
        for joint in _joints_of(spec, side)
        for actuator in _actuators_of(spec, joint.name)
    )


def limit_of(spec: mujoco.MjSpec, name: str) -> float:
    """Value of a custom numeric of a file without faults; 0 if it is not there."""
    numeric = spec.numeric(name)
    return 0.0 if numeric is None else float(numeric.data[0])


def is_hull(geom: mujoco.MjsGeom) -> bool:
    """Whether a geom of a robot answers to obstacles."""
    return bool(geom.conaffinity & OBSTACLE_CONTYPE)


def _base_faults(spec: mujoco.MjSpec) -> Iterator[str]:
    base = spec.body(BASE)
    if base is None:
        yield f"{BASE}: no such body; allowed is one, right below the world, that all of the robot is a part of"
    else:
        free = [joint.name for joint in base.joints if joint.type == mujoco.mjtJoint.mjJNT_FREE]
        if free != [FLOATING_BASE]:
            came = f"its free joint is `{free[0]}`" if free else "it has no free joint"
            yield f"{BASE}: {came}; allowed is a free joint `{FLOATING_BASE}`"
    for body in spec.worldbody.bodies:
        if body.name != BASE:
            yield f"{body.name or 'a body without a name'}: lies below the world; allowed there is `{BASE}` alone"
    for geom in spec.worldbody.geoms:
        yield f"{geom.name or 'a geom without a name'}: lies in the world; allowed is the robot alone, without a floor"


def _joints_of(spec: mujoco.MjSpec, side: int) -> list[mujoco.MjsJoint]:
    return [joint for joint in spec.joints if joint.name.startswith(WHEEL_NAMES[side])]


def _actuators_of(spec: mujoco.MjSpec, joint: str) -> list[mujoco.MjsActuator]:
    to_a_joint = mujoco.mjtTrn.mjTRN_JOINT
    return [actuator for actuator in spec.actuators if actuator.trntype == to_a_joint and actuator.target == joint]


def _wheel_faults(spec: mujoco.MjSpec, side: int) -> Iterator[str]:
    name, joints = WHEEL_NAMES[side], _joints_of(spec, side)
    if not joints:
        yield f"{name}: no such joint; allowed are one or more whose names are or begin with `{name}`"
    for joint in joints:
        if joint.type != mujoco.mjtJoint.mjJNT_HINGE:
            yield f"{joint.name}: a joint of another type; allowed is a hinge"
        if not any(geom.conaffinity & FLOOR_CONTYPE for geom in joint.parent.geoms):
            yield f"{joint.name}: no geom of its body meets the floor; allowed is one with conaffinity {FLOOR_CONTYPE}"
        actuators = _actuators_of(spec, joint.name)
        if len(actuators) != 1:
            yield f"{joint.name}: {len(actuators)} actuators turn it; allowed is one"
        for actuator in actuators:
            if not actuator.name.startswith(name):
                yield f"{actuator.name or 'actuator'}: turns {joint.name}; allowed is a name that begins with `{name}`"


def _sensor_faults(spec: mujoco.MjSpec) -> Iterator[str]:
    for name, purpose in ((IMU, "where the gyro is"), (LIDAR, "where the first beam of the lidar starts")):
        site = spec.site(name)
        if site is None:
            yield f"{name}: no such site; allowed is one in the body `{BASE}`, {purpose}"
        elif site.parent.name != BASE:
            yield f"{name}: a site of `{site.parent.name}`; allowed is one in the body `{BASE}`"
    gyro = spec.sensor(GYRO)
    if gyro is None or gyro.type != mujoco.mjtSensor.mjSENS_GYRO or gyro.objname != IMU:
        came = "no such sensor" if gyro is None else "another sensor"
        yield f"{GYRO}: {came}; allowed is a gyro at the site `{IMU}`"


def _contact_faults(spec: mujoco.MjSpec) -> Iterator[str]:
    robots = [geom for body in spec.bodies if body.name != "world" for geom in body.geoms]
    selfish = [geom for geom in robots if geom.contype]
    if selfish:
        yield f"{_named(selfish)}: contype other than 0; allowed is 0, for a robot does not touch itself"
    doubled = [geom for geom in robots if is_hull(geom) and geom.conaffinity & FLOOR_CONTYPE]
    if doubled:
        yield (
            f"{_named(doubled)}: conaffinity for floor and obstacles; allowed is {FLOOR_CONTYPE} for what stands on "
            f"the floor, or {OBSTACLE_CONTYPE} for what meets obstacles"
        )
    if not any(is_hull(geom) for geom in robots):
        yield f"hull: no geom answers to obstacles; allowed is at least one with conaffinity {OBSTACLE_CONTYPE}"


def _named(geoms: list[mujoco.MjsGeom]) -> str:
    """Up to three geoms by name, and how many more there are."""
    names = [geom.name or f"a geom of {geom.parent.name}" for geom in geoms[:3]]
    return ", ".join(names) + (f" and {len(geoms) - 3} more" if len(geoms) > 3 else "")


def _limit_faults(spec: mujoco.MjSpec, name: str) -> Iterator[str]:
    numeric, is_optional = spec.numeric(name), name == YAW_RATE_GAIN
    if numeric is None:
        if not is_optional:
            yield f"{name}: missing; allowed is a custom numeric, one number above 0"
        return
    values = np.asarray(numeric.data, dtype=np.float64)
    is_enough = values.size == 1 and np.isfinite(values[0]) and (values[0] > 0 or (is_optional and values[0] == 0))
    if not is_enough:
        shown = " ".join(f"{value:g}" for value in values.tolist()) or "nothing"
        yield f"{name}: got {shown}; allowed is one number {'of 0 or more' if is_optional else 'above 0'}"
