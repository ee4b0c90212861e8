"""Collision guard: stops before obstacles that the lidar measures, adds them to the map, and backs off when stuck."""

from collections.abc import Sequence

import numpy as np

from dirmusic import Finding
from dirmusic.angles import unit_vector
from dirmusic.arrays import FloatArray
from pdpatrol.envs.patrol_env import STEP_S, Observation
from pdpatrol.missions.driving.lidar_stop import free_distance, safe_command
from pdpatrol.missions.driving.moving_obstacles import MovingObstacles, Scan
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.policies.protocol import (
    Action,
    Policy,
    believed_pose,
    checked_action,
    resume,
    status_of,
    time_of,
)
from pdpatrol.missions.record.events import Phase
from pdpatrol.robot_models.description.robot_description import RobotDescription

BACK_OFF_S = 1.5
BACK_OFF_COMMANDS = (-0.3, 0.0), (-0.3, 0.6), (-0.3, -0.6), (0.3, 0.9), (0.3, -0.9)
"""Duration in seconds of backing off when stuck, and its commands, m/s and rad/s, in order of preference. Assumed;
about half a metre."""

PATIENCE_S = 20.0
"""Time for which the robot gives way to people and vehicles before it goes on as if they stood. Assumed."""

PLACE_M = 0.1
"""Resolution of remembered obstacles. Assumed; half the radius of a small robot."""

SEEN_S, TOUCHED_S = 60.0, 600.0
"""Time for which a place is remembered after a beam met it, and after the robot touched something there that no beam
meets. Assumed; people leave, and equipment above the lidar's plane stays."""

COLLISION_MPS, COLLISION_RADPS = 0.3, 0.4
"""Loss of speed, and change of yaw rate, in one step beyond those that were commanded, that show a collision (assumed).
In five missions without contacts, no yaw rate was more than 0.01 rad/s beyond the last one and that commanded."""


class SeenObstacles:
    """Places that are occupied although the plan shows them free, with the time when each is forgotten."""

    def __init__(self) -> None:
        self._until_s: dict[tuple[int, int], float] = {}
        self._map: SiteMap | None = None

    def scan(self, scan: Scan, plan: SiteMap, moving: MovingObstacles) -> None:
        """Add the points that the beams of a scan measured and that `plan` does not show, unless they move.

        Points beyond 2.5 m are ignored, because the heading error displaces them. Points within 0.2 m, three standard
        deviations of pose and range, of the fence or mapped equipment are attributed to it (both assumed).
        """
        points = scan.points(2.5)
        points = points[plan.yard.clearance(points) > 0.2]
        if len(moving.points_m):
            points = points[~moving.near(points)]
            self._forget_near(moving, scan.time_s)
        self.add(points, scan.time_s, SEEN_S)

    def _forget_near(self, moving: MovingObstacles, time_s: float) -> None:
        """Forget places near what moves that a beam met; it meets those of a static obstacle again."""
        if seen := [place for place, end_s in self._until_s.items() if end_s <= time_s + SEEN_S]:
            for place in np.array(seen)[moving.near(PLACE_M * np.array(seen))].tolist():
                del self._until_s[tuple(place)]
                self._map = None

    def add(self, points_m: FloatArray, time_s: float, kept_s: float) -> None:
        """Remember points (n, 2), world frame, for a time, and forget those whose time is over."""
        until_s = dict(self._until_s)
        for place in map(tuple, np.round(points_m / PLACE_M).astype(int).tolist()):
            until_s[place] = max(until_s.get(place, 0.0), time_s + kept_s)
        until_s = {place: end_s for place, end_s in until_s.items() if end_s > time_s}
        if until_s.keys() != self._until_s.keys():
            self._map = None
        self._until_s = until_s

    def on(self, plan: SiteMap) -> SiteMap:
        """Return the plan with the remembered obstacles; the same map is returned until they change."""
        if not self._until_s:
            return plan
        if self._map is None:
            self._map = plan.with_obstacles(PLACE_M * np.array(sorted(self._until_s)))
        return self._map


class CollisionGuard:
    """Wrapper of a policy that limits its actions to those that are safe according to the lidar.

    Args:
        policy: Policy that decides where to go. Its map shows the obstacles that the lidar has measured.
    """

    def __init__(self, policy: Policy) -> None:
        self.phase, self.unreachable = status_of(policy)
        self._policy = policy
        self._seen, self._moving = SeenObstacles(), MovingObstacles()
        self._gives_way_s = 0.0
        self._scanned_s = -np.inf
        self._velocity = self._sent_velocity = np.zeros(2)
        self._last_place_m: FloatArray | None = None
        self._moved_s = 0.0
        self._stuck_at_m: list[FloatArray] = []
        self._command: tuple[float, float] = 0.0, 0.0
        self._back_off_until_s = -np.inf

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """Return the policy's action, slowed down where needed, or one that backs off towards the most free space.

        The obstacle of a collision, or of two stops within half a metre, is added to the map 5 cm ahead of the robot's
        outline; that of a collision also nearer, because the mast may meet parts that the hull passes under. The
        acceleration is limited to 1 m/s^2, well below the limit of the motors, so that one wrong lidar reading has
        little effect. All assumed.
        """
        pose, time_s, robot = believed_pose(observation), time_of(observation, site_map), site_map.robot
        speed_mps, lidar_m = float(observation["velocity"][0]), observation["lidar"]
        limit_mps, scan = float(site_map.speed_limit(pose[:2])), Scan(time_s, pose, lidar_m)
        self._moving.scan(scan, site_map)
        if time_s - self._scanned_s >= 0.5:  # not at every step, because each scan gives a new map (assumed)
            self._seen.scan(scan, site_map, self._moving)
            self._scanned_s = time_s
        has_collided = self._has_collided(observation["velocity"])
        self._velocity = observation["velocity"].astype(np.float64)
        if time_s >= self._back_off_until_s:
            action = checked_action(self._policy(observation, findings, self._seen.on(site_map)), self._policy)
            self.phase, self.unreachable = status_of(self._policy)
            if action is None:
                return None
            v, yaw_rate = robot.command_from_action(action).tolist()
            self._command = v, yaw_rate
            if self._gives_way(scan, robot):
                v, yaw_rate = self._command
                return self._sent(safe_command(lidar_m, max(min(v, limit_mps), -limit_mps), yaw_rate, robot), robot)
            if self._is_stuck(pose, time_s, bool(action.any())) or has_collided:
                if has_collided or any(np.hypot(*(place_m - pose[:2])) < 0.5 for place_m in self._stuck_at_m):
                    outline_m = robot.footprint_radius_m + 0.05
                    nearest_m = PLACE_M if has_collided else outline_m
                    ahead_m = np.linspace(nearest_m, outline_m, 5)[:, np.newaxis] * unit_vector(pose[2:])
                    self._seen.add(pose[:2] + ahead_m, time_s, TOUCHED_S if has_collided else SEEN_S)
                self._stuck_at_m.append(pose[:2])
                self._command = max(BACK_OFF_COMMANDS, key=lambda command: free_distance(lidar_m, *command, robot))
                self._back_off_until_s = time_s + BACK_OFF_S
                self._last_place_m = None
                self.phase = Phase("back off")
        v, yaw_rate = self._command
        fastest = min(max(speed_mps * np.sign(v), 0.0) + 1.0 * STEP_S, limit_mps)
        return self._sent(safe_command(lidar_m, float(np.clip(v, -fastest, fastest)), yaw_rate, robot), robot)

    def _sent(self, command: tuple[float, float], robot: RobotDescription) -> Action:
        """Return the action of a command, and remember the command."""
        self._sent_velocity = np.array(command)
        return robot.action_from_command(command)

    def _has_collided(self, velocity: FloatArray) -> bool:
        """Return True if an obstacle, which may be above or below the lidar's plane, has stopped or turned the robot.

        Args:
            velocity: Speed in m/s and yaw rate in rad/s, shape (2,). They lie between the last ones and those that were
                commanded unless the robot has touched something.
        """
        (before_mps, before_radps), (sent_mps, sent_radps) = self._velocity, self._sent_velocity
        speed_mps, yaw_radps = velocity.astype(np.float64)
        ahead = np.sign(before_mps)
        lost_mps = min(ahead * before_mps, ahead * sent_mps) - ahead * speed_mps
        turned_radps = abs(yaw_radps - np.clip(yaw_radps, *sorted((before_radps, sent_radps))))
        return bool(lost_mps > COLLISION_MPS or turned_radps > COLLISION_RADPS)

    def _gives_way(self, scan: Scan, robot: RobotDescription) -> bool:
        """Change the command if it comes too close to what moves, and return whether it was changed."""
        command = self._moving.yielding_command(scan, *self._command, robot)
        if command == self._command:
            self._gives_way_s = max(self._gives_way_s - STEP_S, 0.0)
            return False
        self._gives_way_s += STEP_S
        if self._gives_way_s > PATIENCE_S:
            return False
        self._command = command
        self._last_place_m = None
        self.phase = Phase("give way", self.phase.target)
        return True

    def resume(self) -> None:
        """Forget the last motion, and let the policy prepare to go on."""
        self._velocity = self._sent_velocity = np.zeros(2)
        self._last_place_m = None
        resume(self._policy)

    def _is_stuck(self, pose: FloatArray, time_s: float, would_move: bool) -> bool:
        """Return True if the robot has moved less than 0.2 m in 4 s.

        Both are assumed: 0.2 m is more than the pose error, 4 s are longer than a turn.
        """
        has_moved = self._last_place_m is None or np.hypot(*(pose[:2] - self._last_place_m)) > 0.2
        if has_moved or not would_move:
            self._last_place_m, self._moved_s = pose[:2], time_s
        return time_s - self._moved_s > 4.0
