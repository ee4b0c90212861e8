"""Policies from user code: found by name, called, and their results checked."""

from __future__ import annotations

import copy
import operator
import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dirmusic import Finding
from pdpatrol.envs.observation import Observation
from pdpatrol.envs.user_code import UserCodeError, calling, load_object, place_of
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.policies.protocol import Action, SeesTruth
from pdpatrol.missions.record.events import Phase

BUILT_IN = ("seek", "active", "patrol", "random", "oracle")

MAKER = "a class or function that makes a policy of a random generator: MyPolicy(rng)"
ACTION = "an action of 2 finite numbers in [-1, 1], or None to end the mission"


def load_maker(name: str) -> Callable[[np.random.Generator], Any]:
    """Load the class or function that makes a user's policy.

    Args:
        name: `my_file.py:MyPolicy`, relative to the current folder, or `package.module:MyPolicy`.

    Raises:
        UserCodeError: If it does not exist, or loading it raises an exception.
    """
    if ":" not in name:
        known = ", ".join(BUILT_IN)
        raise UserCodeError(f"{name}: no such policy; expected {known}, or my_file.py:MyPolicy for your own")
    maker = load_object(name, Path(), MAKER)
    if not callable(maker):
        raise UserCodeError(f"{name}: is of type {type(maker).__name__}; expected {MAKER}")
    return maker


class OwnPolicy:
    """A user's policy that reports on itself like the built-in ones.

    Args:
        maker: Class or function that makes the policy.
        rng: The policy's own generator.

    Raises:
        UserCodeError: If the policy cannot be made; by a call, if it raises an exception or returns no action.
    """

    def __init__(self, maker: Callable[[np.random.Generator], Any], rng: np.random.Generator) -> None:
        self._maker = maker
        with calling(maker, MAKER):
            self._policy = maker(rng)
            if not callable(self._policy):
                expected = "a policy: policy(observation, findings, site_map) -> action"
                made = type(self._policy).__name__
                raise UserCodeError(f"{place_of(maker)}: makes an object of type {made}; expected {expected}")
            self.phase, self.unreachable = status_of(self._policy)

    def reveal(self, truth: dict[str, Any]) -> None:
        """Pass the truth on to a policy that accepts it."""
        if isinstance(self._policy, SeesTruth):
            with calling(self._maker, "reveal(truth)"):
                self._policy.reveal(copy.deepcopy(truth))

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """Return the policy's action, checked."""
        with calling(self._maker, ACTION):
            action = checked_action(self._policy(observation, findings, site_map), self._policy)
            self.phase, self.unreachable = status_of(self._policy)
        return action


def status_of(policy: object) -> tuple[Phase, tuple[int, ...]]:
    """Return phase and unreachable waypoints of any policy, with defaults for attributes that it does not have.

    Raises:
        UserCodeError: If an attribute is of a wrong type.
    """
    name = getattr(policy, "__name__", type(policy).__name__)
    phase, unreachable = getattr(policy, "phase", name), getattr(policy, "unreachable", ())
    if not isinstance(phase, (str, Phase)):
        raise UserCodeError(f"{place_of(policy)}: its `phase` is {_short(phase)}; expected a word or two")
    try:
        numbers = tuple(operator.index(number) for number in unreachable)
    except TypeError:
        raise UserCodeError(
            f"{place_of(policy)}: its `unreachable` is {_short(unreachable)}; expected numbers of waypoints"
        ) from None
    return phase if isinstance(phase, Phase) else Phase(phase), numbers


def checked_action(action: object, policy: object) -> Action | None:
    """Return a copy of the action that a policy returned, shape (2,), or None.

    Raises:
        UserCodeError: If it is neither two finite numbers in [-1, 1] nor None.
    """
    if action is None:
        return None
    with calling(policy, ACTION):
        values = np.array(action)
    if values.shape != (2,) or values.dtype.kind not in "iuf" or not (np.abs(values) <= 1.0).all():
        raise UserCodeError(f"{place_of(policy)}: returned {_short(action)}; expected {ACTION}")
    return values.astype(np.float32)


def _short(value: object) -> str:
    return textwrap.shorten(repr(value), 80)
