"""Driving to a goal: the path, the command that follows it, and the end of the drive."""

import math

import numpy as np
from numpy.typing import NDArray

from dirmusic.angles import wrapped
from dirmusic.arrays import FloatArray
from pdpatrol.missions.driving.site_map import ShortestPaths, SiteMap, distances_along
from pdpatrol.robot_models.description.robot_description import RobotDescription

SLACK_S = 30.0
"""Time after which a goal is given up, in addition to that of driving the path at half the allowed speed. Assumed."""

LOOKAHEAD_M = 0.7
"""Distance ahead on the path that the robot steers to, and over which turns of the path are measured. Assumed."""

BRAKING_MPS2 = 0.5
"""Deceleration before turns and the end of the path, lower if the motors allow less. Assumed; a gentle value."""

TURN_SPEED_MPS = 0.2
"""Speed in a turn of 90 degrees or more; smaller turns are faster in proportion. Assumed."""


class PathFollower:
    """Controller that drives to one goal, and gives it up if it is unreachable or the drive takes too long.

    Args:
        paths: Shortest paths from the robot: `site_map.reach(pose)`.
        goal_m: Goal, shape (2,), world frame.
        time_s: Current time.
        radius_m: Distance at which the goal counts as reached.

    Attributes:
        path_m: Path to the goal, or to the nearest place that can be reached, shape (n, 2).
        is_reachable: True if the path ends within `radius_m` of the goal.
        deadline_s: Time at which the goal is given up.
    """

    def __init__(self, paths: ShortestPaths, goal_m: FloatArray, time_s: float, radius_m: float) -> None:
        self.goal_m = goal_m
        self.radius_m = radius_m
        length_m = self._plan(paths)
        top_mps = paths.site_map.robot.max_speed_mps
        between_s = np.diff(self._along_m) * (1.0 / paths.site_map.speed_limit(self.path_m[1:]) - 1.0 / top_mps)
        self.deadline_s = time_s + length_m / (0.5 * top_mps) + 2.0 * float(between_s.sum()) + SLACK_S

    def _plan(self, paths: ShortestPaths) -> float:
        """Find the path that ends nearest to the goal and return its cost-weighted length, metres."""
        self.site_map = paths.site_map
        cell = paths.nearest(self.goal_m)
        self.path_m = paths.path(cell)
        if self.site_map.is_clear(self.path_m[-1], self.goal_m):
            self.path_m = np.vstack([self.path_m, self.goal_m])
        self._along_m = distances_along(self.path_m)
        limit_mps = self.site_map.speed_limit(self.path_m)
        self._square_speed = np.square(speed_profile(self.path_m, self.site_map.robot, limit_mps))
        self.is_reachable = self.has_arrived(self.path_m[-1])
        return float(paths.length_m[cell])

    def is_planned_on(self, site_map: SiteMap) -> bool:
        """Return True if the path was planned with the obstacles that a map now shows."""
        return np.array_equal(site_map.obstacles_m, self.site_map.obstacles_m)

    def update_map(self, site_map: SiteMap, pose: FloatArray) -> None:
        """Plan a new path from a pose if the obstacles have changed; the deadline stays."""
        if not self.is_planned_on(site_map):
            self._plan(site_map.reach(pose))

    def is_over(self, pose: FloatArray, time_s: float) -> bool:
        """Return True if the goal is reached, cannot be reached according to the plan, or has taken too long.

        A goal that is blocked only by a detected obstacle is not given up immediately: the path then leads as near to
        it as possible.
        """
        is_hopeless = not self.is_reachable and not self.site_map.obstacles_m.size
        return self.has_arrived(pose) or is_hopeless or time_s > self.deadline_s

    def has_arrived(self, pose: FloatArray) -> bool:
        """Return True if the pose is within the radius of the goal."""
        return float(np.hypot(*(self.goal_m - pose[:2]))) <= self.radius_m

    def action(self, pose: FloatArray) -> NDArray[np.float32]:
        """Return the action that follows the path: turn towards a point ahead on it, and slow down in turns."""
        robot, path_m, along_m = self.site_map.robot, self.path_m, self._along_m
        x, y, yaw_rad = pose.tolist()
        nearest = int(np.hypot(path_m[:, 0] - x, path_m[:, 1] - y).argmin())
        ahead = path_m[along_m[:-1].searchsorted(along_m[nearest] + LOOKAHEAD_M)]
        off = wrapped(math.atan2(ahead[1] - y, ahead[0] - x) - yaw_rad)
        v = robot.max_speed_mps * max(0.0, 1.0 - abs(off) / math.radians(50.0))
        before, behind = path_m[max(nearest - 1, 0)], path_m[min(nearest + 1, len(path_m) - 1)]
        along, across = behind[0] - before[0], behind[1] - before[1]
        past_m = along * (x - path_m[nearest, 0]) + across * (y - path_m[nearest, 1])
        past_m /= max(math.hypot(along, across), 1e-9)
        done_m = min(along_m[nearest] + past_m, along_m[-1] - math.hypot(path_m[-1, 0] - x, path_m[-1, 1] - y))
        fastest = math.sqrt(np.interp(done_m, along_m, self._square_speed))
        return robot.action_from_command((min(v, fastest), 2.5 * off))


def speed_profile(path_m: FloatArray, robot: RobotDescription, limit_mps: FloatArray) -> FloatArray:
    r"""Return the highest speed at each point of a path that lets the robot brake for turns, zones and the end.

    .. math:: v_i = \min_{j \geq i} \sqrt{u_j^2 + 2 a (s_j - s_i)}

    with the speed :math:`u_j` allowed in the turn and zone of point j, and its distance :math:`s_j` along the path.

    Args:
        path_m: The path, shape (n, 2).
        robot: The robot.
        limit_mps: Speed limit at each point, shape (n,).

    Returns:
        Shape (n,), m/s; zero at the end.
    """
    along_m = distances_along(path_m)
    fastest, braking_mps2 = robot.max_speed_mps, min(BRAKING_MPS2, robot.max_acceleration_mps2)
    turning_mps = [fastest, min(fastest, TURN_SPEED_MPS)]
    turns_mps = np.interp(_turns(path_m, along_m), [0.0, np.radians(90.0)], turning_mps)
    square = np.square(np.minimum(turns_mps, limit_mps))
    square[-1] = 0.0
    needed = square + 2.0 * braking_mps2 * along_m
    return np.sqrt(np.minimum.accumulate(needed[::-1])[::-1] - 2.0 * braking_mps2 * along_m)


def _turns(path_m: FloatArray, along_m: FloatArray) -> FloatArray:
    """Return the angle by which the path turns at each of its points, shape (n,), radians; zero at both ends.

    Turns are measured over `LOOKAHEAD_M`, so that the steps of the grid do not count as turns.
    """
    place = path_m @ [1.0, 1j]  # points of the plane as complex numbers
    into = place - np.interp(along_m - LOOKAHEAD_M, along_m, place)
    out_of = np.interp(along_m + LOOKAHEAD_M, along_m, place) - place
    turns = np.abs(np.angle(out_of * into.conj()))
    turns[[0, -1]] = 0.0
    return turns
