"""Measures of a robot that its file does not state: wheels, outline, and its pose at rest."""
# pyright: reportAttributeAccessIssue=false
# The compiled bindings of MuJoCo carry no types for their enums and spec elements.

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

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
"""Speed commanded to the wheels in the air, and time until theirs is measured (assumed)."""

LEVEL = np.stack([f(np.radians(np.arange(0.0, 360.0, 1.0))) for f in (np.cos, np.sin, np.zeros_like)], axis=-1)
"""Level unit vectors, a degree apart, shape (360, 3), for outlines; they are exact to 4e-5."""


class Measures(NamedTuple):
    """Measures of a robot, frame of its base.

    Attributes:
        place_m: Middle of each driven wheel, shape (n_wheels, 3).
        axis: Axis of each driven wheel, shape (n_wheels, 3).
        radius_m: Radius of each driven wheel, shape (n_wheels,).
        spin_radps: Speed of each driven wheel in the air, `SPIN_S` after the command `SPIN_RADPS`, shape (n_wheels,).
        is_left: True for driven wheels on the left, shape (n_wheels,).
        outline_m: Support of all geoms that can touch in the directions of `LEVEL`, shape (n_directions,).
        hull_m: Support of the hull alone, same shape.
        top_m: Height of all geoms that can touch.
        lidar_m: Position of the site of the lidar, shape (3,).
        imu_quat: Orientation of the site of the gyro, shape (4,).
        home: Joint positions of the keyframe, or at rest, shape (n_positions,).
        home_base: Position and wxyz quaternion of the base in `home`, shape (7,).
        home_radps: Greatest joint velocity at rest, m/s or rad/s; 0 for a keyframe, NaN after a warning.
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
        """Tilt of the base in `home`."""
        x, y = self.home_base[4:6].tolist()
        return float(np.arccos(np.clip(1.0 - 2.0 * (x * x + y * y), -1.0, 1.0)))

    @property
    def track_m(self) -> float:
        """Distance between left and right wheels, metres."""
        return float(self.place_m[self.is_left, 1].mean() - self.place_m[~self.is_left, 1].mean())

    @property
    def turning_track_m(self) -> float:
        r"""Track by which wheel speeds turn the robot, metres.

        A wheel a length x ahead of the middle slips sideways by x times the yaw rate. Friction is along the slip, and
        all wheels carry the same load, so that the moments of lengthwise and sideways friction cancel for

        .. math:: b' = b + 4 \overline{x^2} / b

        with the track b between the wheels. It equals b if all wheels are on one axle.
        """
        offset_m = self.place_m[:, 0] - self.place_m[:, 0].mean()
        return self.track_m + 4.0 * float(np.square(offset_m).mean()) / self.track_m


def measure(spec: mujoco.MjSpec, model: mujoco.MjModel, wheels: Sequence[Wheel]) -> Measures:
    """Measure a robot that has all named parts.

    Args:
        spec: Spec of the robot alone.
        model: The same, compiled.
        wheels: Its driven wheels.
    """
    up = np.array([[0.0, 0.0, 1.0]])
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
        radius_m=extents(model, data, rolling, -up)[:, 0] + place_m[:, 2],
        spin_radps=_spin(model, wheels),
        is_left=np.array([wheel.side == LEFT for wheel in wheels]),
        outline_m=extents(model, data, touching, LEVEL).max(axis=0),
        hull_m=extents(model, data, hull, LEVEL).max(axis=0),
        top_m=float(extents(model, data, touching, up).max()),
        lidar_m=model.site(LIDAR).pos.copy(),
        imu_quat=model.site(IMU).quat.copy(),
        home=home,
        home_base=home[free : free + 7],
        home_radps=home_radps,
        timestep_s=model.opt.timestep,
    )


def _rolling_geom(model: mujoco.MjModel, joint: int) -> int:
    """Return the first geom of the body of a joint that stands on the floor."""
    of_body = model.geom_bodyid == model.jnt_bodyid[joint]
    return int(np.flatnonzero(of_body & (model.geom_conaffinity & FLOOR_CONTYPE > 0))[0])


def _spin(model: mujoco.MjModel, wheels: Sequence[Wheel]) -> FloatArray:
    """Return the speeds of the wheels in the air without gravity, shape (n_wheels,)."""
    data, gravity = mujoco.MjData(model), model.opt.gravity.copy()
    model.opt.gravity[:] = 0.0
    for wheel in wheels:
        data.ctrl[model.actuator(wheel.actuator).id] = SPIN_RADPS
    mujoco.mj_step(model, data, nstep=round(SPIN_S / model.opt.timestep))
    model.opt.gravity[:] = gravity
    return np.array([data.qvel[model.joint(wheel.joint).dofadr[0]] for wheel in wheels])


def _home(spec: mujoco.MjSpec, model: mujoco.MjModel) -> tuple[FloatArray, float]:
    """Return the joint positions of the keyframe, or after 3 s on the floor (assumed), and the velocity then."""
    if any(key.name == HOME for key in spec.keys):
        return model.key(HOME).qpos.copy(), 0.0
    on_floor = spec.copy()
    on_floor.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1.0, 1.0, 0.1], contype=FLOOR_CONTYPE)
    standing = on_floor.compile()
    data = mujoco.MjData(standing)
    mujoco.mj_step(standing, data, nstep=round(3.0 / standing.opt.timestep))
    rest_radps = np.nan if any(warning.number for warning in data.warning) else float(np.abs(data.qvel).max())
    return _unturned(data.qpos.copy(), int(standing.joint(FLOATING_BASE).qposadr[0])), rest_radps


def _unturned(qpos: FloatArray, first: int) -> FloatArray:
    """Move joint positions to the world's origin and heading 0; the base begins at `first`."""
    w, x, y, z = qpos[first + 3 : first + 7]
    half_yaw = 0.5 * np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    turned = np.empty(4)
    mujoco.mju_mulQuat(turned, [np.cos(half_yaw), 0.0, 0.0, -np.sin(half_yaw)], qpos[first + 3 : first + 7].copy())
    qpos[first : first + 2], qpos[first + 3 : first + 7] = 0.0, turned
    return qpos


def extents(model: mujoco.MjModel, data: mujoco.MjData, geoms: Sequence[int], directions: FloatArray) -> FloatArray:
    r"""Compute the support of each geom about the origin of the body `base`: its extent in each direction.

    .. math:: h(d) = \max_{p} d \cdot p

    over the points p of the geom. A shape that is not a primitive or mesh of MuJoCo counts as its bounding sphere.

    Args:
        model: Model with a body `base`.
        data: Its data after `mj_kinematics`.
        geoms: Numbers of the geoms.
        directions: Unit vectors, frame of the base, shape (n_directions, 3).

    Returns:
        Shape (n_geoms, n_directions), metres.
    """
    base = model.body(BASE).id
    world_from_base = data.xmat[base].reshape(3, 3)
    found = np.empty((len(geoms), len(directions)))
    for row, geom in enumerate(geoms):
        centre = world_from_base.T @ (data.geom_xpos[geom] - data.xpos[base])
        base_from_geom = world_from_base.T @ data.geom_xmat[geom].reshape(3, 3)
        found[row] = directions @ centre + _support(model, geom, directions @ base_from_geom)
    return found


def _support(model: mujoco.MjModel, geom: int, directions: FloatArray) -> FloatArray:
    """Compute the support of a geom about its centre, in directions (n, 3) of its frame; shape (n,)."""
    kind, (a, b, _) = mujoco.mjtGeom(int(model.geom_type[geom])), model.geom_size[geom]
    along = np.abs(directions[:, 2])
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return np.full(len(directions), a)
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        return a + b * along
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return a * np.sqrt(np.maximum(1.0 - along**2, 0.0)) + b * along
    if kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
        return np.sqrt(np.square(directions * model.geom_size[geom]).sum(axis=-1))
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return np.abs(directions) @ model.geom_size[geom]
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = int(model.geom_dataid[geom])
        first, n = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        return (directions @ model.mesh_vert[first : first + n].T.astype(np.float64)).max(axis=-1)
    return np.full(len(directions), model.geom_rbound[geom])
