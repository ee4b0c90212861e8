"""Seek: leave the route for every candidate, until it is confirmed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dirmusic import Finding
from envs.patrol_env import STEP_S, Observation
from missions.driving.path_follower import PathFollower
from missions.driving.site_map import SiteMap
from missions.policies.patrol import Patrol
from missions.policies.protocol import Action, believed_pose, time_of
from missions.policies.viewpoints import best_viewpoint

FloatArray = NDArray[np.float64]

PURSUIT_LIMIT_S = 240.0
"""Time given to one candidate in all before the robot keeps to its route (assumed)."""

IN_VAIN_S = 120.0
"""A candidate that nothing can be done about just now has used up so much of that time (assumed)."""

REPLAN_S = 3.0
"""Time between searches for a better viewpoint (assumed)."""

VIEW_RADIUS_M = 0.4
"""How near to a viewpoint is near enough (assumed)."""

VIEW_SPACING_M = 0.5
"""Length after which the robot's place counts as another view (assumed)."""


class Seek:
    """Patrol; view each candidate from several sides until it is confirmed, then return to the route."""

    def __init__(self) -> None:
        self.phase = "patrol"
        self.unreachable: tuple[int, ...] = ()
        self._patrol = Patrol()
        self._target: int | None = None
        self._pursued_s: dict[int, float] = {}
        self._views_m: list[FloatArray] = []
        self._drive: PathFollower | None = None
        self._planned_s = -np.inf

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """Towards the best viewpoint of the candidate in hand, or the next stop of the route."""
        if not site_map.route.stops_m:
            self.phase = "listen"
            return np.zeros(2, dtype=np.float32)
        pose, time_s = believed_pose(observation), time_of(observation, site_map)
        target = self._choose(findings, pose)
        if target is not None:
            action = self._pursue(target, pose, time_s, site_map)
            if action is not None:
                self.phase = f"seek {target.id}"
                self._pursued_s[target.id] += STEP_S
                return action
            self._pursued_s[target.id] += IN_VAIN_S
            self._drop()
        action = self._patrol(observation, findings, site_map)
        self.phase, self.unreachable = self._patrol.phase, self._patrol.unreachable
        return action

    def _choose(self, findings: Sequence[Finding], pose: FloatArray) -> Finding | None:
        """The candidate in hand while it is one and time is left, else the nearest that deserves a try."""
        open_ones = {f.id: f for f in findings if f.state == "candidate"}
        if self._target is not None:
            if self._target in open_ones and self._pursued_s[self._target] < PURSUIT_LIMIT_S:
                return open_ones[self._target]
            self._drop()
        worth = [f for f in open_ones.values() if self._pursued_s.get(f.id, 0.0) < PURSUIT_LIMIT_S]
        if not worth:
            return None
        target = min(worth, key=lambda f: float(np.hypot(*(f.position_m[:2] - pose[:2]))))
        self._target = target.id
        self._pursued_s.setdefault(target.id, 0.0)
        self._views_m, self._drive = [], None
        return target

    def _drop(self) -> None:
        """Go back to the route."""
        self._target, self._drive = None, None
        self._patrol.resume()

    def _pursue(self, target: Finding, pose: FloatArray, time_s: float, site_map: SiteMap) -> Action | None:
        """Along the path to the current viewpoint; plans another when it is reached, old, or too slow."""
        if not self._views_m or np.hypot(*(self._views_m[-1] - pose[:2])) > VIEW_SPACING_M:
            self._views_m.append(pose[:2].copy())
        needs_another = self._drive is None or self._drive.is_over(pose, time_s) or self._drive.site_map is not site_map
        if needs_another or time_s - self._planned_s >= REPLAN_S:
            paths = site_map.reach(pose)
            goal = best_viewpoint(target.position_m, np.asarray(self._views_m), paths, site_map)
            if goal is None:
                return None
            self._drive, self._planned_s = PathFollower(site_map, pose, goal, time_s, VIEW_RADIUS_M, paths), time_s
        assert self._drive is not None
        return self._drive.action(pose) if self._drive.is_reachable else None
