"""Who drives: policy(observation, findings, site_map) -> action, or None when it has nothing left to do.

Every policy sees the same: what the robot senses, what the Locator found, and the operator's plan of the yard. Only
`oracle` is told the truth, as a yardstick for the others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dirmusic import Finding
from dirmusic.angles import difference
from envs.patrol_env import STEP_S, Observation
from missions.driving.collision_guard import CollisionGuard
from missions.driving.path_follower import PathFollower
from missions.driving.site_map import ShortestPaths, SiteMap
from missions.policies.names import PolicyName
from missions.policies.protocol import Action, Policy, believed_pose, time_of

FloatArray = NDArray[np.float64]

PURSUIT_LIMIT_S = 240.0
"""Time given to one candidate in all before the robot keeps to its route (assumed)."""

IN_VAIN_S = 120.0
"""A candidate that nothing can be done about just now has used up so much of that time (assumed)."""

REPLAN_S = 3.0
"""Time between looks for a better viewpoint (assumed)."""

VIEW_RADII_M = (1.8, 2.3, 2.9, 3.5)
VIEW_ASPECTS_RAD = np.radians(np.arange(0.0, 360.0, 15.0))
"""Viewpoints that are considered around a candidate (assumed): near enough to confirm, clear of its equipment."""

VIEW_ROOM_M = 0.2
"""Room between the robot and what is around a viewpoint (assumed)."""

VIEW_RADIUS_M = 0.4
"""How near to a viewpoint is near enough (assumed)."""

NOVELTY_RAD = np.radians(60.0)
NOVELTY_WORTH_M = 8.0
"""A view that opens the angle by 60 degrees is worth a detour of this length (assumed)."""


class Patrol:
    """Drive the route and go home, whatever is heard; without a route, stand and listen."""

    def __init__(self) -> None:
        self.phase = "patrol"
        self.unreachable: tuple[int, ...] = ()
        self._next_stop = 0
        self._leg: PathFollower | None = None

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """Towards the next stop; None once the dock is reached, or given up."""
        if not site_map.route.waypoints_m:
            self.phase = "listen"
            return np.zeros(2, dtype=np.float32)
        pose, time_s = believed_pose(observation), time_of(observation, site_map)
        stops = (*site_map.route.waypoints_m, site_map.route.dock_m)
        radius = 0.7 * site_map.task.waypoint_radius_m  # inside what counts, whatever the pose error
        while self._next_stop < len(stops):
            goal = np.asarray(stops[self._next_stop])
            if self._leg is None:
                self._leg = PathFollower(site_map, pose, goal, time_s, radius)
            self._leg.follow(site_map, pose)
            if not self._leg.is_over(pose, time_s):
                self.phase = "return to dock" if self._next_stop == len(stops) - 1 else f"patrol {self._next_stop + 1}"
                return self._leg.action(pose)
            if not self._leg.has_arrived(pose) and self._next_stop < len(stops) - 1:
                self.unreachable = (*self.unreachable, self._next_stop + 1)
            self._leg = None
            self._next_stop += 1
        return None

    def resume(self) -> None:
        """Plan the way to the next stop anew, after a detour."""
        self._leg = None


class Seek:
    """Patrol; on a candidate, go and look at it from several sides until it is confirmed, then return to the route."""

    def __init__(self) -> None:
        self.phase = "patrol"
        self.unreachable: tuple[int, ...] = ()
        self._patrol = Patrol()
        self._target: int | None = None
        self._pursued_s: dict[int, float] = {}
        self._views_m: list[FloatArray] = []
        self._leg: PathFollower | None = None
        self._planned_s = -np.inf

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """Towards the best viewpoint of the candidate in hand, or the next stop of the route."""
        if not site_map.route.waypoints_m:
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
        target = min(worth, key=lambda f: float(np.hypot(*(f.position_m - pose[:2]))))
        self._target = target.id
        self._pursued_s.setdefault(target.id, 0.0)
        self._views_m, self._leg = [], None
        return target

    def _drop(self) -> None:
        self._target, self._leg = None, None
        self._patrol.resume()

    def _pursue(self, target: Finding, pose: FloatArray, time_s: float, site_map: SiteMap) -> Action | None:
        """Along the leg to the current viewpoint; plans another when it is reached, old, or too slow."""
        if not self._views_m or np.hypot(*(self._views_m[-1] - pose[:2])) > 0.5:
            self._views_m.append(pose[:2].copy())
        needs_another = self._leg is None or self._leg.is_over(pose, time_s) or self._leg.site_map is not site_map
        if needs_another or time_s - self._planned_s >= REPLAN_S:
            reach = site_map.reach(pose)
            goal = self._viewpoint(target, pose, reach, site_map)
            if goal is None:
                return None
            self._leg, self._planned_s = PathFollower(site_map, pose, goal, time_s, VIEW_RADIUS_M, reach), time_s
        assert self._leg is not None
        return self._leg.action(pose) if self._leg.is_reachable else None

    def _viewpoint(
        self, target: Finding, pose: FloatArray, reach: ShortestPaths, site_map: SiteMap
    ) -> FloatArray | None:
        """A place near the candidate that sees it from a side not yet seen, and is not far to go."""
        spokes = np.stack([np.cos(VIEW_ASPECTS_RAD), np.sin(VIEW_ASPECTS_RAD)], axis=-1)
        ring = target.position_m + np.multiply.outer(np.asarray(VIEW_RADII_M), spokes).reshape(-1, 2)
        ring = ring[site_map.yard.contains(ring)]
        ring = ring[site_map.clearance(ring) > site_map.robot.footprint_radius_m + VIEW_ROOM_M] if ring.size else ring
        ring = ring[site_map.yard.in_sight(ring, target.position_m, ignore_m=0.5)] if ring.size else ring
        cells = np.array([site_map.cell(point) for point in ring], dtype=np.intp)
        length = reach.length_m[cells]
        novelty = self._novelty(ring, target.position_m)
        cost = np.where(
            (length > 0.5) & (novelty > np.radians(15.0)),
            length - NOVELTY_WORTH_M * np.minimum(novelty, NOVELTY_RAD) / NOVELTY_RAD,
            np.inf,
        )
        if cost.size and np.isfinite(cost.min()):
            return ring[cost.argmin()]
        return self._sidestep(target, pose, reach, site_map)

    def _novelty(self, points_m: FloatArray, target_m: FloatArray) -> FloatArray:
        """Angle, seen from the target, between each point (n, 2) and the nearest view already had; shape (n,)."""
        views = np.asarray(self._views_m) - target_m
        had = np.arctan2(views[:, 1], views[:, 0])
        aspect = np.arctan2(points_m[:, 1] - target_m[1], points_m[:, 0] - target_m[0])
        return np.abs(difference(aspect[:, np.newaxis], had)).min(axis=-1)

    def _sidestep(
        self, target: Finding, pose: FloatArray, reach: ShortestPaths, site_map: SiteMap
    ) -> FloatArray | None:
        """Where nothing near the candidate can be reached: the place nearby that opens the angle most."""
        near = np.flatnonzero((reach.length_m > 2.0) & (reach.length_m < 12.0))
        if near.size == 0:
            return None
        points = site_map.centres_m[near]
        visible = site_map.yard.in_sight(points, target.position_m, ignore_m=1.5)
        worth = np.minimum(self._novelty(points, target.position_m), NOVELTY_RAD) / NOVELTY_RAD * NOVELTY_WORTH_M
        score = worth - 0.2 * reach.length_m[near] + 2.0 * visible
        return points[score.argmax()]


class Random:
    """Drive at random, changing its mind once a second: the floor under all other policies."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.phase = "random"
        self.unreachable: tuple[int, ...] = ()
        self._rng = rng
        self._action = np.zeros(2, dtype=np.float32)
        self._n = 0

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """A random action, kept for ten steps."""
        if self._n % 10 == 0:
            self._action = self._rng.uniform(-1.0, 1.0, 2).astype(np.float32)
        self._n += 1
        return self._action


class Oracle:
    """Told where the discharges are: looks at each from several sides and goes home. What others are measured by."""

    def __init__(self) -> None:
        self.phase = "oracle"
        self.unreachable: tuple[int, ...] = ()
        self._seek = CollisionGuard(Seek())
        self._sources_m: list[FloatArray] = []

    def reveal(self, truth: dict[str, Any]) -> None:
        """Take in the true positions of the sources."""
        self._sources_m = [np.asarray(source["position_m"][:2]) for source in truth["sources"]]

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """As `Seek`, with the truth for candidates until the Locator has confirmed something there."""
        confirmed = [f.position_m for f in findings if f.state == "confirmed"]
        known = [
            Finding(
                id=index + 1,
                state="candidate",
                position_m=position,
                covariance_m2=np.eye(2) * 1e-4,
                n_bearings=0,
                first_heard_s=0.0,
                fixed_s=None,
                opening_rad=0.0,
                nearest_m=np.inf,
                level_db=np.nan,
            )
            for index, position in enumerate(self._sources_m)
            if all(np.hypot(*(position - other)) > 1.0 for other in confirmed)
        ]
        action = self._seek(observation, known, site_map)
        self.phase, self.unreachable = self._seek.phase, self._seek.unreachable
        return action


def make_policy(name: PolicyName, rng: np.random.Generator) -> Policy:
    """A fresh policy by name; `rng` for those that draw."""
    made: dict[PolicyName, Callable[[], Policy]] = {
        "seek": lambda: CollisionGuard(Seek()),
        "patrol": lambda: CollisionGuard(Patrol()),
        "oracle": Oracle,
        "random": lambda: Random(rng),
    }
    return made[name]()
