"""The interface of a Locator: its inputs and its contract."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.model import ArrayModel
from dirmusic.locating.finding import Finding
from dirmusic.locating.rules import LocatingRules
from dirmusic.pulses.batch import PulseBatch

FloatArray = NDArray[np.float64]

LineOfSight = Callable[[FloatArray, FloatArray, float], FloatArray]
"""Maps places (n, 3), a target (3,) and a depth in metres to the transmission factor of the direct path from each place
to the target, (n,), in [0, 1]: the share of a wave's amplitude that known equipment transmits. Equipment within the
depth before the target is ignored."""


@dataclass(frozen=True, kw_only=True)
class PoseError:
    """Error of the robot's pose: standard deviations of position and heading, and its correlation time."""

    position_m: float
    heading_rad: float
    correlation_s: float


class LocatorProtocol(Protocol):
    """Turns pulses with bearings into findings, from pose to pose.

    A Locator knows the array's data sheet, the pose error and the map, never the truth. It is called by one tracker:
    `update` at every control step, `refit` after the last pulse, `association` at the end. The policy drives by the
    findings, mainly by those in the state `candidate`.
    """

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All current findings, in the order of their ids; empty before the first pulse.

        Ids are at least 1. A finding keeps its id, and no id is used twice. Findings are compared by value, and logged
        when they change.
        """
        ...

    def update(self, time_s: float, pose: FloatArray, pulses: PulseBatch) -> tuple[Finding, ...]:
        """Add the pulses that were detected at one pose.

        Args:
            time_s: Time of the pose, from any origin; must not decrease from call to call.
            pose: Estimated x m, y m, yaw rad, world frame, shape (3,).
            pulses: Credible pulses with their directions, n_pulses rows, n_pulses >= 0.

        Returns:
            The findings.
        """
        ...

    def refit(self, time_s: float) -> tuple[Finding, ...]:
        """Update the findings with all pulses so far and return them."""
        ...

    def association(self) -> NDArray[np.intp]:
        """Associate each pulse with one of the current findings.

        Returns:
            Id of a finding, or a code of `Unassociated`, for each pulse that `update` was given, in that order; shape
            (n_pulses_so_far,). The mains phases of a finding's pulses show the kind of discharge.
        """
        ...


class MakesLocator(Protocol):
    """The class of a Locator, or a function that returns one."""

    def __call__(
        self,
        array: ArrayModel,
        pose_error: PoseError,
        *,
        fence_m: tuple[float, float] | None,
        rules: LocatingRules,
        sight: LineOfSight | None,
    ) -> LocatorProtocol:
        """Make a Locator for one mission.

        Args:
            array: The array's data sheet and spread.
            pose_error: Error of the poses given to `update`.
            fence_m: Length of the yard along x and y, origin at the corner; None without a fence.
            rules: Rules of the scenario, with defaults for the rest; a Locator may use any of them.
            sight: Transmission along lines of sight by the map of the yard; None without a map.
        """
        ...
