"""OwnPolicy: a policy from foreign code, each call and each result of which is checked."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from dirmusic import Finding
from pdpatrol.envs.patrol_env import Observation
from pdpatrol.envs.user_code import UserCodeError, calling, place_of
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.policies.names import MAKER
from pdpatrol.missions.policies.protocol import ACTION, Action, SeesTruth, checked_action, status_of

POLICY = "a policy: policy(observation, findings, site_map) -> action"


class OwnPolicy:
    """Reports on a policy of one's own as the built-in ones report on themselves.

    Args:
        maker: Class or function that makes the policy.
        rng: The policy's own.

    Raises:
        UserCodeError: If the policy cannot be made; by a call, if it raises an exception or returns no action.
    """

    def __init__(self, maker: Callable[[np.random.Generator], Any], rng: np.random.Generator) -> None:
        self._maker = maker
        with calling(maker, MAKER):
            self._policy = maker(rng)
            if not callable(self._policy):
                made = type(self._policy).__name__
                raise UserCodeError(f"{place_of(maker)}: makes an object of type {made}; expected {POLICY}")
            self.phase, self.unreachable = status_of(self._policy)

    def reveal(self, truth: dict[str, Any]) -> None:
        """Pass the truth on to a policy that wants it."""
        if isinstance(self._policy, SeesTruth):
            with calling(self._maker, "reveal(truth)"):
                self._policy.reveal(copy.deepcopy(truth))

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """The action of the policy, checked."""
        with calling(self._maker, ACTION):
            action = checked_action(self._policy(observation, findings, site_map), self._policy)
            self.phase, self.unreachable = status_of(self._policy)
        return action
