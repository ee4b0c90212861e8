"""Patrol: drive the planned route."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dirmusic import Finding
from pdpatrol.envs.observation import Observation
from pdpatrol.missions.driving.path_follower import PathFollower
from pdpatrol.missions.driving.site_map import ShortestPaths, SiteMap
from pdpatrol.missions.policies.protocol import Action, believed_pose, time_of
from pdpatrol.missions.record.events import Phase


class Patrol:
    """Drives the route and returns to the dock, whatever is detected; stands still without a route."""

    def __init__(self) -> None:
        self.phase = Phase("patrol")
        self.unreachable: tuple[int, ...] = ()
        self._next_stop = 0
        self._drive: PathFollower | None = None
        self._leg_m: dict[int, float] = {}

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """Drive to the next stop; return None once the dock is reached or given up."""
        if not site_map.route.stops_m:
            self.phase = Phase("listen")
            return np.zeros(2, dtype=np.float32)
        pose, time_s = believed_pose(observation), time_of(observation, site_map)
        stops = (*site_map.route.stops_m, site_map.route.dock_m)
        radius = 0.7 * site_map.task.waypoint_radius_m  # the rest is for the pose error (assumed)
        while self._next_stop < len(stops):
            goal, is_dock = np.asarray(stops[self._next_stop]), self._next_stop == len(stops) - 1
            if self._drive is None:
                self._drive = PathFollower(site_map, pose, goal, time_s, radius)
            self._drive.update_map(site_map, pose)
            if not self._drive.is_over(pose, time_s):
                self.phase = Phase("return to dock") if is_dock else Phase("patrol", self._next_stop + 1)
                return self._drive.action(pose)
            if not self._drive.has_arrived(pose) and not is_dock:
                self.unreachable = (*self.unreachable, self._next_stop + 1)
            self._drive = None
            self._next_stop += 1
        return None

    def is_homebound(self, site_map: SiteMap) -> bool:
        """Return True when all waypoints are done."""
        return self._next_stop >= len(site_map.route.waypoints_m)

    def remaining_m(self, paths: ShortestPaths, site_map: SiteMap) -> float:
        """Return the length of the path past all remaining stops, from the start of `paths`.

        Stops without a known path do not count.
        """
        stops = np.array([*site_map.route.waypoints_m, site_map.route.dock_m])[self._next_stop :]
        if not len(stops):
            return 0.0
        for number in range(self._next_stop, self._next_stop + len(stops) - 1):
            if number not in self._leg_m:
                start, end = stops[number - self._next_stop : number - self._next_stop + 2]
                self._leg_m[number] = _finite_or_zero(site_map.reach(start).length_m[site_map.cell(end)])
        first_m = _finite_or_zero(paths.length_m[site_map.cell(stops[0])])
        return first_m + sum(length for number, length in self._leg_m.items() if number >= self._next_stop)

    def resume(self) -> None:
        """Plan the path to the next stop again, after a detour."""
        self._drive = None


def _finite_or_zero(length_m: float) -> float:
    return float(length_m) if np.isfinite(length_m) else 0.0
