"""A Locator from user code, whose calls and results are checked."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dirmusic import ArrayModel, Finding, PoseError, PulseBatch
from dirmusic.locating.association import Unassociated
from dirmusic.locating.protocol import LineOfSight
from dirmusic.locating.rules import LocatingRules
from pdpatrol.envs.user_code import UserCodeError, calling, load_object, place_of

LOCATOR = "a Locator: MyLocator(array, pose_error, fence_m=, rules=, sight=) with update, refit and association"
FINDINGS = "a tuple of dirmusic.Finding, with ids from 1 on that differ"


class OwnLocator:
    """A user's Locator, `my_file.py:MyLocator` or `package.module:MyLocator`; see `LocatorProtocol`.

    Args:
        name: Name of the class, or of a function that returns a Locator.
        array: Data sheet and spread of the array.
        pose_error: Error of the poses given to `update`.
        fence_m: Length of the yard along x and y, origin at the corner; None without a fence.
        rules: Rules of locating.
        sight: Line of sight according to the map; None without a map.

    Raises:
        UserCodeError: If it cannot be loaded or made; by any call, if it raises an exception or breaks the contract.
    """

    def __init__(
        self,
        name: str,
        array: ArrayModel,
        pose_error: PoseError,
        *,
        fence_m: tuple[float, float] | None,
        rules: LocatingRules,
        sight: LineOfSight | None,
    ) -> None:
        definition: Any = load_object(name, ".", LOCATOR)
        with calling(definition, LOCATOR):
            self._locator: Any = definition(array, pose_error, fence_m=fence_m, rules=rules, sight=sight)
        missing = [method for method in ("update", "refit", "association") if not hasattr(self._locator, method)]
        if missing:
            raise UserCodeError(f"{place_of(definition)}: has no {', '.join(missing)}; expected {LOCATOR}")
        self.findings: tuple[Finding, ...] = ()
        self._n_pulses = 0

    def update(self, time_s: float, pose: NDArray[np.float64], pulses: PulseBatch) -> tuple[Finding, ...]:
        """Add pulses; see `LocatorProtocol.update`."""
        self._n_pulses += pulses.n_pulses
        return self._findings("update", time_s, pose.copy(), pulses)

    def refit(self, time_s: float) -> tuple[Finding, ...]:
        """Fit all pulses again; see `LocatorProtocol.refit`."""
        return self._findings("refit", time_s)

    def association(self) -> NDArray[np.intp]:
        """Return the finding of each pulse; see `LocatorProtocol.association`."""
        known = [*(finding.id for finding in self.findings), *Unassociated]
        expected = f"an integer for each of {self._n_pulses} pulses, of {', '.join(map(str, known))}"
        with calling(self._locator, expected):
            association = np.asarray(self._locator.association())
        is_integer = association.shape == (self._n_pulses,) and association.dtype.kind in "iu"
        if not is_integer or not np.isin(association, known).all():
            raise UserCodeError(
                f"{place_of(self._locator)}: association gave {association.dtype} of shape {association.shape}, with "
                f"{np.setdiff1d(association, known)[:3]}; expected {expected}"
            )
        return association

    def _findings(self, method: str, *arguments: object) -> tuple[Finding, ...]:
        """Call a method and check its result."""
        with calling(self._locator, FINDINGS):
            findings = getattr(self._locator, method)(*arguments)
        is_tuple = isinstance(findings, tuple) and all(isinstance(finding, Finding) for finding in findings)
        if not is_tuple or len({finding.id for finding in findings}) < len(findings):
            raise UserCodeError(f"{place_of(self._locator)}: gave {findings!r:.80}; expected {FINDINGS}")
        self.findings = findings
        return findings
