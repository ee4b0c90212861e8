"""Interface of a Locator: its inputs, outputs and contract."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from dirmusic.array.model import ArrayModel
from dirmusic.arrays import FloatArray, IntArray
from dirmusic.locating.finding import Finding
from dirmusic.locating.rules import LocatingRules
from dirmusic.pulses.batch import PulseBatch

LineOfSight = Callable[[FloatArray, FloatArray, float], FloatArray]
"""Function of positions, shape (n, 3), a target, shape (3,), and a depth in metres. It returns the transmission factor
of the direct path from each position to the target, shape (n,), in [0, 1]: the fraction of a wave's amplitude that
known equipment transmits. Equipment within the given depth in front of the target is ignored."""


@dataclass(frozen=True, kw_only=True)
class PoseError:
    """Error of the robot's pose: standard deviations of position and heading, and correlation time."""

    position_m: float
    heading_rad: float
    correlation_s: float


class LocatorProtocol(Protocol):
    """Object that turns pulses with bearings into findings, step by step.

    A Locator knows the array's data sheet, the pose error and the map, but never the truth. One tracker calls it:
    `update` at every control step, `refit` after the last pulse, and `association` at the end. The policy uses the
    findings, mainly those in the state `candidate`, to decide where to drive.
    """

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Current findings, in the order of their ids; empty before the first pulse.

        Ids are at least 1. A finding keeps its id, and an id is never reused. Findings are compared by value, and
        logged when they change.
        """
        ...

    def update(self, time_s: float, pose: FloatArray, pulses: PulseBatch) -> tuple[Finding, ...]:
        """Add the pulses that were detected at one pose.

        Args:
            time_s: Time of the pose, relative to any origin; must not decrease from call to call.
            pose: Estimated x m, y m, yaw rad, world frame, shape (3,).
            pulses: Pulses with their directions, without clipped ones, n_pulses >= 0 rows.

        Returns:
            All current findings.
        """
        ...

    def refit(self, time_s: float) -> tuple[Finding, ...]:
        """Update the findings with all pulses so far and return them."""
        ...

    def association(self) -> IntArray:
        """Associate each pulse with one of the current findings.

        Returns:
            Id of a finding, or 0 for none, for each pulse passed to `update`, in that order; shape (n_pulses_so_far,).
            The mains phases of a finding's pulses are used to classify the discharge.
        """
        ...


class MakesLocator(Protocol):
    """Class of a Locator, or a function that returns a Locator."""

    def __call__(
        self,
        array: ArrayModel,
        pose_error: PoseError,
        *,
        fence_m: tuple[float, float] | None,
        rules: LocatingRules,
        sight: LineOfSight | None,
    ) -> LocatorProtocol:
        """Create a Locator for one mission.

        Args:
            array: The array's data sheet and spread.
            pose_error: Error of the poses given to `update`.
            fence_m: Length of the yard along x and y, with the origin at its corner; None without a fence.
            rules: Rules from the scenario, with defaults for those not set; a Locator may use any of them.
            sight: Transmission along lines of sight according to the map of the yard; None without a map.
        """
        ...
