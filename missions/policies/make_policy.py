"""Policies by name: built-in ones, with the references `random` and `oracle`, and those of users."""

import copy
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from dirmusic import Finding
from pdpatrol.envs.observation import Observation
from pdpatrol.envs.scenario.base import meant
from pdpatrol.envs.user_code import UserCodeError, calling, load_object
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.policies.collision_guard import CollisionGuard
from pdpatrol.missions.policies.patrol import Patrol
from pdpatrol.missions.policies.protocol import (
    ACTION,
    Action,
    ReportingPolicy,
    checked_action,
    resume,
    status_of,
    time_of,
)
from pdpatrol.missions.policies.seek import Active, Seek
from pdpatrol.missions.record.events import Phase


class Random(ReportingPolicy):
    """Policy that drives at random and ignores obstacles, as a lower bound."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.phase = Phase("random")
        self._rng = rng
        self._action = np.zeros(2, dtype=np.float32)
        self._n_steps = 0

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """Draw an action once a second."""
        if self._n_steps % 10 == 0:
            self._action = self._rng.uniform(-1.0, 1.0, 2).astype(np.float32)
        self._n_steps += 1
        return self._action


class Oracle(CollisionGuard):
    """Policy that is given the true positions, views each source from several sides, and docks, as an upper bound."""

    def __init__(self) -> None:
        super().__init__(Seek(route_first=False))
        self._sources_m: list[np.ndarray] = []

    def reveal(self, truth: dict[str, Any]) -> None:
        """Store the true positions of the sources."""
        self._sources_m = [np.asarray(source["position_m"]) for source in truth["sources"]]

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """Act as `Seek`, with the true positions as candidates until a finding is confirmed within 1 m of them."""
        confirmed = [f.position_m for f in findings if f.state == "confirmed"]
        known = [
            Finding(
                id=number,
                state="candidate",
                position_m=position,
                covariance_m2=np.eye(3) * 1e-4,
                existence=1.0,
                n_bearings=0,
                first_detected_s=0.0,
                last_detected_s=time_of(observation, site_map),
                confirmed_s=None,
                aperture_rad=0.0,
                nearest_m=np.inf,
                level_db=np.nan,
            )
            for number, position in enumerate(self._sources_m, start=1)
            if all(np.hypot(*(position - other)[:2]) > 1.0 for other in confirmed)
        ]
        return super().__call__(observation, known, site_map)


BUILT_IN: dict[str, Callable[[np.random.Generator], ReportingPolicy]] = {
    "seek": lambda rng: CollisionGuard(Seek()),
    "active": lambda rng: CollisionGuard(Active()),
    "patrol": lambda rng: CollisionGuard(Patrol()),
    "random": Random,
    "oracle": lambda rng: Oracle(),
}

MAKER = f"{', '.join(BUILT_IN)}, or a class or function that makes a policy of a random generator: MyPolicy(rng)"


class OwnPolicy:
    """Wrapper of a user's policy that reports its phase and unreachable waypoints, as built-in policies do.

    Args:
        maker: Class or function that makes the policy.
        rng: The policy's own generator.

    Raises:
        UserCodeError: If the policy cannot be made, or if a call raises an exception or returns an invalid action.
    """

    def __init__(self, maker: Callable[[np.random.Generator], Any], rng: np.random.Generator) -> None:
        self._maker = maker
        with calling(maker, MAKER):
            self._policy = maker(rng)
            if not callable(self._policy):
                raise TypeError(f"makes a {type(self._policy).__name__}, which cannot be called")
            self.phase, self.unreachable = status_of(self._policy)

    def reveal(self, truth: dict[str, Any]) -> None:
        """Pass the truth on to a policy that accepts it."""
        if hasattr(self._policy, "reveal"):
            with calling(self._maker, "reveal(truth)"):
                self._policy.reveal(copy.deepcopy(truth))

    def resume(self) -> None:
        """Let the policy prepare to go on, if it has `resume`."""
        resume(self._policy)

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """Return the policy's action after checking it."""
        with calling(self._maker, ACTION):
            action = checked_action(self._policy(observation, findings, site_map), self._policy)
            self.phase, self.unreachable = status_of(self._policy)
        return action


def load_maker(name: str) -> Callable[[np.random.Generator], Any]:
    """Return the class or function that makes a policy.

    Args:
        name: Name of a built-in policy, or `my_file.py:MyPolicy`, relative to the current folder, or
            `package.module:MyPolicy`.

    Raises:
        UserCodeError: If it does not exist, or loading it raises an exception.
    """
    if name not in BUILT_IN and ":" not in name and (hint := meant(BUILT_IN, name)):
        raise UserCodeError(f"{name}: no such policy{hint}")
    return BUILT_IN[name] if name in BUILT_IN else load_object(name, MAKER)


def make_policy(name: str, rng: np.random.Generator) -> ReportingPolicy:
    """Make a new policy.

    Args:
        name: See `load_maker`.
        rng: Generator for policies that use random numbers.

    Raises:
        UserCodeError: If it is not built in and cannot be loaded or made.
    """
    return BUILT_IN[name](rng) if name in BUILT_IN else OwnPolicy(load_maker(name), rng)
