"""Policies by name, with the two reference policies: `random`, a lower bound, and `oracle`, which knows the truth."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from dirmusic import Finding
from pdpatrol.envs.observation import Observation
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.policies.collision_guard import CollisionGuard
from pdpatrol.missions.policies.own_policy import OwnPolicy, load_maker
from pdpatrol.missions.policies.patrol import Patrol
from pdpatrol.missions.policies.protocol import Action, ReportingPolicy, time_of
from pdpatrol.missions.policies.seek import Active, Seek
from pdpatrol.missions.record.events import Phase


class Random:
    """Drives at random and ignores obstacles."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.phase = Phase("random")
        self.unreachable: tuple[int, ...] = ()
        self._rng = rng
        self._action = np.zeros(2, dtype=np.float32)
        self._n_steps = 0

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """Draw an action once a second."""
        if self._n_steps % 10 == 0:
            self._action = self._rng.uniform(-1.0, 1.0, 2).astype(np.float32)
        self._n_steps += 1
        return self._action


class Oracle:
    """Given the true positions of the sources: views each from several sides and returns to the dock."""

    def __init__(self) -> None:
        self.phase = Phase("oracle")
        self.unreachable: tuple[int, ...] = ()
        self._seek = CollisionGuard(Seek(route_first=False))
        self._sources_m: list[np.ndarray] = []

    def reveal(self, truth: dict[str, Any]) -> None:
        """Store the true positions of the sources."""
        self._sources_m = [np.asarray(source["position_m"]) for source in truth["sources"]]

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """Act as `Seek`, with the true positions as candidates until a finding is confirmed within 1 m of them."""
        confirmed = [f.position_m for f in findings if f.state == "confirmed"]
        known = [
            Finding(
                id=index + 1,
                state="candidate",
                position_m=position,
                covariance_m2=np.eye(3) * 1e-4,
                n_bearings=0,
                first_detected_s=0.0,
                last_detected_s=time_of(observation, site_map),
                confirmed_s=None,
                aperture_rad=0.0,
                nearest_m=np.inf,
                level_db=np.nan,
            )
            for index, position in enumerate(self._sources_m)
            if all(np.hypot(*(position - other)[:2]) > 1.0 for other in confirmed)
        ]
        action = self._seek(observation, known, site_map)
        self.phase, self.unreachable = self._seek.phase, self._seek.unreachable
        return action


def make_policy(name: str, rng: np.random.Generator) -> ReportingPolicy:
    """Make a new policy.

    Args:
        name: Name of a built-in policy, or `my_file.py:MyPolicy`, relative to the current folder, or
            `package.module:MyPolicy`.
        rng: Generator for policies that draw.

    Raises:
        UserCodeError: If it is not built in and cannot be loaded or made.
    """
    match name:
        case "seek":
            return CollisionGuard(Seek())
        case "active":
            return CollisionGuard(Active())
        case "patrol":
            return CollisionGuard(Patrol())
        case "random":
            return Random(rng)
        case "oracle":
            return Oracle()
        case _:
            return OwnPolicy(load_maker(name), rng)
