"""Seek: leave the route for a candidate while that gets anywhere and the route can still be finished in time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dirmusic import Finding
from pdpatrol.envs.patrol_env import STEP_S, Observation
from pdpatrol.missions.driving.path_follower import PathFollower
from pdpatrol.missions.driving.site_map import ShortestPaths, SiteMap
from pdpatrol.missions.policies.patrol import Patrol
from pdpatrol.missions.policies.protocol import Action, believed_pose, time_of
from pdpatrol.missions.policies.viewpoints import best_viewpoint
from pdpatrol.missions.record.events import Phase

FloatArray = NDArray[np.float64]

PATIENCE_S = 50.0
"""A candidate that has got no better for so long is set aside (assumed): time for the way to another side of it."""

BETTER = 0.8
"""A candidate has got better once its ellipse is this much shorter (assumed)."""

PURSUIT_LIMIT_S = 150.0
"""Time given to one candidate in all before the robot keeps to its route (assumed); as much again after the route."""

IN_VAIN_S = 25.0
"""A candidate that nothing can be done about just now has used up so much of that time (assumed)."""

REPLAN_S = 3.0
"""Time between searches for a better viewpoint (assumed)."""

MEAN_SPEED_SHARE = 0.6
"""Share of its top speed that the robot makes on its route, stops and turns included (assumed)."""

SILENCE_S = 20.0
"""A candidate that has not been detected for so long a time of its pursuit is set aside until it is (assumed)."""

VIEW_RADIUS_M = 0.4
"""How near to a viewpoint is near enough (assumed)."""

VIEW_SPACING_M = 0.5
"""Length after which the robot's place counts as another view (assumed)."""


@dataclass
class Pursuit:
    """What was spent on a candidate.

    Attributes:
        spent_s: In all.
        in_vain_s: Since it last got better.
        silent_s: Since it was last detected.
        best_m: Shortest half-axis of its ellipse, the longer one.
        detected_s: When it was last detected.
    """

    spent_s: float = 0.0
    in_vain_s: float = 0.0
    silent_s: float = 0.0
    best_m: float = np.inf
    detected_s: float = -np.inf

    @property
    def is_over(self) -> bool:
        """Whether more of it would be in vain."""
        return self.spent_s >= PURSUIT_LIMIT_S or self.in_vain_s >= PATIENCE_S or self.silent_s >= SILENCE_S

    def spend(self, target: Finding, time_s: float) -> None:
        """Count time, and see whether the candidate has got better."""
        self.spent_s += time_s
        self.in_vain_s += time_s
        self.silent_s += time_s
        if target.semi_major_m < BETTER * self.best_m:
            self.best_m, self.in_vain_s = target.semi_major_m, 0.0

    def hear(self, target: Finding) -> None:
        """See whether the candidate has been detected again."""
        if target.last_detected_s > self.detected_s:
            self.detected_s, self.silent_s = target.last_detected_s, 0.0


class Seek:
    """Patrol; view each candidate from several sides until it is confirmed, then return to the route.

    Args:
        route_first: Whether candidates are left where the route could not be finished in time any more.
    """

    def __init__(self, *, route_first: bool = True) -> None:
        self._route_first = route_first
        self.phase = Phase("patrol")
        self.unreachable: tuple[int, ...] = ()
        self._patrol = Patrol()
        self._target: int | None = None
        self._pursuits: dict[int, Pursuit] = {}
        self._views_m: list[FloatArray] = []
        self._drive: PathFollower | None = None
        self._planned_s = -np.inf
        self._is_late = False
        self._has_new_time = False

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """Towards the best viewpoint of the candidate in hand, or the next stop of the route."""
        if not site_map.route.stops_m:
            self.phase = Phase("listen")
            return np.zeros(2, dtype=np.float32)
        pose, time_s = believed_pose(observation), time_of(observation)
        if self._patrol.is_homebound(site_map) and not self._has_new_time:
            self._has_new_time = True
            self._pursuits = {}
        target = self._choose(findings, pose)
        if target is not None:
            action = self._pursue(target, pose, time_s, site_map)
            if action is not None:
                self.phase = Phase("seek", target.id)
                self._pursuits[target.id].spend(target, STEP_S)
                return action
            self._pursuits[target.id].spend(target, IN_VAIN_S)
            self._drop()
        action = self._patrol(observation, findings, site_map)
        self.phase, self.unreachable = self._patrol.phase, self._patrol.unreachable
        return action

    def viewpoint(
        self, target: Finding, pose: FloatArray, paths: ShortestPaths, site_map: SiteMap
    ) -> FloatArray | None:
        """Where to view a candidate from next, shape (2,); None if no place is of use.

        Args:
            target: The candidate.
            pose: Believed, shape (3,).
            paths: All from there.
            site_map: Where the robot fits, and what hides the candidate.
        """
        return best_viewpoint(target.position_m, np.asarray(self._views_m), paths, site_map)

    def _choose(self, findings: Sequence[Finding], pose: FloatArray) -> Finding | None:
        """The candidate in hand while it is one and time is left, else the nearest that deserves a try."""
        if self._is_late:
            return None
        open_ones = {f.id: f for f in findings if f.state == "candidate"}
        for number in open_ones.keys() & self._pursuits.keys():
            self._pursuits[number].hear(open_ones[number])
        if self._target is not None:
            if self._target in open_ones and not self._pursuits[self._target].is_over:
                return open_ones[self._target]
            self._drop()
        worth = [f for f in open_ones.values() if f.id not in self._pursuits or not self._pursuits[f.id].is_over]
        if not worth:
            return None
        target = min(worth, key=lambda f: float(np.hypot(*(f.position_m[:2] - pose[:2]))))
        self._target = target.id
        self._pursuits.setdefault(target.id, Pursuit())
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
            route_s = self._patrol.remaining_m(paths, site_map) / (MEAN_SPEED_SHARE * site_map.robot.max_speed_mps)
            self._is_late = self._route_first and time_s + route_s > site_map.task.time_limit_s
            goal = None if self._is_late else self.viewpoint(target, pose, paths, site_map)
            if goal is None:
                return None
            self._drive, self._planned_s = PathFollower(site_map, pose, goal, time_s, VIEW_RADIUS_M, paths), time_s
        assert self._drive is not None
        return self._drive.action(pose) if self._drive.is_reachable else None
