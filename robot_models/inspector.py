"""The inspector in its world: drive it, and ask where it is, what it touched and what it can see."""
# pyright: reportAttributeAccessIssue=false
# The compiled bindings of MuJoCo carry no types for their enums.

from __future__ import annotations

import math

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_models.world import EQUIPMENT_GROUP, GROUND_GROUP, OBSTACLE_CONTYPE

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

CHASSIS_RADIUS_M = 0.20
"""Radius of the chassis, the widest part of the robot; equals the geom `chassis` of the XML."""

WHEEL_RADIUS_M = 0.075
"""Rolling radius of a drive wheel; equals the geoms `left_wheel` and `right_wheel` of the XML."""

WHEEL_TRACK_M = 0.32
"""Distance between the two points on which the drive wheels stand; as in the XML."""

MAX_SPEED_MPS = 0.8
"""Greatest forward or backward speed that can be commanded (assumed; a slow walk)."""

MAX_YAW_RATE_RADPS = 1.5
"""Greatest yaw rate that can be commanded (assumed)."""

MAX_ACCELERATION_MPS2 = 3.0
"""Greatest rate at which the rim speed of a wheel is changed; abrupt commands make the wheels slip (measured). The
motors of the XML keep it."""

LIDAR_BEAMS = 36
"""Beams of the planar lidar, evenly all round; the first looks ahead, the next further counter-clockwise."""

LIDAR_RANGE_M = 12.0
"""Reach of the lidar (assumed, of a small time-of-flight scanner)."""

_LOOK_STEPS = 5
"""Physics steps between looks at what is touched: 25 ms, in which the robot moves by 2 cm at most."""

_WHOLE = 1.0 - 1e-9
"""Share of a ray up to which a hit counts."""

_SHORTEST_M = 1e-9
"""MuJoCo takes no shorter ray; such a one crosses nothing."""

_BEYOND = 1e-7
"""Share of a ray by which it is taken up again beyond a surface: micrometres."""

_EQUIPMENT_ONLY = (np.arange(mujoco.mjNGROUP) == EQUIPMENT_GROUP).astype(np.uint8)
_ALL_BUT_ROBOT = np.isin(np.arange(mujoco.mjNGROUP), (GROUND_GROUP, EQUIPMENT_GROUP)).astype(np.uint8)

_BEAM_RAD = 2.0 * np.pi * np.arange(LIDAR_BEAMS) / LIDAR_BEAMS
_BEAMS = np.stack([np.cos(_BEAM_RAD), np.sin(_BEAM_RAD), np.zeros(LIDAR_BEAMS)], axis=-1)


class Inspector:
    """One robot in one world: named physical queries; knows no reward and no radio.

    It stands at the world's origin until `reset` puts it elsewhere.

    Attributes:
        model: The world the robot is in, with the robot of `inspector.xml`.
        data: Live state of the physics, for rendering and sensors. Change it through `reset` and `drive` only.
        equipment: Names of the pieces of equipment, in the order of the yard.

    Raises:
        KeyError: If the model lacks a part of the inspector; the message lists the names it has.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self.model = model
        self.data = mujoco.MjData(model)
        self._home = model.key("home").id
        self._base_qpos = int(model.joint("floating_base").qposadr[0])
        self._base_dof = int(model.joint("floating_base").dofadr[0])
        self._wheels = model.actuator("left_wheel").id, model.actuator("right_wheel").id
        self._motors = [(model.actuator(w).gainprm[0], model.actuator(w).gainprm[1]) for w in self._wheels]
        self._lidar_m = model.site("lidar").pos.copy()
        self._wheel_qpos = [int(model.joint(name).qposadr[0]) for name in ("left_wheel", "right_wheel")]
        self._obstacles = _named_obstacles(model)
        self._piece, self.equipment = _pieces_of_equipment(model)
        self._touched: set[int] = set()
        self.reset(0.0, 0.0, 0.0)

    @property
    def time_s(self) -> float:
        """Simulated time since the last `reset`, seconds."""
        return float(self.data.time)

    def reset(self, x_m: float, y_m: float, yaw_rad: float) -> None:
        """Stand the robot at rest on its wheels at a pose in the world; time and all state start from zero.

        Raises:
            ValueError: If the pose is not finite.
        """
        _require_finite(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)
        mujoco.mj_resetDataKeyframe(self.model, self.data, self._home)
        base = self.data.qpos[self._base_qpos : self._base_qpos + 7]
        turn = np.array([math.cos(0.5 * yaw_rad), 0.0, 0.0, math.sin(0.5 * yaw_rad)])
        base[:2] = x_m, y_m
        mujoco.mju_mulQuat(base[3:], turn, base[3:].copy())
        mujoco.mj_forward(self.model, self.data)
        self._touched = set()
        self._note_contacts()

    def drive(self, v_mps: float, yaw_rate_radps: float, duration_s: float) -> None:
        """Drive for a while under one command, noting whatever is touched on the way.

        The command is clipped to `MAX_SPEED_MPS` and `MAX_YAW_RATE_RADPS`. The motors approach it at no more than
        `MAX_ACCELERATION_MPS2` at the rim, from where the previous `drive` left them.

        Args:
            v_mps: Forward speed, m/s; negative is backward.
            yaw_rate_radps: Yaw rate, rad/s, counter-clockwise.
            duration_s: How long, seconds; a whole number of physics steps.

        Raises:
            ValueError: If the command is not finite, or the duration is not a whole number of physics steps.
        """
        _require_finite(v_mps=v_mps, yaw_rate_radps=yaw_rate_radps, duration_s=duration_s)
        step_s = self.model.opt.timestep
        n_steps = round(duration_s / step_s)
        if n_steps < 1 or not math.isclose(n_steps * step_s, duration_s):
            raise ValueError(
                f"`duration_s` must be a positive multiple of the physics step of {step_s:g} s, got {duration_s:g}."
            )
        for wheel, rim_speed_mps in zip(self._wheels, _rim_speeds(v_mps, yaw_rate_radps), strict=True):
            self.data.ctrl[wheel] = rim_speed_mps / WHEEL_RADIUS_M
        self._touched = set()
        while n_steps > 0:
            n = min(n_steps, _LOOK_STEPS)
            # Begun and ended in mid-step, so that contacts and sensors belong to the end, as the pose does.
            mujoco.mj_step2(self.model, self.data)
            if n > 1:
                mujoco.mj_step(self.model, self.data, n - 1)
            mujoco.mj_step1(self.model, self.data)
            self._note_contacts()
            n_steps -= n

    def pose(self) -> FloatArray:
        """Where the robot is: x, y and yaw in (-pi, pi]; shape (3,), metres and radians, world frame."""
        x, y, _, *quat = self.data.qpos[self._base_qpos : self._base_qpos + 7].tolist()
        return np.array([x, y, _yaw(quat)])

    def world_from_base(self) -> FloatArray:
        """Frame of the robot's base, on the floor under the middle of the axle, with tilt; shape (4, 4)."""
        transform, rotation = np.eye(4), np.empty(9)
        base = self.data.qpos[self._base_qpos : self._base_qpos + 7]
        mujoco.mju_quat2Mat(rotation, base[3:])
        transform[:3, :3], transform[:3, 3] = rotation.reshape(3, 3), base[:3]
        return transform

    def velocity(self) -> FloatArray:
        """Speed along the robot's own forward direction, m/s, and yaw rate, rad/s; shape (2,)."""
        *_, yaw = self.pose().tolist()
        vx, vy, _, _, _, yaw_rate = self.data.qvel[self._base_dof : self._base_dof + 6].tolist()
        return np.array([math.cos(yaw) * vx + math.sin(yaw) * vy, yaw_rate])

    def wheel_angles(self) -> FloatArray:
        """By how much the left and the right wheel have turned since `reset`; shape (2,), radians."""
        return self.data.qpos[self._wheel_qpos]

    def motor_power_w(self) -> float:
        """Electric power that the wheel motors take now: mechanical power and what heats the copper; never fed back."""
        taken = 0.0
        for wheel, (resistance_ohm, constant_nmpa) in zip(self._wheels, self._motors, strict=True):
            torque_nm = float(self.data.actuator_force[wheel])
            mechanical_w = torque_nm * float(self.data.actuator_velocity[wheel])
            taken += max(mechanical_w + (torque_nm / constant_nmpa) ** 2 * resistance_ohm, 0.0)
        return taken

    def lidar(self) -> FloatArray:
        """Ranges of the planar lidar to equipment, fence or ground, at most `LIDAR_RANGE_M`; shape (LIDAR_BEAMS,)."""
        transform = self.world_from_base()
        rotation = transform[:3, :3]
        range_m, geom = np.empty(LIDAR_BEAMS), np.empty(LIDAR_BEAMS, dtype=np.int32)
        mujoco.mj_multiRay(
            self.model,
            self.data,
            rotation @ self._lidar_m + transform[:3, 3],
            (_BEAMS @ rotation.T).ravel(),
            _ALL_BUT_ROBOT,
            True,
            -1,
            geom,
            range_m,
            None,
            LIDAR_BEAMS,
            LIDAR_RANGE_M,
        )
        return np.where((range_m < 0.0) | (range_m > LIDAR_RANGE_M), LIDAR_RANGE_M, range_m)

    def touched(self) -> tuple[str, ...]:
        """Sorted geom names of what the robot touched since the last `drive` or `reset` began; never the floor."""
        return tuple(sorted({self._obstacles[geom] for geom in self._touched}))

    def crossed(self, starts_m: ArrayLike, ends_m: ArrayLike) -> BoolArray:
        """Tell which pieces of equipment straight lines cross.

        Only geoms of `EQUIPMENT_GROUP` count: neither fence nor floor nor the robot itself is in the way.

        Args:
            starts_m: Shape (n, 3), metres, world frame; outside any equipment.
            ends_m: Shape (n, 3). A line that ends on a face does not cross it, and one of no length crosses nothing.

        Returns:
            Shape (n, n_pieces), pieces in the order of `equipment`.

        Raises:
            ValueError: If the shapes are wrong.
        """
        starts, ends = np.asarray(starts_m, dtype=np.float64), np.asarray(ends_m, dtype=np.float64)
        if starts.ndim != 2 or starts.shape[1] != 3 or starts.shape != ends.shape:
            raise ValueError(
                f"`starts_m` and `ends_m` must both have shape (n, 3), got {starts.shape} and {ends.shape}. "
                "They are positions in the world frame."
            )
        crossed = np.zeros((len(starts), len(self.equipment)), dtype=np.bool_)
        met, rays = np.zeros(1, dtype=np.int32), ends - starts
        long_enough = np.einsum("ni,ni->n", rays, rays) > _SHORTEST_M**2
        for start, ray, is_ray, row in zip(starts, rays, long_enough.tolist(), crossed, strict=True):
            share, origin = 0.0 if is_ray else 1.0, start
            while share < _WHOLE:
                further = mujoco.mj_ray(self.model, self.data, origin, ray, _EQUIPMENT_ONLY, True, -1, met, None)
                share += further
                if further < 0.0 or share >= _WHOLE:
                    break
                row[self._piece[met.item()]] = True
                share += _BEYOND
                origin = start + share * ray
        return crossed

    def _note_contacts(self) -> None:
        geoms = self.data.contact.geom.ravel().tolist()
        if not self._obstacles.keys().isdisjoint(geoms):
            self._touched.update(self._obstacles.keys() & geoms)


def _named_obstacles(model: mujoco.MjModel) -> dict[int, str]:
    """Geom id to name of everything the robot can run into."""
    ids = np.flatnonzero(model.geom_contype & OBSTACLE_CONTYPE).tolist()
    return {geom: "/".join(model.geom(geom).name.split("/")[:2]) or f"geom_{geom}" for geom in ids}


def _pieces_of_equipment(model: mujoco.MjModel) -> tuple[dict[int, int], tuple[str, ...]]:
    """Geom id to number of the piece of equipment that it is a part of, and the pieces' names, in their order."""
    geoms = np.flatnonzero(model.geom_group == EQUIPMENT_GROUP).tolist()
    piece = {geom: model.geom(geom).name.split("/")[1] for geom in geoms}
    names = tuple(dict.fromkeys(piece.values()))
    return {geom: names.index(name) for geom, name in piece.items()}, names


def _rim_speeds(v_mps: float, yaw_rate_radps: float) -> tuple[float, float]:
    """Left and right rim speeds, m/s, for a command within limits."""
    v = min(max(v_mps, -MAX_SPEED_MPS), MAX_SPEED_MPS)
    turn = min(max(yaw_rate_radps, -MAX_YAW_RATE_RADPS), MAX_YAW_RATE_RADPS) * 0.5 * WHEEL_TRACK_M
    return v - turn, v + turn


def _yaw(quat: list[float]) -> float:
    """Yaw of a wxyz quaternion in (-pi, pi]."""
    w, x, y, z = quat
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return math.pi if yaw == -math.pi else yaw


def _require_finite(**values: float) -> None:
    for name, value in values.items():
        if not math.isfinite(value):
            raise ValueError(f"`{name}` must be finite, got {value}.")
