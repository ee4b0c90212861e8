"""What is measured of a robot rather than written in its file: wheels, outline, and how it comes to rest."""
# pyright: reportAttributeAccessIssue=false
# The compiled bindings of MuJoCo carry no types for their enums and spec elements.

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from pdpatrol.robot_models.description.outline import DOWN, LEVEL, UP, extents
from pdpatrol.robot_models.description.robot_description import LEFT, Wheel
from pdpatrol.robot_models.description.robot_parts import (
    BASE,
    FLOATING_BASE,
    FLOOR_CONTYPE,
    HOME,
    IMU,
    LIDAR,
    OBSTACLE_CONTYPE,
)

FloatArray = NDArray[np.float64]

SPIN_RADPS, SPIN_S = 1.0, 1.0
"""Speed that is commanded to the wheels in the air, and for how long, before theirs is measured (assumed)."""

SETTLE_S = 3.0
"""For how long a robot without a keyframe is let come to rest (assumed)."""


class Measures(NamedTuple):
    """Measured of a robot, frame of its base.

    Attributes:
        place_m: Middle of each driven wheel, shape (n_wheels, 3).
        axis: Of each driven wheel, shape (n_wheels, 3).
        radius_m: Of each driven wheel, shape (n_wheels,).
        spin_radps: Of each driven wheel in the air, after `SPIN_S` of the command `SPIN_RADPS`, shape (n_wheels,).
        is_left: Which driven wheels are on the left, shape (n_wheels,).
        outline_m: Support of all that can touch in the directions of `LEVEL`, shape (n_directions,).
        hull_m: Support of the hull alone, same shape.
        top_m: Height of all that can touch.
        lidar_m: Place of the site of the lidar, shape (3,).
        imu_quat: Orientation of the site of the gyro, shape (4,).
        home: Joint positions of the keyframe, or at rest, shape (n_positions,).
        home_base: Of them, position and wxyz quaternion of the base, shape (7,).
        home_radps: Greatest joint velocity that is left then, m/s or rad/s; 0 for a keyframe, NaN after a warning.
        timestep_s: Length of a physics step.
    """

    place_m: FloatArray
    axis: FloatArray
    radius_m: FloatArray
    spin_radps: FloatArray
    is_left: NDArray[np.bool_]
    outline_m: FloatArray
    hull_m: FloatArray
    top_m: float
    lidar_m: FloatArray
    imu_quat: FloatArray
    home: FloatArray
    home_base: FloatArray
    home_radps: float
    timestep_s: float

    @property
    def home_tilt_rad(self) -> float:
        """Of the base in `home`, from upright."""
        x, y = self.home_base[4:6].tolist()
        return float(np.arccos(np.clip(1.0 - 2.0 * (x * x + y * y), -1.0, 1.0)))

    @property
    def track_m(self) -> float:
        """Between left and right wheels, metres."""
        return float(self.place_m[self.is_left, 1].mean() - self.place_m[~self.is_left, 1].mean())

    @property
    def turning_track_m(self) -> float:
        r"""The track by which wheel speeds turn the robot, metres.

        A wheel a length x before the middle slips sideways by x times the yaw rate. Friction is along the slip, and all
        wheels carry alike, so that the moments of the wheels' lengthwise and sideways friction cancel where

        .. math:: b' = b + 4 \overline{x^2} / b

        with the track b between the wheels. Without wheels before or behind each other the two are the same.
        """
        offset_m = self.place_m[:, 0] - self.place_m[:, 0].mean()
        return self.track_m + 4.0 * float(np.square(offset_m).mean()) / self.track_m


def measure(spec: mujoco.MjSpec, model: mujoco.MjModel, wheels: Sequence[Wheel]) -> Measures:
    """Measure a robot whose named parts are all there.

    Args:
        spec: Of the robot alone.
        model: The same, compiled.
        wheels: Its driven wheels.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    base = model.body(BASE).id
    base_from_world, origin_m = data.xmat[base].reshape(3, 3).T, data.xpos[base]
    joints = [model.joint(wheel.joint).id for wheel in wheels]
    rolling = [_rolling_geom(model, joint) for joint in joints]
    place_m = (data.geom_xpos[rolling] - origin_m) @ base_from_world.T
    touching = np.flatnonzero(model.geom_conaffinity).tolist()
    hull = np.flatnonzero(model.geom_conaffinity & OBSTACLE_CONTYPE).tolist()
    home, home_radps = _home(spec, model)
    free = int(model.joint(FLOATING_BASE).qposadr[0])
    return Measures(
        place_m=place_m,
        axis=data.xaxis[joints] @ base_from_world.T,
        radius_m=extents(model, data, rolling, DOWN)[:, 0] + place_m[:, 2],
        spin_radps=_spin(model, wheels),
        is_left=np.array([wheel.side == LEFT for wheel in wheels]),
        outline_m=extents(model, data, touching, LEVEL).max(axis=0),
        hull_m=extents(model, data, hull, LEVEL).max(axis=0),
        top_m=float(extents(model, data, touching, UP).max()),
        lidar_m=model.site(LIDAR).pos.copy(),
        imu_quat=model.site(IMU).quat.copy(),
        home=home,
        home_base=home[free : free + 7],
        home_radps=home_radps,
        timestep_s=model.opt.timestep,
    )


def _rolling_geom(model: mujoco.MjModel, joint: int) -> int:
    """The first geom of the body of a joint that stands on the floor."""
    of_body = model.geom_bodyid == model.jnt_bodyid[joint]
    return int(np.flatnonzero(of_body & (model.geom_conaffinity & FLOOR_CONTYPE > 0))[0])


def _spin(model: mujoco.MjModel, wheels: Sequence[Wheel]) -> FloatArray:
    """Speeds of the wheels in the air without weight, shape (n_wheels,)."""
    data, gravity = mujoco.MjData(model), model.opt.gravity.copy()
    model.opt.gravity[:] = 0.0
    for wheel in wheels:
        data.ctrl[model.actuator(wheel.actuator).id] = SPIN_RADPS
    mujoco.mj_step(model, data, nstep=round(SPIN_S / model.opt.timestep))
    model.opt.gravity[:] = gravity
    return np.array([data.qvel[model.joint(wheel.joint).dofadr[0]] for wheel in wheels])


def _home(spec: mujoco.MjSpec, model: mujoco.MjModel) -> tuple[FloatArray, float]:
    """Joint positions of the keyframe, or at rest on the floor at the world's origin, and the velocity left then."""
    if any(key.name == HOME for key in spec.keys):
        return model.key(HOME).qpos.copy(), 0.0
    on_floor = spec.copy()
    on_floor.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1.0, 1.0, 0.1], contype=FLOOR_CONTYPE)
    standing = on_floor.compile()
    data = mujoco.MjData(standing)
    mujoco.mj_step(standing, data, nstep=round(SETTLE_S / standing.opt.timestep))
    left_radps = np.nan if any(warning.number for warning in data.warning) else float(np.abs(data.qvel).max())
    return _unturned(data.qpos.copy(), int(standing.joint(FLOATING_BASE).qposadr[0])), left_radps


def _unturned(qpos: FloatArray, first: int) -> FloatArray:
    """Joint positions moved to the world's origin and turned to heading 0; the base begins at `first`."""
    w, x, y, z = qpos[first + 3 : first + 7]
    half_yaw = 0.5 * np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    turned = np.empty(4)
    mujoco.mju_mulQuat(turned, [np.cos(half_yaw), 0.0, 0.0, -np.sin(half_yaw)], qpos[first + 3 : first + 7].copy())
    qpos[first : first + 2], qpos[first + 3 : first + 7] = 0.0, turned
    return qpos
