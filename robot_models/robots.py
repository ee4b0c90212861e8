"""Robots in their worlds: drive them, and ask where they are, what they touched and what the lidar sees."""
# pyright: reportAttributeAccessIssue=false
# The compiled bindings of MuJoCo carry no types for their enums.

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import ArrayLike, NDArray

from robot_models.readings import Motors, Physics, command, reader, take_places, touching
from robot_models.world import build_spec, physics_only
from robot_models.yard.yard import Yard

FloatArray = NDArray[np.float64]

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
"""ShortestPaths of the lidar (assumed, of a small time-of-flight scanner)."""

_LIDAR_PERIOD_S = 0.1
"""Time between its scans, as in the XML."""

_LIMITS = (MAX_SPEED_MPS, MAX_YAW_RATE_RADPS, 0.5 * WHEEL_TRACK_M, WHEEL_RADIUS_M)

_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
"""All that physics goes on from."""

_HULL = ("chassis_contact", "mast_contact", "head_contact")
_CONTACT_SIZE = 4
"""Sensors of what the hull touches, which remember equally many physics steps, and numbers they tell of each contact:
found, x, y, z."""


class Robots:
    """Robots of one kind, each alone in its own copy of a yard: named physical queries; knows no reward and no radio.

    They stand at the world's origin until `reset` puts them elsewhere. What one does is the same to
    the bit whatever the others do, and however many threads there are. Every answer has a row for each robot.

    Args:
        yard: Fence and equipment.
        element_positions_m: Where the antenna elements sit, shape (n_elements, 3), array frame.
        element_boresights_rad: Azimuths that they look to, shape (n_elements,).
        n_robots: How many.
        n_threads: On how many threads the physics runs.

    Attributes:
        physics: The world that each is in, without what is only looked at.
        step_s: Length of a physics step.
        is_touching: Who touched anything since its last `drive` or `reset` began, shape (n_robots,).
        readings: Where they are, how they move and what the lidar sees, since the last `drive` or `reset`. The lidar
            scanned in the last physics step: at full speed the robot has since moved by a few millimetres.
    """

    def __init__(
        self,
        yard: Yard,
        element_positions_m: ArrayLike,
        element_boresights_rad: ArrayLike,
        n_robots: int = 1,
        n_threads: int = 1,
    ) -> None:
        self._arguments = (yard, element_positions_m, element_boresights_rad, n_robots, n_threads)
        self._spec = build_spec(yard, element_positions_m, element_boresights_rad)
        lidar = [f"lidar_{beam:02d}" for beam in range(LIDAR_BEAMS)]
        self.physics: mujoco.MjModel = physics_only(self._spec, [*lidar, *_HULL]).compile()
        self.step_s: float = self.physics.opt.timestep
        self._yard = yard
        self._batch = Batch(self.physics, n_robots, n_threads)
        model, batch = self.physics, self._batch
        base = int(model.joint("floating_base").qposadr[0])
        turn = int(model.joint("floating_base").dofadr[0])
        wheels = [int(model.joint(name).qposadr[0]) for name in ("left_wheel", "right_wheel")]
        assert wheels[1] == wheels[0] + 1
        self._home = model.key("home").id
        qpos, first = batch.bind("qpos"), int(model.sensor("lidar_00").adr[0])
        self._ctrl = batch.bind("ctrl")
        live = Physics(
            base=qpos[:, base : base + 7],
            base_velocity=batch.bind("qvel")[:, turn : turn + 6],
            wheels=qpos[:, wheels[0] : wheels[0] + 2],
            torque_nm=batch.bind("actuator_force"),
            wheel_radps=batch.bind("actuator_velocity"),
            beams_m=batch.bind("sensordata")[:, first : first + LIDAR_BEAMS],
        )
        motors = [model.actuator(name).gainprm[:2] for name in ("left_wheel", "right_wheel")]
        self._base = live.base
        self._read = reader(live, Motors(*np.array(motors, dtype=np.float64).T.copy()), LIDAR_RANGE_M)
        hull, history = [model.sensor(name).id for name in _HULL], batch.bind("history")
        self._n_remembered = int(model.sensor_history[hull[0], 0])
        chassis, mast, head = (self._contacts_within(history, sensor) for sensor in hull)
        self._touches = chassis, mast, head
        self._places: list[set[tuple[float, float]]] = [set() for _ in range(n_robots)]
        self.is_touching = np.zeros(n_robots, dtype=np.bool_)
        self.reset(np.arange(n_robots), np.zeros((n_robots, 3)))

    def _contacts_within(self, history: FloatArray, sensor: int) -> FloatArray:
        """Where a sensor remembers contacts: a live view, shape (n_robots, n_steps, n_contacts, _CONTACT_SIZE).

        MuJoCo puts a number of the user's, one of its own, and the times before them.
        """
        n, first = self._n_remembered, int(self.physics.sensor_historyadr[sensor]) + 2 + self._n_remembered
        size = int(self.physics.sensor_dim[sensor])
        return history[:, first : first + n * size].reshape(len(history), n, -1, _CONTACT_SIZE)

    @cached_property
    def model(self) -> mujoco.MjModel:
        """The world that each is in, complete: with looks and all sensors."""
        return self._spec.compile()

    @property
    def n_robots(self) -> int:
        """How many there are."""
        return len(self._places)

    @property
    def touched(self) -> list[tuple[str, ...]]:
        """What each robot touched since its last `drive` or `reset` began: `equipment/NAME`, `fence/SIDE`."""
        return [tuple(sorted(self._yard.obstacles_at(list(places)))) if places else () for places in self._places]

    def reset(self, rows: Sequence[int] | NDArray[np.intp], poses: ArrayLike) -> None:
        """Stand some robots at rest on their wheels; their time and all state start from zero.

        Args:
            rows: Which robots, shape (n,).
            poses: x m, y m, yaw rad of each, shape (n, 3), world frame.

        Raises:
            ValueError: If a pose is not finite.
        """
        ids, at = np.asarray(rows, dtype=np.int32), np.asarray(poses, dtype=np.float64).reshape(-1, 3)
        if not np.isfinite(at).all():
            raise ValueError(f"`poses` must be finite, got {at.tolist()}.")
        batch = self._batch
        batch.reset(ids, keyframe=self._home, stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        for row, (x, y, yaw) in zip(ids.tolist(), at.tolist(), strict=True):
            base = self._base[row]
            base[:2] = x, y
            mujoco.mju_mulQuat(base[3:], [np.cos(0.5 * yaw), 0.0, 0.0, np.sin(0.5 * yaw)], base[3:].copy())
        start = batch.state[ids].copy()
        batch.bind("time")[ids] = _LIDAR_PERIOD_S  # so that the lidar is due; a step reads all sensors at its start
        batch.step(ids)
        for row in ids.tolist():
            self._places[row] = self._take_places(row)
            self.is_touching[row] = bool(self._places[row])
        batch.state[ids] = start
        self.readings = self._read()

    def drive(
        self, v_mps: ArrayLike, yaw_rate_radps: ArrayLike, duration_s: float, rows: NDArray[np.intp] | None = None
    ) -> None:
        """Drive for a while under one command each, noting whatever is touched on the way.

        Commands are clipped to `MAX_SPEED_MPS` and `MAX_YAW_RATE_RADPS`. The motors approach them at no more than
        `MAX_ACCELERATION_MPS2` at the rim, from where the previous `drive` left them.

        Args:
            v_mps: Forward speeds, shape (n_robots,), m/s; negative is backward.
            yaw_rate_radps: Yaw rates, shape (n_robots,), rad/s, counter-clockwise.
            duration_s: How long, seconds; a whole number of physics steps.
            rows: Which robots drive, and wait for none of the others; None for all.

        Raises:
            ValueError: If a command is not finite, or the duration is not a whole number of physics steps.
        """
        v, turn = np.asarray(v_mps, dtype=np.float64), np.asarray(yaw_rate_radps, dtype=np.float64)
        n_substeps = round(duration_s / self.step_s)
        if n_substeps < 1 or abs(n_substeps * self.step_s - duration_s) > 1e-9:
            raise ValueError(
                f"`duration_s` must be a positive multiple of the physics step, {self.step_s:g} s, got {duration_s:g}."
            )
        if not command(v, turn, *_LIMITS, self._ctrl):
            raise ValueError(f"`v_mps` and `yaw_rate_radps` must be finite, got {v} and {turn}.")
        if any(self._places):
            for row in range(self.n_robots) if rows is None else rows.tolist():
                self._places[row] = set()
                self.is_touching[row] = False
        while n_substeps > 0:
            n = min(n_substeps, self._n_remembered)
            self._batch.step(rows, n)
            n_substeps -= n
            for row in touching(self._touches).tolist():
                self._places[row] |= self._take_places(row)
                self.is_touching[row] = True
        self.readings = self._read()

    def n_warnings(self) -> NDArray[np.intp]:
        """How often MuJoCo warned of each robot's physics, shape (n_robots,)."""
        return np.asarray(self._batch.warning).reshape(self.n_robots, -1).sum(axis=-1)

    def data(self, row: int = 0) -> mujoco.MjData:
        """A copy of one robot's world as it is now, complete, to draw it or to ask MuJoCo anything."""
        state, kind = np.empty(mujoco.mj_stateSize(self.model, _STATE)), _STATE
        mujoco.mj_getState(self.physics, self._batch.get_data(row), state, kind)
        data = mujoco.MjData(self.model)
        mujoco.mj_setState(self.model, data, state, kind)
        mujoco.mj_forward(self.model, data)
        return data

    def _take_places(self, row: int) -> set[tuple[float, float]]:
        """Where the hull of a robot has touched something, to the centimetre; it is remembered no more."""
        return set(map(tuple, take_places(self._touches, row).tolist()))

    def __getstate__(self) -> dict[str, Any]:
        return {
            "arguments": self._arguments,
            "state": self._batch.state.copy(),
            "places": self._places,
            "is_touching": self.is_touching,
            "readings": self.readings,
        }

    def __setstate__(self, kept: dict[str, Any]) -> None:
        self.__init__(*kept["arguments"])
        self._batch.state[:] = kept["state"]
        self._places, self.is_touching, self.readings = kept["places"], kept["is_touching"], kept["readings"]
