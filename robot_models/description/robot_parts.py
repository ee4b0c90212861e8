"""The named parts that an MJCF file of a robot must have, and checks for them."""
# pyright: reportAttributeAccessIssue=false
# The compiled bindings of MuJoCo carry no types for their enums and spec elements.

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np

from pdpatrol.robot_models.description.robot_description import LEFT, RIGHT, Wheel

BASE, FLOATING_BASE, IMU, GYRO, LIDAR, HOME = "base", "floating_base", "imu", "gyro", "lidar", "home"
WHEEL_NAMES = {LEFT: "left_wheel", RIGHT: "right_wheel"}

FLOOR_CONTYPE = 1
"""Contact bit of the floor, for wheels and casters."""

OBSTACLE_CONTYPE = 2
"""Contact bit of equipment and fence, for the robot's hull."""


def part_errors(spec: mujoco.MjSpec) -> Iterator[str]:
    """Yield a line for each part that is missing or misnamed, and for each invalid limit."""
    yield from _base_errors(spec)
    for side in WHEEL_NAMES:
        yield from _wheel_errors(spec, side)
    yield from _sensor_errors(spec)
    yield from _contact_errors(spec)
    for name in ("max_speed", "max_yaw_rate", "max_acceleration", "yaw_rate_gain"):
        yield from _limit_errors(spec, name)


def wheels_of(spec: mujoco.MjSpec) -> tuple[Wheel, ...]:
    """Return the driven wheels of a valid file, in the order of its joints."""
    return tuple(
        Wheel(joint.name, actuator.name, side)
        for side in WHEEL_NAMES
        for joint in _joints_of(spec, side)
        for actuator in _actuators_of(spec, joint.name)
    )


def limit_of(spec: mujoco.MjSpec, name: str) -> float:
    """Return the value of a custom numeric of a valid file, 0 if it is missing."""
    numeric = spec.numeric(name)
    return 0.0 if numeric is None else float(numeric.data[0])


def is_hull(geom: mujoco.MjsGeom) -> bool:
    """Return whether a geom of a robot belongs to its hull, which touches obstacles."""
    return bool(geom.conaffinity & OBSTACLE_CONTYPE)


def _base_errors(spec: mujoco.MjSpec) -> Iterator[str]:
    base = spec.body(BASE)
    if base is None:
        yield f"{BASE}: no such body; there must be one, a child of the world, that holds the whole robot"
    else:
        free = [joint.name for joint in base.joints if joint.type == mujoco.mjtJoint.mjJNT_FREE]
        if free != [FLOATING_BASE]:
            given = f"`{free[0]}`" if free else "none"
            yield f"{BASE}: must have a free joint `{FLOATING_BASE}`, got {given}"
    for body in spec.worldbody.bodies:
        if body.name != BASE:
            yield f"{body.name or 'a body without a name'}: only `{BASE}` may be a child of the world"
    for geom in spec.worldbody.geoms:
        yield f"{geom.name or 'a geom without a name'}: must not be a child of the world; leave out floor and obstacles"


def _joints_of(spec: mujoco.MjSpec, side: int) -> list[mujoco.MjsJoint]:
    return [joint for joint in spec.joints if joint.name.startswith(WHEEL_NAMES[side])]


def _actuators_of(spec: mujoco.MjSpec, joint: str) -> list[mujoco.MjsActuator]:
    to_a_joint = mujoco.mjtTrn.mjTRN_JOINT
    return [actuator for actuator in spec.actuators if actuator.trntype == to_a_joint and actuator.target == joint]


def _wheel_errors(spec: mujoco.MjSpec, side: int) -> Iterator[str]:
    name, joints = WHEEL_NAMES[side], _joints_of(spec, side)
    if not joints:
        yield f"{name}: no such joint; there must be one or more with names that begin with `{name}`"
    for joint in joints:
        if joint.type != mujoco.mjtJoint.mjJNT_HINGE:
            yield f"{joint.name}: must be a hinge"
        if not any(geom.conaffinity & FLOOR_CONTYPE for geom in joint.parent.geoms):
            yield f"{joint.name}: a geom of its body must touch the floor, with conaffinity {FLOOR_CONTYPE}"
        actuators = _actuators_of(spec, joint.name)
        if len(actuators) != 1:
            yield f"{joint.name}: must have one actuator, got {len(actuators)}"
        for actuator in actuators:
            if not actuator.name.startswith(name):
                yield f"{actuator.name or 'actuator'}: its name must begin with `{name}`, like that of its joint"


def _sensor_errors(spec: mujoco.MjSpec) -> Iterator[str]:
    for name, purpose in ((IMU, "for the gyro"), (LIDAR, "at the start of the first beam of the lidar")):
        site = spec.site(name)
        if site is None:
            yield f"{name}: no such site; there must be one in the body `{BASE}`, {purpose}"
        elif site.parent.name != BASE:
            yield f"{name}: must be a site of the body `{BASE}`, got one of `{site.parent.name}`"
    gyro = spec.sensor(GYRO)
    if gyro is None or gyro.type != mujoco.mjtSensor.mjSENS_GYRO or gyro.objname != IMU:
        yield f"{GYRO}: must be a gyro at the site `{IMU}`, got {'no sensor' if gyro is None else 'another sensor'}"


def _contact_errors(spec: mujoco.MjSpec) -> Iterator[str]:
    robots = [geom for body in spec.bodies if body.name != "world" for geom in body.geoms]
    selfish = [geom for geom in robots if geom.contype]
    if selfish:
        yield f"{_named(selfish)}: contype must be 0, because a robot does not touch itself"
    doubled = [geom for geom in robots if is_hull(geom) and geom.conaffinity & FLOOR_CONTYPE]
    if doubled:
        yield (
            f"{_named(doubled)}: conaffinity must be {FLOOR_CONTYPE} for geoms that touch the floor, or "
            f"{OBSTACLE_CONTYPE} for geoms that touch obstacles, not both"
        )
    if not any(is_hull(geom) for geom in robots):
        yield f"hull: at least one geom must touch obstacles, with conaffinity {OBSTACLE_CONTYPE}"


def _named(geoms: list[mujoco.MjsGeom]) -> str:
    """Name up to three geoms, and count the others."""
    names = [geom.name or f"a geom of {geom.parent.name}" for geom in geoms[:3]]
    return ", ".join(names) + (f" and {len(geoms) - 3} more" if len(geoms) > 3 else "")


def _limit_errors(spec: mujoco.MjSpec, name: str) -> Iterator[str]:
    numeric, is_optional = spec.numeric(name), name == "yaw_rate_gain"
    if numeric is None:
        if not is_optional:
            yield f"{name}: missing; there must be a custom numeric with one number above 0"
        return
    values = np.asarray(numeric.data, dtype=np.float64)
    is_enough = values.size == 1 and np.isfinite(values[0]) and (values[0] > 0 or (is_optional and values[0] == 0))
    if not is_enough:
        shown = " ".join(f"{value:g}" for value in values.tolist()) or "none"
        yield f"{name}: must be one number {'of 0 or more' if is_optional else 'above 0'}, got {shown}"
