"""A drive to one place: its path, the wheel command that follows it, and when it is over."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dirmusic.angles import difference
from pdpatrol.missions.driving.site_map import ShortestPaths, SiteMap
from pdpatrol.missions.policies.protocol import Action
from pdpatrol.robot_models.description.robot_description import RobotDescription

FloatArray = NDArray[np.float64]

LEAST_SPEED_SHARE = 0.5
SLACK_S = 30.0
"""A drive may take its length at this share of the robot's top speed plus this slack (assumed); then its goal is given
up."""

LOOKAHEAD_M = 0.7
"""How far ahead on the path the robot steers, and over which a turn of the path is measured (assumed)."""

BRAKING_MPS2 = 0.5
"""Deceleration before turns and the end of the path (assumed): comfortable; less if the motors can do less."""

TURN_SPEED_MPS = 0.2
SHARP_TURN_RAD = np.radians(90.0)
"""A turn this sharp is taken at this speed, a lesser one faster in proportion (assumed)."""


class PathFollower:
    """A drive to one place, given up when there is no way to it or it takes too long.

    Args:
        site_map: Where the robot fits.
        pose: Believed, shape (3,).
        goal_m: Where to, shape (2,), world frame.
        time_s: Now.
        radius_m: How near is near enough.
        reach: Of `pose` on `site_map`, where it is known already.
    """

    def __init__(
        self,
        site_map: SiteMap,
        pose: FloatArray,
        goal_m: FloatArray,
        time_s: float,
        radius_m: float,
        reach: ShortestPaths | None = None,
    ) -> None:
        self.goal_m = np.asarray(goal_m, dtype=np.float64)
        self.radius_m = radius_m
        length_m = self._plan(site_map, reach or site_map.reach(pose))
        self.deadline_s = time_s + length_m / (LEAST_SPEED_SHARE * site_map.robot.max_speed_mps) + SLACK_S

    def _plan(self, site_map: SiteMap, reach: ShortestPaths) -> float:
        """Find the path that ends nearest to the goal; its cost-weighted length, metres."""
        self.site_map = site_map
        cell = reach.nearest(self.goal_m)
        self.path_m = reach.path(cell)
        if site_map.is_clear(self.path_m[-1], self.goal_m):
            self.path_m = np.vstack([self.path_m, self.goal_m])
        self._along_m = distances_along(self.path_m)
        self._speed_mps = speed_profile(self.path_m, site_map.robot)
        self.is_reachable = bool(np.linalg.norm(self.path_m[-1] - self.goal_m) <= self.radius_m)
        return float(reach.length_m[cell])

    def follow(self, site_map: SiteMap, pose: FloatArray) -> None:
        """Plan anew if this is another map than before; the deadline stays."""
        if site_map is not self.site_map:
            self._plan(site_map, site_map.reach(pose))

    def is_over(self, pose: FloatArray, time_s: float) -> bool:
        """Whether the goal is reached, out of reach by the plan, or has taken too long.

        What is out of reach for an obstacle that was seen is not given up at once: the path leads as near as it gets.
        """
        is_hopeless = not self.is_reachable and not self.site_map.obstacles_m.size
        return self.has_arrived(pose) or is_hopeless or time_s > self.deadline_s

    def has_arrived(self, pose: FloatArray) -> bool:
        """Whether the goal is near enough."""
        return float(np.hypot(*(self.goal_m - pose[:2]))) <= self.radius_m

    def action(self, pose: FloatArray) -> Action:
        """The next action along the path."""
        robot = self.site_map.robot
        return robot.action_from_command(steer(pose, self.path_m, self._along_m, self._speed_mps, robot))


def steer(
    pose: FloatArray, path_m: FloatArray, along_m: FloatArray, speed_mps: FloatArray, robot: RobotDescription
) -> tuple[float, float]:
    """Speed (m/s) and yaw rate (rad/s) that follow a path (n, 2): turn towards a point ahead, slow down in turns.

    Args:
        pose: Believed, shape (3,).
        path_m: The path.
        along_m: As of `distances_along`, shape (n,).
        speed_mps: As of `speed_profile`, shape (n,).
        robot: What it can do.
    """
    nearest = int(np.square(path_m - pose[:2]).sum(axis=-1).argmin())
    ahead = path_m[min(int(np.searchsorted(along_m, along_m[nearest] + LOOKAHEAD_M)), along_m.size - 1)]
    off = float(difference(np.arctan2(ahead[1] - pose[1], ahead[0] - pose[0]), pose[2]))
    yaw_rate = float(np.clip(2.5 * off, -robot.max_yaw_rate_radps, robot.max_yaw_rate_radps))
    v = robot.max_speed_mps * max(0.0, 1.0 - abs(off) / np.radians(50.0))
    way = path_m[min(nearest + 1, along_m.size - 1)] - path_m[max(nearest - 1, 0)]
    past_m = float(way @ (pose[:2] - path_m[nearest])) / max(float(np.linalg.norm(way)), 1e-9)
    done_m = min(along_m[nearest] + past_m, along_m[-1] - float(np.linalg.norm(path_m[-1] - pose[:2])))
    return min(v, float(np.sqrt(np.interp(done_m, along_m, np.square(speed_mps))))), yaw_rate


def speed_profile(path_m: FloatArray, robot: RobotDescription) -> FloatArray:
    r"""Speed at each point of a path (n, 2) from which `BRAKING_MPS2` is enough for the turns to come and the end.

    .. math:: v_i = \min_{j \geq i} \sqrt{u_j^2 + 2 a (s_j - s_i)}

    with the speed :math:`u_j` at which the turn at point j may be taken, and its distance :math:`s_j` along the path.

    Returns:
        Shape (n,), m/s; zero at the end.
    """
    along_m = distances_along(path_m)
    fastest, braking_mps2 = robot.max_speed_mps, min(BRAKING_MPS2, robot.max_acceleration_mps2)
    slow_down = max(fastest - TURN_SPEED_MPS, 0.0) * np.minimum(_turns(path_m, along_m) / SHARP_TURN_RAD, 1.0)
    square = np.square(fastest - slow_down)
    square[-1] = 0.0
    needed = square + 2.0 * braking_mps2 * along_m
    return np.sqrt(np.minimum.accumulate(needed[::-1])[::-1] - 2.0 * braking_mps2 * along_m)


def _turns(path_m: FloatArray, along_m: FloatArray) -> FloatArray:
    """By how much the path turns around each of its points, shape (n,), radians; zero at both ends.

    Measured over `LOOKAHEAD_M`, so that the steps of the grid are no turns.
    """

    def place(at_m: FloatArray) -> FloatArray:
        return np.stack([np.interp(at_m, along_m, path_m[:, axis]) for axis in (0, 1)], axis=-1)

    into, out_of = path_m - place(along_m - LOOKAHEAD_M), place(along_m + LOOKAHEAD_M) - path_m
    turns = np.abs(difference(np.arctan2(out_of[:, 1], out_of[:, 0]), np.arctan2(into[:, 1], into[:, 0])))
    turns[[0, -1]] = 0.0
    return turns


def distances_along(path_m: FloatArray) -> FloatArray:
    """Distance of each point of a path (n, 2) from its start, along it; shape (n,), metres."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path_m, axis=0), axis=-1))])
