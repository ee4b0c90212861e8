"""OwnPolicy: a policy from foreign code, each call and each result of which is checked."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dirmusic import Finding
from envs.foreign_code import ForeignCodeError, calling, load_object, place_of
from envs.patrol_env import Observation
from missions.driving.site_map import SiteMap
from missions.policies.protocol import ACTION, Action, SeesTruth, checked_action, status_of

MAKER = "a class or function that makes a policy of a random generator: MyPolicy(rng)"
POLICY = "a policy: policy(observation, findings, site_map) -> action"


class OwnPolicy:
    """A policy by `my_file.py:MyPolicy` or `package.module:MyPolicy`, reported on as the built-in ones are.

    Args:
        name: Of the class, or of a function that returns a policy.
        rng: The policy's own.
        folder: Folder that a relative `my_file.py` starts from.

    Raises:
        ForeignCodeError: If it cannot be loaded or made; by any call, if it raises or returns no action.
    """

    def __init__(self, name: str, rng: np.random.Generator, folder: Path) -> None:
        self._maker = load_object(name, folder, MAKER)
        if not callable(self._maker):
            raise ForeignCodeError(f"{name}: is of type {type(self._maker).__name__}; expected {MAKER}")
        with calling(self._maker, MAKER):
            self._policy: Any = self._maker(rng)
            if not callable(self._policy):
                made = type(self._policy).__name__
                raise ForeignCodeError(f"{place_of(self._maker)}: makes an object of type {made}; expected {POLICY}")
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
