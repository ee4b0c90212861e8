"""Simulated robots: driving, and reading of poses, contacts and lidar."""
# pyright: reportAttributeAccessIssue=false
# The compiled bindings of MuJoCo carry no types for their enums.

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import ArrayLike

from dirmusic.arrays import FloatArray, IntArray
from dirmusic.compiled import compiled
from pdpatrol.robot_models.description.robot_description import RobotDescription
from pdpatrol.robot_models.description.robot_file import driven_wheels
from pdpatrol.robot_models.moving_bodies import MovingBody, Trajectory, distance_to_body
from pdpatrol.robot_models.readings import Readings, read
from pdpatrol.robot_models.sensors import LIDAR_BEAMS, LIDAR_PERIOD_S, LIDAR_RANGE_M, AntennaElements
from pdpatrol.robot_models.world import build_spec, physics_only
from pdpatrol.robot_models.yard.yard import Yard

BODY_CONTACT_M = 0.05
"""Distance from a moving body within which a contact is with this body. Assumed: how far a fast vehicle moves in one
physics step."""


class Robots:
    """Robots of the same kind, each alone in its own copy of a yard, without rewards and radio.

    The robots stand at the world's origin until `reset` places them elsewhere. The motion of each robot is bit-for-bit
    independent of the other robots and of the number of threads. Every result has a row for each robot.

    Args:
        robot: Description of all robots.
        yard: Fence and equipment.
        elements: Antenna elements of each robot.
        n_robots: Number of robots.
        n_threads: Number of threads that step the physics.
        moving: People and vehicles in each yard.

    Attributes:
        robot: Description of all robots.
        physics: Model of each robot's world, without elements that are only visible.
        step_s: Length of a physics step.
        is_touching: True for robots that touched anything since the start of their last `drive` or `reset`, shape
            (n_robots,).
        readings: Poses, motion and lidar after the last `drive` or `reset`. The lidar scan dates from the start of the
            last physics step; at full speed the robot has moved by a few millimetres since then.
    """

    def __init__(
        self,
        robot: RobotDescription,
        yard: Yard,
        elements: AntennaElements,
        n_robots: int = 1,
        n_threads: int = 1,
        moving: Sequence[MovingBody] = (),
    ) -> None:
        self._arguments = (robot, yard, elements, n_robots, n_threads, moving)
        self.robot, self._yard, self._elements, self._moving = robot, yard, elements, moving
        model: mujoco.MjModel = physics_only(build_spec(robot, yard, moving=moving)).compile()
        self.physics, self.step_s, self._home = model, float(model.opt.timestep), model.key("home").id
        self._batch = batch = Batch(model, n_robots, n_threads)
        base, lidar = batch.joint("floating_base"), int(model.sensor("lidar_00").adr[0])
        self._mocap = batch.mocap_pos, batch.mocap_quat
        self._ctrl, self._base, self._gyro_radps = batch.ctrl, base.qpos, batch.sensor("gyro").data[:, 2]
        live = (
            self._base,
            base.qvel,
            batch.qpos,
            batch.actuator_force,
            batch.actuator_velocity,
            batch.sensordata[:, lidar : lidar + LIDAR_BEAMS],
        )
        drive = _drive(model)
        self._read = (live, drive, robot.lidar_start_m, LIDAR_RANGE_M)
        self._wheels, self._all_rows = drive[1:3], np.arange(n_robots)
        self._steering = (
            robot.max_speed_mps,
            robot.max_yaw_rate_radps,
            0.5 * robot.turning_track_m,
            robot.wheel_radius_m,
            robot.max_acceleration_mps2,
            robot.yaw_rate_gain,
        )
        self._feedback = np.zeros(n_robots), np.zeros((n_robots, 2)), np.zeros(n_robots)
        self._touches = self._stored_contacts()
        self._found = self._touches[..., 0, 0]  # in each step, the contacts that were found are listed first
        self._places: list[set[tuple[float, float]]] = [set() for _ in range(n_robots)]
        self._met: list[set[str]] = [set() for _ in range(n_robots)]
        self._tracks: list[Sequence[Trajectory]] = [()] * n_robots
        self.is_touching = np.zeros(n_robots, dtype=np.bool_)
        self.reset(self._all_rows, np.zeros((n_robots, 3)))

    def _stored_contacts(self) -> FloatArray:
        """Return a live view of the contacts stored by the contact sensors of the hull.

        The histories of these sensors are the last ones. In each history, MuJoCo stores two numbers and the times, and
        then the contacts. The values of a contact are: found, x, y, z.

        Returns:
            Shape (n_robots, n_sensors, n_steps, n_contacts, 4).
        """
        model, history = self.physics, self._batch.history
        sensors = [k for k in range(model.nsensor) if model.sensor(k).name.startswith("hull/")]
        n_steps, first = int(model.sensor_history[sensors[0], 0]), int(model.sensor_historyadr[sensors[0]])
        rows = history[:, first:].reshape(len(history), len(sensors), -1)
        return rows[:, :, 2 + n_steps :].reshape(len(history), len(sensors), n_steps, -1, 4)

    @cached_property
    def model(self) -> mujoco.MjModel:
        """Complete model of each robot's world, with visible elements and all sensors."""
        return build_spec(self.robot, self._yard, self._elements, self._moving).compile()

    @property
    def touched(self) -> list[tuple[str, ...]]:
        """Names of the objects that each robot touched since the start of its last `drive` or `reset`.

        The names are `equipment/NAME`, `fence/SIDE` and `moving/NAME`.
        """
        return [
            tuple(sorted(met | (self._yard.obstacles_at(list(places)) if places else set())))
            for met, places in zip(self._met, self._places, strict=True)
        ]

    def reset(
        self, rows: Sequence[int] | IntArray, poses: ArrayLike, tracks: Sequence[Sequence[Trajectory]] | None = None
    ) -> None:
        """Put some robots at rest on their wheels, with time and state reset.

        Args:
            rows: Rows of the robots, shape (n,).
            poses: Pose x m, y m, yaw rad of each, shape (n, 3), world frame.
            tracks: For each row, the tracks of all people and vehicles; None leaves these at the origin.

        Raises:
            ValueError: If a pose is not finite.
        """
        ids, at = np.asarray(rows, dtype=np.int32), np.asarray(poses, dtype=np.float64).reshape(-1, 3)
        if not np.isfinite(at).all():
            raise ValueError(f"`poses` must be finite, got {at.tolist()}")
        batch = self._batch
        batch.reset(ids, keyframe=self._home, stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        for row, (x, y, yaw) in zip(ids.tolist(), at.tolist(), strict=True):
            base = self._base[row]
            base[:2] = x, y
            mujoco.mju_mulQuat(base[3:], [np.cos(0.5 * yaw), 0.0, 0.0, np.sin(0.5 * yaw)], base[3:].copy())
        for row, own in zip(ids.tolist(), tracks or (), strict=False):
            self._tracks[row] = own
            self._move_bodies(row, self._body_states(row, np.zeros(1))[0])
        start = batch.state[ids].copy()
        batch.time[ids] = LIDAR_PERIOD_S  # so that a lidar scan is due; a step reads all sensors at its start
        batch.step(ids)
        for row in ids.tolist():
            self._places[row], self._met[row] = set(), set()
            self._take_places(row)
        batch.state[ids] = start
        for state in self._feedback[1:]:
            state[ids] = 0.0
        self._update_readings()

    def drive(
        self, v_mps: ArrayLike, yaw_rate_radps: ArrayLike, duration_s: float, rows: IntArray | None = None
    ) -> None:
        """Drive each robot with a constant command, and record all contacts.

        Commands are clipped to the robot's limits. Starting from the speeds of the previous `drive`, the motors
        approach them no faster than `max_acceleration_mps2` allows. If the wheels skid in turns, each `drive` uses the
        gyro to correct the yaw rate.

        Args:
            v_mps: Forward speeds, shape (n_robots,), m/s; negative is backward.
            yaw_rate_radps: Yaw rates, shape (n_robots,), rad/s, counter-clockwise.
            duration_s: Duration, seconds; a whole number of physics steps.
            rows: Rows of the robots to drive; the others are not stepped. None for all robots.

        Raises:
            ValueError: If a command is not finite, or the duration is not a whole number of physics steps.
        """
        v, turn = np.asarray(v_mps, dtype=np.float64), np.asarray(yaw_rate_radps, dtype=np.float64)
        n_substeps = round(duration_s / self.step_s)
        if n_substeps < 1 or abs(n_substeps * self.step_s - duration_s) > 1e-9:
            raise ValueError(
                f"`duration_s` must be a positive multiple of the physics step, {self.step_s:g} s, got {duration_s:g}"
            )
        driven = self._all_rows if rows is None else rows
        if not command(v, turn, driven, duration_s, self._steering, self._wheels, self._feedback, self._ctrl):
            raise ValueError(f"`v_mps` and `yaw_rate_radps` must be finite, got {v} and {turn}")
        if any(self._places) or any(self._met):
            for row in driven.tolist():
                self._places[row], self._met[row] = set(), set()
                self.is_touching[row] = False
        moves = self._coming_states(driven, n_substeps) if self._moving else {}
        while n_substeps > 0:
            n = 1 if moves else min(n_substeps, self._touches.shape[2])
            for row, states in moves.items():
                self._move_bodies(row, states[-n_substeps])
            self._batch.step(rows, n)
            n_substeps -= n
            if self._found.any():
                for row in np.flatnonzero(self._found.any(axis=(1, 2))).tolist():
                    self._take_places(row)
        self._update_readings()

    def _update_readings(self) -> None:
        """Read the sensors, and store the gyro reading, which is not part of the state, for the next command."""
        self._feedback[0][:] = self._gyro_radps
        self.readings = Readings(*read(*self._read))

    def n_warnings(self) -> IntArray:
        """Return the number of MuJoCo warnings for each robot, shape (n_robots,)."""
        return self._batch.warning.sum(axis=(1, 2))

    def data(self, row: int = 0) -> mujoco.MjData:
        """Copy the complete world of one robot in its current state, for rendering and queries."""
        data = mujoco.MjData(self.model)
        mujoco.mj_setState(self.model, data, self._batch.state[row], mujoco.mjtState.mjSTATE_INTEGRATION)
        mujoco.mj_forward(self.model, data)
        return data

    def _take_places(self, row: int) -> None:
        """Record the places of a robot's stored contacts, rounded to a centimetre, and clear the contacts."""
        contacts = self._touches[row]
        places_m = contacts[contacts[..., 0] > 0.0][:, 1:3]
        if self._moving:
            poses = [track.pose(self._batch.time[row].item()) for track in self._tracks[row]]
            for body, pose in zip(self._moving, poses, strict=False):
                is_met = distance_to_body(body, pose, places_m) < BODY_CONTACT_M
                self._met[row] |= {body.label} if is_met.any() else set()
                places_m = places_m[~is_met]
        self._places[row].update(map(tuple, np.round(places_m, 2).tolist()))
        self.is_touching[row] = bool(self._places[row] or self._met[row])
        contacts[..., 0] = 0.0

    def _coming_states(self, rows: IntArray, n_steps: int) -> dict[int, FloatArray]:
        """Return `_body_states` in the next physics steps, by the row of the robot."""
        after_s = self.step_s * np.arange(1, n_steps + 1)
        return {row: self._body_states(row, self._batch.time[row].item() + after_s) for row in rows.tolist()}

    def _body_states(self, row: int, time_s: FloatArray) -> FloatArray:
        """Return places and wxyz quaternions of what moves around a robot, shape (n_times, n_bodies, 7)."""
        states = np.zeros((time_s.size, len(self._tracks[row]), 7))
        for body, track in enumerate(self._tracks[row]):
            x, y, yaw = track.pose(time_s).T
            states[:, body, [0, 1, 3, 6]] = np.column_stack([x, y, np.cos(0.5 * yaw), np.sin(0.5 * yaw)])
        return states

    def _move_bodies(self, row: int, states: FloatArray) -> None:
        """Put the people and vehicles around a robot to their places, shape (n_bodies, 7)."""
        if len(states):
            self._mocap[0][row], self._mocap[1][row] = states[:, :3], states[:, 3:]

    def __getstate__(self) -> tuple[Any, ...]:
        state = self._batch.state.copy()
        own = self._feedback, self._places, self._met, self._tracks, self.is_touching, self.readings
        return self._arguments, state, *own

    def __setstate__(self, kept: tuple[Any, ...]) -> None:
        arguments, state, *own = kept
        self.__init__(*arguments)
        self._batch.state[:] = state
        self._feedback, self._places, self._met, self._tracks, self.is_touching, self.readings = own


def _drive(model: mujoco.MjModel) -> tuple[Any, ...]:
    """Look up the driven wheels and the data of their motors in the model; see `readings.read`."""
    joint, actuator, side = driven_wheels(model)
    is_dc = model.actuator_gaintype[actuator] == mujoco.mjtGain.mjGAIN_DCMOTOR
    resistance_ohm, constant_nmpa = model.actuator_gainprm[actuator, :2].T
    side_share, column = 1.0 / np.bincount(side)[side], model.jnt_qposadr[joint].astype(np.intp)
    return column, actuator, side, side_share, np.where(is_dc, resistance_ohm, 0.0), np.where(is_dc, constant_nmpa, 1.0)


@compiled
def command(
    v_mps: FloatArray,
    yaw_rate_radps: FloatArray,
    rows: IntArray,
    period_s: float,
    steering: tuple[float, float, float, float, float, float],
    wheels: tuple[IntArray, IntArray],
    feedback: tuple[FloatArray, FloatArray, FloatArray],
    control_radps: FloatArray,
) -> bool:
    """Set the wheel speeds for velocity commands, which are clipped to the limits.

    For robots with skidding wheels, a set point approaches the command no faster than the wheel rims can accelerate.
    When the robot slows down, the speed has priority, so that the robot stops within the same distance as on a straight
    path; otherwise the yaw rate has priority.

    Args:
        v_mps: Forward speeds, shape (n,).
        yaw_rate_radps: Yaw rates, shape (n,).
        rows: Rows of the robots to command.
        period_s: Time since the last command.
        steering: Maximum speed, maximum yaw rate, half of `RobotDescription.turning_track_m`, rolling radius of the
            wheels, maximum acceleration of the wheel rims, and gain of the integrating gyro feedback, 1/s, which is 0
            without feedback.
        wheels: Actuator column and side of each driven wheel, see `readings.read`.
        feedback: Yaw rates measured by the gyro, shape (n,); and the state, which is updated: set points of speed and
            yaw rate, shape (n, 2), and corrections of the yaw rates for skidding wheels, shape (n,).
        control_radps: Receives the wheel speeds, shape (n, n_actuators).

    Returns:
        False, with nothing changed, if any command of any robot is not finite; otherwise True.
    """
    if not (np.isfinite(v_mps).all() and np.isfinite(yaw_rate_radps).all()):
        return False
    most_v_mps, most_yaw_rate_radps, half_track_m, radius_m, acceleration_mps2, gain = steering
    (actuator, side), (gyro_radps, set_point, added_radps) = wheels, feedback
    for r in rows:
        v = float(min(max(v_mps[r], -most_v_mps), most_v_mps))
        turn = float(min(max(yaw_rate_radps[r], -most_yaw_rate_radps), most_yaw_rate_radps))
        if gain > 0.0:
            added = added_radps[r] + gain * period_s * (set_point[r, 1] - gyro_radps[r])
            change_mps = acceleration_mps2 * period_s
            v_change, turn_change = v - set_point[r, 0], half_track_m * (turn - set_point[r, 1])
            if v_change * set_point[r, 0] < 0.0:
                v_change = min(max(v_change, -change_mps), change_mps)
                change_mps -= abs(v_change)
                turn_change = min(max(turn_change, -change_mps), change_mps)
            else:
                turn_change = min(max(turn_change, -change_mps), change_mps)
                change_mps -= abs(turn_change)
                v_change = min(max(v_change, -change_mps), change_mps)
            set_point[r, 0] += v_change
            set_point[r, 1] += turn_change / half_track_m
            is_at_rest = set_point[r, 0] == 0.0 and set_point[r, 1] == 0.0
            added_radps[r] = 0.0 if is_at_rest else min(max(added, -most_yaw_rate_radps), most_yaw_rate_radps)
            v, turn = set_point[r, 0], set_point[r, 1] + added_radps[r]
        rim = turn * half_track_m
        for k in range(actuator.size):
            speed_mps = v - rim if side[k] == 0 else v + rim
            control_radps[r, actuator[k]] = speed_mps / radius_m
    return True
