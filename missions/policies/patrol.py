"""Patrol: the route and nothing else."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dirmusic import Finding
from pdpatrol.envs.patrol_env import Observation
from pdpatrol.missions.driving.path_follower import PathFollower
from pdpatrol.missions.driving.site_map import ShortestPaths, SiteMap
from pdpatrol.missions.policies.protocol import Action, believed_pose, time_of
from pdpatrol.missions.record.events import Phase

FloatArray = NDArray[np.float64]

INSIDE_WAYPOINT = 0.7
"""Share of a waypoint's radius within which the robot aims (assumed): inside it, whatever the error of the pose."""


class Patrol:
    """Drive the route and go home, whatever is detected; without a route, stand still."""

    def __init__(self) -> None:
        self.phase = Phase("patrol")
        self.unreachable: tuple[int, ...] = ()
        self._next_stop = 0
        self._drive: PathFollower | None = None
        self._leg_m: dict[int, float] = {}

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """Towards the next stop; None once the dock is reached, or given up."""
        if not site_map.route.stops_m:
            self.phase = Phase("listen")
            return np.zeros(2, dtype=np.float32)
        pose, time_s = believed_pose(observation), time_of(observation)
        stops = (*site_map.route.stops_m, site_map.route.dock_m)
        radius = INSIDE_WAYPOINT * site_map.task.waypoint_radius_m
        while self._next_stop < len(stops):
            goal = np.asarray(stops[self._next_stop])
            if self._drive is None:
                self._drive = PathFollower(site_map, pose, goal, time_s, radius)
            self._drive.follow(site_map, pose)
            if not self._drive.is_over(pose, time_s):
                is_last = self._next_stop == len(stops) - 1
                self.phase = Phase("return to dock") if is_last else Phase("patrol", self._next_stop + 1)
                return self._drive.action(pose)
            if not self._drive.has_arrived(pose) and self._next_stop < len(stops) - 1:
                self.unreachable = (*self.unreachable, self._next_stop + 1)
            self._drive = None
            self._next_stop += 1
        return None

    def is_homebound(self, site_map: SiteMap) -> bool:
        """Whether all waypoints lie behind it."""
        return self._next_stop >= len(site_map.route.waypoints_m)

    def remaining_m(self, paths: ShortestPaths, site_map: SiteMap) -> float:
        """Length of the way past all stops that are left, from where some paths start.

        Stops to which no way is known do not count.
        """
        stops = np.array([*site_map.route.waypoints_m, site_map.route.dock_m])[self._next_stop :]
        if not len(stops):
            return 0.0
        for number in range(self._next_stop, self._next_stop + len(stops) - 1):
            if number not in self._leg_m:
                start, end = stops[number - self._next_stop : number - self._next_stop + 2]
                self._leg_m[number] = _if_any(site_map.reach(start).length_m[site_map.cell(end)])
        first_m = _if_any(paths.length_m[site_map.cell(stops[0])])
        return first_m + sum(length for number, length in self._leg_m.items() if number >= self._next_stop)

    def resume(self) -> None:
        """Plan the way to the next stop anew, after a detour."""
        self._drive = None


def _if_any(length_m: float) -> float:
    """The length of a way, 0 where there is none."""
    return float(length_m) if np.isfinite(length_m) else 0.0
