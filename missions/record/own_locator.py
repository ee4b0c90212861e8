"""OwnLocator: a Locator from foreign code, each call and each result of which is checked."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dirmusic import ArrayModel, Finding, PoseError, PulseBatch
from dirmusic.locating.association import Unassociated
from dirmusic.locating.protocol import LineOfSight
from dirmusic.locating.rules import LocatingRules
from pdpatrol.envs.user_code import UserCodeError, calling, load_object, place_of

FloatArray = NDArray[np.float64]

LOCATOR = "a Locator: MyLocator(array, pose_error, fence_m=, rules=, sight=) with update, refit and association"
FINDINGS = "a tuple of dirmusic.Finding, with ids from 1 on that differ"


class OwnLocator:
    """A Locator by `my_file.py:MyLocator` or `package.module:MyLocator`; see `LocatorProtocol`.

    Args:
        name: Of the class, or of a function that returns a Locator.
        array: The array's data sheet and spread.
        pose_error: How wrong the poses given to `update` may be.
        fence_m: Length of the yard along x and y, origin at the corner; None where there is no fence.
        rules: What the scenario sets, and defaults for the rest.
        sight: What the map of the yard obstructs; None where there is no map.

    Raises:
        UserCodeError: If it cannot be loaded or made; by any call, if it raises or breaks the contract.
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
        self._findings: tuple[Finding, ...] = ()
        self._n_given = 0

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What `update` or `refit` returned last."""
        return self._findings

    def update(self, time_s: float, pose: FloatArray, pulses: PulseBatch) -> tuple[Finding, ...]:
        """As of `LocatorProtocol`."""
        self._n_given += pulses.n_pulses
        with calling(self._locator, FINDINGS):
            return self._accept(self._locator.update(time_s, pose.copy(), pulses))

    def refit(self, time_s: float) -> tuple[Finding, ...]:
        """As of `LocatorProtocol`."""
        with calling(self._locator, FINDINGS):
            return self._accept(self._locator.refit(time_s))

    def association(self) -> NDArray[np.intp]:
        """As of `LocatorProtocol`."""
        known = [*(finding.id for finding in self._findings), *Unassociated]
        expected = f"an integer for each of {self._n_given} pulses, of {', '.join(map(str, known))}"
        with calling(self._locator, expected):
            association = np.asarray(self._locator.association())
        if association.shape != (self._n_given,) or not np.issubdtype(association.dtype, np.integer):
            came = f"{association.dtype} of shape {association.shape}"
            raise UserCodeError(f"{place_of(self._locator)}: association gave {came}; expected {expected}")
        strange = association[~np.isin(association, known)]
        if strange.size:
            raise UserCodeError(f"{place_of(self._locator)}: association gave {strange[0]}; expected {expected}")
        return association

    def _accept(self, findings: Any) -> tuple[Finding, ...]:  # noqa: ANN401 - whatever foreign code returns
        if not isinstance(findings, tuple) or not all(isinstance(finding, Finding) for finding in findings):
            raise UserCodeError(f"{place_of(self._locator)}: gave {findings!r:.80}; expected {FINDINGS}")
        ids = [finding.id for finding in findings]
        if len(set(ids)) < len(ids):
            raise UserCodeError(f"{place_of(self._locator)}: gave the ids {ids}; expected {FINDINGS}")
        self._findings = findings
        return findings
