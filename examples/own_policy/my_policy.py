"""Example of a user's policy: circle each discharge until its position is accurate."""

from collections.abc import Sequence

import numpy as np

from dirmusic import Finding
from pdpatrol.envs.patrol_env import STEP_S, Observation
from pdpatrol.missions.driving.path_follower import PathFollower
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.policies.collision_guard import CollisionGuard
from pdpatrol.missions.policies.patrol import Patrol
from pdpatrol.missions.policies.protocol import Action, believed_pose, time_of
from pdpatrol.missions.record.events import Phase

RADIUS_M, AHEAD_RAD, REPLAN_S, PURSUIT_S, SHARP_M = 3.0, np.radians([60.0, -60.0]), 3.0, 120.0, 0.12


class MyPolicy:
    """Policy that circles each finding in steps of 60 degrees until its 95 % ellipse is shorter than 12 cm.

    Bearings from different sides determine a position; `seek` stops when the finding is confirmed.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self.phase = Phase("patrol")  # shown by the log, the recording and the progress bar
        self._patrol, self._drive, self._planned_s = Patrol(), None, -np.inf
        self._spent_s: dict[int, float] = {}

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """Return forward speed and yaw rate in [-1, 1], or None when back at the dock."""
        wanted = [f for f in findings if is_blurred(f) and self._spent_s.get(f.id, 0.0) < PURSUIT_S]
        if not wanted:
            self._drive = None
            action = self._patrol(observation, findings, site_map)
            self.phase = self._patrol.phase
            return action
        self._patrol.resume()  # plans a new path after the detour
        pose, time_s = believed_pose(observation), time_of(observation, site_map)
        target = min(wanted, key=lambda f: float(np.hypot(*(f.position_m[:2] - pose[:2]))))
        self._spent_s[target.id] = self._spent_s.get(target.id, 0.0) + STEP_S
        if self._drive is None or self._drive.is_over(pose, time_s) or time_s - self._planned_s > REPLAN_S:
            x, y = pose[:2] - target.position_m[:2]
            angles, paths = np.arctan2(y, x) + AHEAD_RAD, site_map.reach(pose)
            places = target.position_m[:2] + RADIUS_M * np.column_stack([np.cos(angles), np.sin(angles)])
            cells = [paths.nearest(place) for place in places]  # on free ground
            goal = site_map.centres_m[min(cells, key=lambda cell: paths.length_m[cell])]
            self._drive, self._planned_s = PathFollower(paths, goal, time_s, 0.5), time_s
        self.phase = Phase("circle", target.id)
        return self._drive.action(pose)


def is_blurred(finding: Finding) -> bool:
    """Return True if more bearings are needed: the finding is not confirmed, or its 95 % ellipse is too long."""
    return finding.state == "candidate" or (finding.state == "confirmed" and finding.semi_major_m > SHARP_M)


def guarded(rng: np.random.Generator) -> CollisionGuard:
    """Wrap the policy in the collision guard."""
    return CollisionGuard(MyPolicy(rng))
