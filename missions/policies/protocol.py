"""Policy: the contract of what decides where the robot drives, and how a policy reads an observation."""

from __future__ import annotations

import operator
import textwrap
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from dirmusic import Finding
from pdpatrol.envs.patrol_env import Observation
from pdpatrol.envs.user_code import UserCodeError, calling, place_of
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.record.events import Phase

FloatArray = NDArray[np.float64]
Action = NDArray[np.float32]

ACTION = "an action of 2 finite numbers in [-1, 1], or None to end the mission"


class Policy(Protocol):
    """What drives the robot through one mission; `pdpatrol run --policy my_file.py:MyPolicy` runs your own.

    **Construction.** `MyPolicy(rng)`, once for each mission. `rng` is the policy's own `numpy.random.Generator`: draw
    from nothing else, and the same seed gives the same mission. A function of `rng` that returns a policy does as well.

    **Call.** `policy(observation, findings, site_map) -> action`, once for each control step of 0.1 s:

    - `observation`: what the robot senses, as the docstring of `pdpatrol.envs.patrol_env.PatrolEnv` lists it;
      `believed_pose`
      and `time_of` read pose and time.
    - `findings`: what the Locator has located so far, each a `dirmusic.Finding`; only `state == "candidate"` wants
      more bearings.
    - `site_map`: the operator's plan (`pdpatrol.missions.driving.site_map.SiteMap`): yard, route, task, free ground,
      shortest
      paths. `pdpatrol.missions.driving.path_follower.PathFollower` drives along them.
    - `action`: two finite numbers in [-1, 1], shape (2,): forward speed and counter-clockwise yaw rate, as a share of
      the robot's limits; or None to end the mission.

    **Optional attributes.** `phase`, a word or two on what it is doing or a `pdpatrol.missions.record.events.Phase`
    (default: the name of its class), and `unreachable`, numbers of the waypoints that it has given up, from 1 (default:
    none). Both are logged.

    **Truth.** Only a policy that has `reveal(truth)` is given the truth, once before the first call; see `SeesTruth`.
    A collision guard does not pass it on: put the guard inside, as `oracle` does.

    **Collisions.** The runner does not keep the robot from obstacles.
    `pdpatrol.missions.driving.collision_guard.CollisionGuard`
    around a policy stops before what the lidar sees, puts it on the policy's map and backs off when stuck. Name a
    function that puts it there, with `--policy my_file.py:guarded`:

        def guarded(rng):
            return CollisionGuard(MyPolicy(rng))

    **Errors.** An exception, or a result that is no action, ends the mission with log, report and recording whole. A
    module of the same folder is imported as `from . import my_module`.
    """

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """The next action, or None to end the mission."""
        ...


class ReportingPolicy(Policy, Protocol):
    """A policy that says what it is doing, as all built-in ones do."""

    phase: Phase
    unreachable: tuple[int, ...]


@runtime_checkable
class SeesTruth(Protocol):
    """Mark of a policy that is given the truth: a yardstick for others, no result of its own."""

    def reveal(self, truth: dict[str, Any]) -> None:
        """Take in the truth of the mission: `info["truth"]` of the environment's reset, with `full_info`."""
        ...


class PolicyStatus(NamedTuple):
    """What a policy reports besides its action.

    Attributes:
        phase: What it is doing.
        unreachable: Waypoints that it has given up, numbered from 1: without a way to them, or too slow to reach.
    """

    phase: Phase
    unreachable: tuple[int, ...]


def status_of(policy: object) -> PolicyStatus:
    """The status of any policy, with defaults for what it does not report.

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
    return PolicyStatus(phase if isinstance(phase, Phase) else Phase(phase), numbers)


def checked_action(action: object, policy: object) -> Action | None:
    """What a policy returned, as an action of its own memory, shape (2,), or None.

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


def believed_pose(observation: Observation) -> FloatArray:
    """X and y in metres and yaw in radians, world frame, shape (3,)."""
    x, y, cos, sin = observation["pose"].astype(np.float64)
    return np.array([x, y, np.arctan2(sin, cos)])


def time_of(observation: Observation) -> float:
    """Seconds since the mission began."""
    return float(observation["time"][0])
