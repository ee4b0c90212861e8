"""Seek and Active: leave the route for a candidate as long as that helps and the route can still be finished."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

from dirmusic import Finding
from dirmusic.arrays import FloatArray
from dirmusic.locating.finding import SQUARE_95
from pdpatrol.envs.patrol_env import STEP_S, Observation
from pdpatrol.missions.driving.path_follower import PathFollower
from pdpatrol.missions.driving.site_map import ShortestPaths, SiteMap
from pdpatrol.missions.policies.patrol import Patrol
from pdpatrol.missions.policies.protocol import Action, ReportingPolicy, believed_pose, status_of, time_of
from pdpatrol.missions.policies.viewpoints import (
    MIN_PATH_M,
    best_viewpoint,
    driving_time,
    expected_information,
    likely_place,
)
from pdpatrol.missions.record.events import Phase

PATIENCE_S = 50.0
"""Time without improvement after which a candidate is set aside. Assumed; enough to drive to another side of it."""

UNDETECTED_S = 20.0
"""Time of pursuit without a detection after which a candidate is set aside until it is detected again. Assumed."""

FRUITLESS_S, LIKELY = 100.0, 0.5
"""Time of pursuit without a confirmation after which only candidates of this existence probability are pursued until
one is confirmed or the route is finished. Assumed; multipath can initiate candidates again and again."""

KNOWN_M = 0.5
"""Longer half-axis of the 95 % ellipse below which a candidate needs a view from a new side instead of more
information. Assumed."""


@dataclass
class Pursuit:
    """Times that a policy has spent on a candidate.

    Attributes:
        spent_s: Total time.
        stagnant_s: Time since it last improved.
        undetected_s: Time since it was last detected.
        best_m: Smallest semi-major axis of its ellipse so far.
        detected_s: Time of the last detection.
    """

    spent_s: float = 0.0
    stagnant_s: float = 0.0
    undetected_s: float = 0.0
    best_m: float = np.inf
    detected_s: float = -np.inf

    @property
    def is_over(self) -> bool:
        """True if more time would be wasted or 150 s (assumed) are spent, which start again after the route."""
        return self.spent_s >= 150.0 or self.stagnant_s >= PATIENCE_S or self.undetected_s >= UNDETECTED_S

    def spend(self, target: Finding, time_s: float) -> None:
        """Add time, and check whether the candidate has improved: its ellipse is a fifth smaller (assumed)."""
        self.spent_s += time_s
        self.stagnant_s += time_s
        self.undetected_s += time_s
        if target.semi_major_m < 0.8 * self.best_m:
            self.best_m, self.stagnant_s = target.semi_major_m, 0.0

    def note_detection(self, target: Finding) -> None:
        """Check whether the candidate has been detected again."""
        if target.last_detected_s > self.detected_s:
            self.detected_s, self.undetected_s = target.last_detected_s, 0.0


class Seek(ReportingPolicy):
    """Policy that patrols, views each candidate from several sides until it is confirmed, and returns to the route.

    Args:
        route_first: Leave a candidate when the route could not be finished in time otherwise.
    """

    def __init__(self, *, route_first: bool = True) -> None:
        self._route_first = route_first
        self.phase = Phase("patrol")
        self._patrol = Patrol()
        self._target: int | None = None
        self._pursuits: dict[int, Pursuit] = {}
        self._fruitless_s, self._n_confirmed = 0.0, 0
        self._views_m: list[FloatArray] = []
        self._drive: PathFollower | None = None
        self._planned_s = -np.inf
        self._is_late = False
        self._has_new_time = False

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """Drive to the best viewpoint of the current candidate, or to the next stop of the route."""
        pose, time_s = believed_pose(observation), time_of(observation, site_map)
        if self._patrol.is_homebound(site_map) and not self._has_new_time:
            self._has_new_time = True
            self._pursuits, self._fruitless_s = {}, 0.0
        target = self._choose(findings, pose) if site_map.route.stops_m else None
        if target is not None:
            action = self._pursue(target, pose, time_s, site_map)
            if action is not None:
                self.phase = Phase("seek", target.id)
                self._pursuits[target.id].spend(target, STEP_S)
                self._fruitless_s += STEP_S
                return action
            self._pursuits[target.id].spend(target, 25.0)  # cost of a candidate without a viewpoint (assumed)
            self._drop()
        action = self._patrol(observation, findings, site_map)
        self.phase, self.unreachable = status_of(self._patrol)
        return action

    def viewpoint(
        self, target: Finding, views_m: FloatArray, pose: FloatArray, paths: ShortestPaths
    ) -> FloatArray | None:
        """Return the place from which to view a candidate next, shape (2,); None if no place helps.

        Args:
            target: The candidate.
            views_m: Places from which it has been viewed, shape (n, 2), n at least 1.
            pose: Estimated pose, shape (3,).
            paths: Shortest paths from that pose.
        """
        return best_viewpoint(target.position_m, views_m, paths)

    def resume(self) -> None:
        """Choose a viewpoint of the current candidate anew, or go on with the route."""
        self._drive = None
        if self._target is None:
            self._patrol.resume()

    def _choose(self, findings: Sequence[Finding], pose: FloatArray) -> Finding | None:
        """Return the current candidate while its time is not spent, else the nearest such one."""
        if self._is_late:
            return None
        n_confirmed = sum(f.state == "confirmed" for f in findings)
        if n_confirmed > self._n_confirmed:
            self._fruitless_s = 0.0
        self._n_confirmed = n_confirmed
        least = LIKELY if self._fruitless_s > FRUITLESS_S else 0.0
        candidates = {f.id: f for f in findings if f.state == "candidate" and f.existence >= least}
        for number in candidates.keys() & self._pursuits.keys():
            self._pursuits[number].note_detection(candidates[number])
            if self._pursuits[number].is_over:
                del candidates[number]
        if self._target in candidates:
            return candidates[self._target]
        if self._target is not None:
            self._drop()
        if not candidates:
            return None
        target = min(candidates.values(), key=lambda f: float(np.hypot(*(f.position_m[:2] - pose[:2]))))
        self._target = target.id
        self._pursuits.setdefault(target.id, Pursuit())
        self._views_m = []
        return target

    def _drop(self) -> None:
        """Return to the route."""
        self._target, self._drive = None, None
        self._patrol.plan_anew()

    def _pursue(self, target: Finding, pose: FloatArray, time_s: float, site_map: SiteMap) -> Action | None:
        """Drive to the current viewpoint; choose another when it is reached, outdated or too slow to reach."""
        if not self._views_m or np.hypot(*(self._views_m[-1] - pose[:2])) > 0.5:  # a new view (assumed)
            self._views_m.append(pose[:2].copy())
        drive = self._drive
        is_due = time_s - self._planned_s >= 3.0  # time to search for a better viewpoint (assumed)
        if drive is None or is_due or drive.is_over(pose, time_s) or not drive.is_planned_on(site_map):
            paths = site_map.reach(pose)
            mean_speed_mps = 0.6 * site_map.robot.max_speed_mps  # with stops and turns (assumed)
            route_s = self._patrol.dwell_s(site_map) + self._patrol.remaining_m(paths, site_map) / mean_speed_mps
            self._is_late = self._route_first and time_s + route_s > site_map.task.time_limit_s
            goal = None if self._is_late else self.viewpoint(target, np.array(self._views_m), pose, paths)
            if goal is None:
                return None
            drive = PathFollower(paths, goal, time_s, 0.4)
            self._drive, self._planned_s = drive, time_s
        return drive.action(pose) if drive.is_reachable else None


class Active(Seek):
    """Variant of Seek that takes the path on which the ellipse is expected to become small enough soonest."""

    def __init__(self) -> None:
        super().__init__()
        self._chosen = 0, 0  # id of the candidate and cell

    def viewpoint(
        self, target: Finding, views_m: FloatArray, pose: FloatArray, paths: ShortestPaths
    ) -> FloatArray | None:
        """Return the end of the fastest path on which the candidate is expected to be located accurately enough.

        Information is summed along the path, except within 0.6 m of earlier places of the robot, where errors are
        the same. The previous path is kept while it takes at most 2 s longer (both assumed), because each change costs
        a turn. A candidate that is located accurately but not confirmed, or for which no path suffices, is viewed from
        a new side. A new path must be expected to lead to 0.8 times `KNOWN_M` (assumed), because drives differ from
        plans.
        """
        if target.semi_major_m <= KNOWN_M:
            return super().viewpoint(target, views_m, pose, paths)
        site_map = paths.site_map
        target_m = likely_place(target, pose, site_map)
        information = expected_information(site_map.centres_m, target_m, site_map)
        is_new = cdist(site_map.centres_m, views_m).min(axis=-1) > 0.6
        gained = paths.integrate(information * is_new[:, np.newaxis, np.newaxis])
        after_m2 = np.linalg.inv(np.linalg.inv(target.covariance_m2) + gained)
        semi_major_m = np.sqrt(SQUARE_95 * np.linalg.eigvalsh(after_m2[:, :2, :2])[:, 1])
        time_s = np.where(paths.length_m > MIN_PATH_M, driving_time(paths, pose), np.inf)
        sufficient_s = np.where(semi_major_m <= 0.8 * KNOWN_M, time_s, np.inf)
        best = int(sufficient_s.argmin())
        if not np.isfinite(sufficient_s[best]):
            return super().viewpoint(target, views_m, pose, paths)
        number, kept = self._chosen
        if number == target.id and semi_major_m[kept] <= KNOWN_M and time_s[kept] <= sufficient_s[best] + 2.0:
            best = kept
        self._chosen = target.id, best
        return site_map.centres_m[best]
