"""Between policy and wheels: stop before what the lidar sees, plan round it, and get away when stuck."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dirmusic import Finding
from pdpatrol.envs.patrol_env import STEP_S, Observation
from pdpatrol.missions.driving.lidar_stop import free_way, safe_command
from pdpatrol.missions.driving.seen_obstacles import SeenObstacles
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.policies.protocol import Action, Policy, believed_pose, checked_action, status_of, time_of
from pdpatrol.missions.record.events import Phase
from pdpatrol.robot_models.description.robot_description import RobotDescription

FloatArray = NDArray[np.float64]

LOOK_S = 0.5
"""Time between looks for what the plan does not show (assumed): it is passed on to the policy in a new map."""

SPEED_UP_MPS2 = 1.0
"""Acceleration (assumed): gentle, within what motors can; one wrong reading of the lidar then moves nothing."""

STUCK_M = 0.2
STUCK_S = 4.0
"""Not that far in that long is stuck (assumed): more than the pose errs, and longer than a turn on the spot takes."""

BACK_OFF_S = 1.5
BACK_OFFS = np.array([(-0.3, 0.0), (-0.3, 0.6), (-0.3, -0.6), (0.3, 0.9), (0.3, -0.9)])
"""Ways out when stuck, m/s and rad/s, the first the dearest, and how long one is driven (assumed): half a metre."""

AGAIN_M = 0.5
"""Stuck within this length of an earlier time is stuck in the same place (assumed): as far as it has backed off."""

BUMP = 1.5
"""Speed that is lost so many times as fast as brakes can take it was taken by something else (assumed)."""

BUMPER_M = 0.05
"""How far before the outline of a stuck robot something is taken to stand (assumed)."""


class CollisionGuard:
    """A policy that drives with care: as the one within wishes, as far as the lidar lets it.

    Args:
        policy: Who decides where to go. The map that it gets shows what the lidar saw; a new one where that changed.
    """

    def __init__(self, policy: Policy) -> None:
        self.phase, self.unreachable = status_of(policy)
        self._policy = policy
        self._seen = SeenObstacles()
        self._looked_s = -np.inf
        self._speed_mps = 0.0
        self._last_place_m: FloatArray | None = None
        self._moved_s = 0.0
        self._stuck_at_m: list[FloatArray] = []
        self._back_off = BACK_OFFS[0]
        self._back_off_until_s = -np.inf

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """What the policy wishes, slowed down; or a way out."""
        pose, time_s = believed_pose(observation), time_of(observation)
        if time_s - self._looked_s >= LOOK_S:
            self._seen.look(observation["lidar"], pose, time_s, site_map)
            self._looked_s = time_s
        has_bumped = self._has_bumped(float(observation["velocity"][0]), site_map.robot)
        if time_s < self._back_off_until_s:
            return _slowed(observation, self._back_off, site_map.robot)
        action = checked_action(self._policy(observation, findings, self._seen.on(site_map)), self._policy)
        self.phase, self.unreachable = status_of(self._policy)
        if action is None:
            return None
        if self._is_stuck(pose, time_s, bool(action.any())) or has_bumped:
            return self._get_away(observation, pose, time_s, site_map.robot, has_bumped=has_bumped)
        return _slowed(observation, site_map.robot.command_from_action(action), site_map.robot)

    def _is_stuck(self, pose: FloatArray, time_s: float, would_move: bool) -> bool:
        moved = self._last_place_m is None or np.hypot(*(pose[:2] - self._last_place_m)) > STUCK_M
        if moved or not would_move:
            self._last_place_m, self._moved_s = pose[:2], time_s
        return time_s - self._moved_s > STUCK_S

    def _has_bumped(self, speed_mps: float, robot: RobotDescription) -> bool:
        """Whether the robot has run into something, above or below what the lidar sees: no brake stops it so fast."""
        lost_mps, self._speed_mps = abs(self._speed_mps) - abs(speed_mps), speed_mps
        return lost_mps > BUMP * robot.max_acceleration_mps2 * STEP_S

    def _get_away(
        self, observation: Observation, pose: FloatArray, time_s: float, robot: RobotDescription, *, has_bumped: bool
    ) -> Action:
        """Begin to back off where there is most room; what it ran into, or what holds it twice, goes onto the map."""
        if has_bumped or any(np.hypot(*(place - pose[:2])) < AGAIN_M for place in self._stuck_at_m):
            ahead = np.array([np.cos(pose[2]), np.sin(pose[2])])
            self._seen.note((pose[:2] + (robot.footprint_radius_m + BUMPER_M) * ahead)[np.newaxis], time_s)
        self._stuck_at_m.append(pose[:2])
        rooms = [free_way(observation["lidar"], v, yaw_rate, robot) for v, yaw_rate in BACK_OFFS.tolist()]
        self._back_off = BACK_OFFS[int(np.argmax(rooms))]
        self._back_off_until_s = time_s + BACK_OFF_S
        self._last_place_m = None
        self.phase = Phase("back off")
        return _slowed(observation, self._back_off, robot)


def _slowed(observation: Observation, command: FloatArray, robot: RobotDescription) -> Action:
    """An action for a command, m/s and rad/s, that is gentle and lets the robot stop before what its lidar sees."""
    v, yaw_rate = command.tolist()
    fastest = max(float(observation["velocity"][0]) * np.sign(v), 0.0) + SPEED_UP_MPS2 * STEP_S
    return robot.action_from_command(
        safe_command(observation["lidar"], float(np.clip(v, -fastest, fastest)), yaw_rate, robot)
    )
