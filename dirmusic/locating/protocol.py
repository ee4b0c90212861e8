"""The seam for locating: what every Locator promises."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.model import ArrayModel
from dirmusic.locating.association.sight_lines import Sight
from dirmusic.locating.finding import Finding
from dirmusic.locating.fitting.joint_fix import PoseError
from dirmusic.locating.rules import LocatingRules
from dirmusic.pulses.batch import PulseBatch

FloatArray = NDArray[np.float64]


class LocatorProtocol(Protocol):
    """Turns pulses with bearings into findings, from pose to pose.

    A Locator knows the array's data sheet, how wrong the poses may be, and the map; never the truth. It is called by
    one tracker: `update` at every control step, `refit` when no pulse is left to come, `association` at the end. The
    policy drives by the findings, and by those in the state `candidate` above all.
    """

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All findings so far, in the order of their ids; empty before the first pulse.

        A finding keeps its id as long as it lives, and no id is given twice. The log takes the same tuple, by identity,
        for no change, so that a new one is due only after a refit.
        """
        ...

    def update(self, time_s: float, pose: FloatArray, pulses: PulseBatch) -> tuple[Finding, ...]:
        """Take in what was detected from one pose.

        Args:
            time_s: Time since the start; never falls from call to call.
            pose: Believed x m, y m, yaw rad, world frame, shape (3,).
            pulses: Credible pulses with their directions, n_pulses rows, n_pulses >= 0.

        Returns:
            The findings.
        """
        ...

    def refit(self, time_s: float) -> tuple[Finding, ...]:
        """Bring the findings up to date with all pulses so far; returns them."""
        ...

    def association(self) -> NDArray[np.intp]:
        """Which finding each pulse belongs to, by the findings as they stand.

        Returns:
            Id of a finding, or a code of `NoOwner`, for each pulse that `update` was given, in that order; shape
            (n_pulses_so_far,). The phases of a finding's pulses tell what kind of discharge it is.
        """
        ...


class MakesLocator(Protocol):
    """The class of a Locator, or a function that makes one."""

    def __call__(
        self,
        array: ArrayModel,
        pose_error: PoseError,
        *,
        fence_m: tuple[float, float] | None,
        rules: LocatingRules,
        sight: Sight | None,
    ) -> LocatorProtocol:
        """A Locator for one mission.

        Args:
            array: The array's data sheet and spread.
            pose_error: How wrong the poses given to `update` may be.
            fence_m: Length of the yard along x and y, origin at the corner; None where there is no fence.
            rules: What the scenario sets, and defaults for the rest; a Locator uses what it has a use for.
            sight: What the map of the yard obstructs; None where there is no map.
        """
        ...
