"""Patrol: drive the planned route, and dwell at its waypoints."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from dirmusic import Finding
from pdpatrol.envs.observation import Observation
from pdpatrol.missions.driving.local_paths import LocalPaths
from pdpatrol.missions.driving.path_follower import PathFollower
from pdpatrol.missions.driving.site_map import ShortestPaths, SiteMap
from pdpatrol.missions.policies.protocol import Action, ReportingPolicy, believed_pose, time_of
from pdpatrol.missions.record.events import Phase

MOST_CHARGES = 3
"""Number of charges after which a stop is given up as out of reach. The first may have been spent elsewhere, and the
second by detours (assumed)."""


class Patrol(ReportingPolicy):
    """Policy that drives the route and returns to the dock, whatever is detected; without a route it stands still."""

    def __init__(self) -> None:
        self.phase = Phase("patrol")
        self._next_stop = 0
        self._drive: PathFollower | None = None
        self._leaves_s: float | None = None
        self._legs_m: list[float] = []
        self._n_charges = 0

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """Drive to the next stop; return None once the dock is reached or given up."""
        if not site_map.route.stops_m:
            self.phase = Phase("listen")
            return np.zeros(2, dtype=np.float32)
        pose, time_s = believed_pose(observation), time_of(observation, site_map)
        stops = (*site_map.route.stops_m, site_map.route.dock_m)
        radius = 0.7 * site_map.task.waypoint_radius_m  # leaves a margin for the pose error (assumed)
        while self._next_stop < len(stops):
            goal, is_dock = np.asarray(stops[self._next_stop]), self._next_stop == len(stops) - 1
            if self._drive is None:
                self._drive = PathFollower(site_map.reach(pose), goal, time_s, radius)
            self._drive.update_map(site_map, pose)
            if self._drive.has_arrived(pose) and not is_dock and self._leaves_s is None:
                self._leaves_s = time_s + site_map.route.dwell_s
            if self._leaves_s is not None and time_s < self._leaves_s:
                self.phase = Phase("listen", self._next_stop + 1)
                return np.zeros(2, dtype=np.float32)
            if self._leaves_s is None and not self._drive.is_over(pose, time_s):
                self.phase = Phase("return to dock") if is_dock else Phase("patrol", self._next_stop + 1)
                return self._drive.action(pose)
            if self._leaves_s is None and not self._drive.has_arrived(pose) and not is_dock:
                self.unreachable = (*self.unreachable, self._next_stop + 1)
            self._drive, self._leaves_s, self._n_charges = None, None, 0
            self._next_stop += 1
        return None

    def is_homebound(self, site_map: SiteMap) -> bool:
        """Return True when all waypoints are done."""
        return self._next_stop >= len(site_map.route.waypoints_m)

    def dwell_s(self, site_map: SiteMap) -> float:
        """Return the time for which the robot will still stand at waypoints, at most."""
        return site_map.route.dwell_s * max(len(site_map.route.stops_m) - self._next_stop, 0)

    def remaining_m(self, paths: ShortestPaths, site_map: SiteMap) -> float:
        """Return the length of the path past all remaining stops, from the start of `paths`.

        Stops without a known path do not count.
        """
        stops = [*site_map.route.stops_m, site_map.route.dock_m]
        if not self._legs_m:
            paths_between = LocalPaths(site_map)
            self._legs_m = [paths_between.cost_m(a, b) for a, b in pairwise(map(site_map.cell, stops))]
        first_m = paths.length_m[site_map.cell(stops[self._next_stop])]
        return float(sum(leg_m for leg_m in [first_m, *self._legs_m[self._next_stop :]] if np.isfinite(leg_m)))

    def plan_anew(self) -> None:
        """Plan the path to the next stop again, after a detour, and dwell there anew."""
        self._drive = self._leaves_s = None

    def resume(self) -> None:
        """Go on after a charge; give up a stop to which the robot drove for all of `MOST_CHARGES` charges."""
        self._n_charges += self._leaves_s is None
        if self._n_charges == MOST_CHARGES:
            self._n_charges = 0
            self.unreachable = (*self.unreachable, self._next_stop + 1)
            self._next_stop += 1
        self.plan_anew()
