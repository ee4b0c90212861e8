"""The contract of a policy, checks of its actions, and helpers to read an observation."""

import operator
import textwrap
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from dirmusic import Finding
from dirmusic.arrays import FloatArray
from pdpatrol.envs.observation import Observation
from pdpatrol.envs.user_code import UserCodeError, calling, place_of
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.record.events import Phase

Action = NDArray[np.float32]

ACTION = "an action of 2 finite numbers in [-1, 1], or None to end the mission"


class Policy(Protocol):
    """A policy drives the robot through one mission; `pdpatrol run --policy my_file.py:MyPolicy` runs your own.

    **Construction.** `MyPolicy(rng)`, once per mission. `rng` is the policy's own `numpy.random.Generator`: use no
    other random numbers, so that the same seed gives the same mission. A function of `rng` that returns a policy works
    as well.

    **Call.** `policy(observation, findings, site_map) -> action`, once per control step of 0.1 s:

    - `observation`: the sensor readings, see `pdpatrol.envs.patrol_env.PatrolEnv`; `believed_pose` and `time_of` read
      pose and time. In missions, `pose` and `bearing` are corrected by the estimated frame of the localisation.
    - `findings`: the Locator's findings so far, each a `dirmusic.Finding`; findings with `state == "candidate"`
      need more bearings.
    - `site_map`: the operator's plan (`pdpatrol.missions.driving.site_map.SiteMap`): yard, route, task, free ground,
      shortest paths. `pdpatrol.missions.driving.path_follower.PathFollower` drives along them.
    - `action`: two finite numbers in [-1, 1], shape (2,): forward speed and counter-clockwise yaw rate, as fractions of
      the robot's limits; or None to end the mission.

    **Optional attributes.** `phase`, one or two words for the current activity, or a
    `pdpatrol.missions.record.events.Phase` (default: the name of its class), and `unreachable`, the numbers of the
    waypoints that it has given up, from 1 (default: none). Both are logged.

    **Battery.** When the charge only just lasts for the drive to the dock, the runner takes the robot there, charges it
    and then calls the policy again. If the policy has a method `resume()`, it is called once before: plan paths anew
    from the dock, and forget deadlines. A policy in the phase `return to dock` is not interrupted.

    **Truth.** Only a policy that has `reveal(truth)` is given the truth, once before the first call: `info["truth"]` of
    the environment's reset, with `full_info`. Such a policy is a reference for others, and its own results do not
    count. A collision guard does not pass the truth on: put the guard inside the policy, as `oracle` does.

    **Collisions.** The runner does not keep the robot away from obstacles.
    `pdpatrol.missions.policies.collision_guard.CollisionGuard` around a policy stops before anything that the lidar
    measures, adds it to the policy's map, and backs off when the robot is stuck. Name a function that wraps your
    policy, with `--policy my_file.py:guarded`:

        def guarded(rng):
            return CollisionGuard(MyPolicy(rng))

    **Errors.** An exception or an invalid action ends the mission; log, report and recording are still written. Import
    a module from the same folder with `from . import my_module`.
    """

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """Return the next action, or None to end the mission."""
        ...


class ReportingPolicy(Policy, Protocol):
    """A policy that reports its phase and the waypoints that it has given up, as all built-in ones do."""

    phase: Phase
    unreachable: tuple[int, ...] = ()

    def resume(self) -> None:
        """Prepare to go on from the dock after the robot was taken there to charge."""


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
        raise UserCodeError(f"{place_of(policy)}: returned {textwrap.shorten(repr(action), 80)}; expected {ACTION}")
    return values.astype(np.float32)


def status_of(policy: object) -> tuple[Phase, tuple[int, ...]]:
    """Return phase and unreachable waypoints of any policy, with defaults for attributes that it does not have.

    Raises:
        UserCodeError: If they have the wrong type.
    """
    phase, unreachable = getattr(policy, "phase", type(policy).__name__), getattr(policy, "unreachable", ())
    with calling(policy, "a `phase` of a word or two, and numbers of waypoints in `unreachable`"):
        if not isinstance(phase, str | Phase):
            raise TypeError(f"its `phase` is {phase!r:.80}")
        return phase if isinstance(phase, Phase) else Phase(phase), tuple(map(operator.index, unreachable))


def resume(policy: object) -> None:
    """Call `resume()` of any policy that has it.

    Raises:
        UserCodeError: If it raises an exception.
    """
    method = getattr(policy, "resume", None)
    if method is not None:
        with calling(policy, "resume()"):
            method()


def believed_pose(observation: Observation) -> FloatArray:
    """Return x and y in metres and yaw in radians, world frame, shape (3,)."""
    x, y, cos, sin = observation["pose"].astype(np.float64)
    return np.array([x, y, np.arctan2(sin, cos)])


def time_of(observation: Observation, site_map: SiteMap) -> float:
    """Return the time since the mission began, seconds, rounded like a remaining time in single precision.

    Policies act on time differences such as 0.5 s, so another rounding would shift their schedule by a step and change
    the mission. This one keeps missions comparable with stored ones.
    """
    limit_s = site_map.task.time_limit_s
    return limit_s - float(np.float32(limit_s - round(float(observation["time"][0]), 3)))
