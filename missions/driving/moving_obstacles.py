"""People and vehicles that the lidar sees moving, and the command by which the robot keeps away from them."""

from collections import deque
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.angles import unit_vector, wrap
from dirmusic.arrays import BoolArray, FloatArray
from dirmusic.frame import turned
from pdpatrol.missions.driving.lidar_stop import BEAM_RAD, safe_speed
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.robot_models.description.robot_description import RobotDescription
from pdpatrol.robot_models.sensors import LIDAR_BEAMS

WITHIN_M = 5.0
"""Range within which motion is looked for. Assumed; a walking person takes three seconds for it."""

BASELINE_S, PERIOD_S = 0.5, 0.2
"""Time between the scans that are compared, and between comparisons. Assumed; a walking person moves by 0.6 m and
0.25 m."""

BEYOND_M, NEAR_BEAM_M = 0.3, 0.15
"""Length by which earlier beams must have passed a point, and largest distance of the nearest of them. Assumed; five
standard deviations of pose and range, and half the width of a narrow pole."""

UNMAPPED_M = 0.4
"""Clearance on the map of points that can move. Assumed; errors of pose, map and grid add up to less."""

REACH_M = 1.0
"""Distance within which points belong to one body. Assumed; a person moves by less between compared scans."""

HOLD_S = 1.0
"""Time for which motion is extrapolated. Assumed; a person takes as long for a change of direction."""

FASTEST_MPS = 2.5
"""Highest speed that is extrapolated. Assumed; somewhat above the 1.6 m/s at which ISO 13855 lets people walk."""

HORIZON_S = 2.0
"""Time over which distances are predicted. Assumed."""

KEEP_M = 0.5
"""Distance that moving points should keep from the robot's outline. Assumed; few beams hit a person, and their points
may be that far from its nearest part."""

EVASIVE_MPS, EVASIVE_RADPS = 0.6, 0.9
"""Speed and yaw rate of the arcs on which the robot gets out of the way. Assumed; within the limits of both robots, and
enough to clear the path of a person within the horizon."""


class Scan(NamedTuple):
    """Scan of the lidar.

    Attributes:
        time_s: Time of the scan.
        pose: Pose of the robot, shape (3,).
        lidar_m: Ranges, shape (LIDAR_BEAMS,).
    """

    time_s: float
    pose: FloatArray
    lidar_m: NDArray[np.floating]

    def points(self, within_m: float) -> FloatArray:
        """Return the end points of beams shorter than `within_m`, shape (n, 2), world frame."""
        near = self.lidar_m < within_m
        return self.pose[:2] + self.lidar_m[near, np.newaxis] * unit_vector(self.pose[2] + BEAM_RAD[near])

    def passed(self, points_m: FloatArray) -> BoolArray:
        """Return whether beams passed points (n, 2) on both sides and close by; shape (n,)."""
        off_m = points_m - self.pose[:2]
        range_m = np.hypot(*off_m.T)
        beam = wrap(np.arctan2(off_m[:, 1], off_m[:, 0]) - self.pose[2]) * LIDAR_BEAMS / (2.0 * np.pi)
        right = np.floor(beam).astype(int)
        shorter_m = np.minimum(self.lidar_m[right % LIDAR_BEAMS], self.lidar_m[(right + 1) % LIDAR_BEAMS])
        to_beam_m = range_m * np.abs(beam - np.round(beam)) * (2.0 * np.pi / LIDAR_BEAMS)
        return (shorter_m > range_m + BEYOND_M) & (to_beam_m < NEAR_BEAM_M)


class MovingObstacles:
    """Points that were free shortly before, with the velocity of what covers them now.

    Static obstacles never cover ground that beams have passed, so the map need not be complete.

    Attributes:
        points_m: Points seen moving in the last `HOLD_S`, extrapolated to the last scan, shape (n, 2), world frame.
        velocity_mps: Their velocities, shape (n, 2).
    """

    def __init__(self) -> None:
        self._scans = deque[Scan]()
        self._seen: list[tuple[float, FloatArray, FloatArray]] = []
        self.points_m = self.velocity_mps = np.empty((0, 2))

    def scan(self, scan: Scan, plan: SiteMap) -> None:
        """Add a scan, at most one every `PERIOD_S`.

        Args:
            scan: The scan.
            plan: Map of what does not move.
        """
        if self._scans and scan.time_s - self._scans[-1].time_s < PERIOD_S - 1e-6:
            return
        while self._scans and scan.time_s - self._scans[0].time_s > BASELINE_S + PERIOD_S:
            self._scans.popleft()
        self._seen = [seen for seen in self._seen if scan.time_s - seen[0] < HOLD_S]
        if self._scans:
            before = self._scans[0]
            points_m = scan.points(WITHIN_M)
            is_new = before.passed(points_m)
            if is_new.any():
                is_unmapped = self._is_unmapped(points_m, plan)
                new_m = points_m[is_new & is_unmapped]
                if len(new_m):
                    velocity = self._velocity(new_m, points_m[is_unmapped], scan, before, plan)
                    self._seen.append((scan.time_s, new_m, velocity))
        self._scans.append(scan)
        points = [points_m + (scan.time_s - time_s) * velocity for time_s, points_m, velocity in self._seen]
        self.points_m = np.concatenate([np.empty((0, 2)), *points])
        self.velocity_mps = np.concatenate([np.empty((0, 2)), *(velocity for _, _, velocity in self._seen)])

    @staticmethod
    def _is_unmapped(points_m: FloatArray, plan: SiteMap) -> BoolArray:
        """Return whether the map shows nothing near points (n, 2); shape (n,)."""
        return plan.clearance(points_m) > UNMAPPED_M

    def _velocity(self, new_m: FloatArray, now_m: FloatArray, scan: Scan, before: Scan, plan: SiteMap) -> FloatArray:
        """Estimate velocities from the middles of the points around each new point (n, 2), now and before."""
        earlier_m = before.points(WITHIN_M + REACH_M)
        earlier_m = earlier_m[self._is_unmapped(earlier_m, plan)]
        towards = scan.pose[:2] - new_m
        velocity = FASTEST_MPS / 2.0 * towards / np.linalg.norm(towards, axis=-1, keepdims=True)  # from behind a corner
        for k, point_m in enumerate(new_m):
            around_m, from_m = (
                cloud[np.linalg.norm(cloud - point_m, axis=-1) < reach_m]
                for cloud, reach_m in ((now_m, 0.5 * REACH_M), (earlier_m, 1.5 * REACH_M))
            )
            if len(from_m):
                velocity[k] = (around_m.mean(axis=0) - from_m.mean(axis=0)) / (scan.time_s - before.time_s)
        speed = np.linalg.norm(velocity, axis=-1, keepdims=True)
        return velocity * np.minimum(FASTEST_MPS / np.maximum(speed, 1e-9), 1.0)

    def near(self, points_m: FloatArray) -> BoolArray:
        """Return whether points (n, 2) are within `REACH_M` of a moving point; shape (n,)."""
        off_m = np.linalg.norm(points_m[:, np.newaxis] - self.points_m, axis=-1)
        return off_m.min(axis=-1, initial=np.inf) < REACH_M

    def yielding_command(
        self, scan: Scan, v_mps: float, yaw_rate_radps: float, robot: RobotDescription
    ) -> tuple[float, float]:
        """Return the command if it keeps the distance from what moves, or else one that does.

        Standing is tried first, then arcs ahead and back that are free according to the lidar. The first command with a
        sufficient distance is taken, or else the one with the largest distance. This is the velocity obstacle of
        Fiorini and Shiller (1998) for few commands and a limited time.

        Args:
            scan: Latest scan.
            v_mps: Commanded speed.
            yaw_rate_radps: Commanded yaw rate.
            robot: The robot.
        """
        if not len(self.points_m):
            return v_mps, yaw_rate_radps
        best, largest_m, evasive_mps = (v_mps, yaw_rate_radps), -np.inf, min(EVASIVE_MPS, robot.max_speed_mps)
        arcs = product((evasive_mps, -evasive_mps), (0.0, EVASIVE_RADPS, -EVASIVE_RADPS))
        for number, command in enumerate([best, (0.0, yaw_rate_radps), *arcs]):
            if number > 1 and safe_speed(scan.lidar_m, *command, robot) != command[0]:
                continue
            away_m = self._least_distance(scan.pose, *command) - robot.footprint_radius_m
            if away_m >= KEEP_M:
                return command
            if away_m > largest_m + 0.05:  # a change must be worth it (assumed)
                best, largest_m = command, away_m
        return best

    def _least_distance(self, pose: FloatArray, v_mps: float, yaw_rate_radps: float) -> float:
        """Return the smallest distance of the robot's middle from moving points on an arc within `HORIZON_S`."""
        time_s = np.arange(0.0, HORIZON_S, 0.2)
        half_turn = 0.5 * time_s * yaw_rate_radps
        chord_m = v_mps * time_s * np.sinc(half_turn / np.pi)
        own_m = pose[:2] + turned(chord_m[:, np.newaxis] * unit_vector(half_turn), pose[2])
        moving_m = self.points_m + time_s[:, np.newaxis, np.newaxis] * self.velocity_mps
        return float(np.linalg.norm(moving_m - own_m[:, np.newaxis], axis=-1).min())
