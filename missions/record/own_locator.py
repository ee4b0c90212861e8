"""A Locator that the user named, called so that each of its faults is one line."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dirmusic import ArrayModel, Finding, PoseError, PulseBatch
from dirmusic.locating.association.pulse_record import InSight
from dirmusic.locating.rules import LocatingRules
from envs.foreign_code import ForeignCodeError, calling, load_object, place_of

FloatArray = NDArray[np.float64]

MAKER = "a class or function that makes a Locator: MyLocator(array, pose_error, fence_m=, rules=, in_sight=)"
FINDINGS = "a tuple of dirmusic.Finding with finite positions"


class OwnLocator:
    """Loads, makes and calls a Locator of the user's; see `dirmusic.locating.protocol.LocatorProtocol`.

    Args:
        name: `my_file.py:MyLocator`, an absolute path or one from the current folder, or `package.module:MyLocator`.
        array: As of `dirmusic.locating.protocol.MakesLocator`, and so the others.
        pose_error: How wrong poses may be.
        fence_m: Length of the yard along x and y.
        rules: What the scenario sets.
        in_sight: What the map obstructs.

    Raises:
        ForeignCodeError: If it cannot be loaded or made; by any call, if it raises or breaks its contract.
    """

    def __init__(
        self,
        name: str,
        array: ArrayModel,
        pose_error: PoseError,
        *,
        fence_m: tuple[float, float] | None,
        rules: LocatingRules,
        in_sight: InSight | None,
    ) -> None:
        maker: Any = load_object(name, ".", MAKER)
        with calling(maker, MAKER):
            self._locator: Any = maker(array, pose_error, fence_m=fence_m, rules=rules, in_sight=in_sight)
        self._findings: tuple[Finding, ...] = self._checked(lambda: self._locator.findings)
        self._n_pulses = 0

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All findings so far."""
        return self._findings

    def update(self, time_s: float, pose: FloatArray, pulses: PulseBatch) -> tuple[Finding, ...]:
        """Take in what was detected from one pose."""
        self._n_pulses += pulses.n_pulses
        self._findings = self._checked(lambda: self._locator.update(time_s, pose, pulses))
        return self._findings

    def refit(self, time_s: float) -> tuple[Finding, ...]:
        """Bring the findings up to date."""
        self._findings = self._checked(lambda: self._locator.refit(time_s))
        return self._findings

    def association(self) -> NDArray[np.intp]:
        """Which finding each pulse belongs to."""
        expected = f"a whole number for each of {self._n_pulses} pulses"
        with calling(self._locator, expected):
            association = np.asarray(self._locator.association())
        if association.shape != (self._n_pulses,) or association.dtype.kind not in "iu":
            raise ForeignCodeError(
                f"{place_of(self._locator)}: `association` gave {association.dtype} of shape {association.shape}; "
                f"expected {expected}"
            )
        return association.astype(np.intp)

    def _checked(self, call: Any) -> tuple[Finding, ...]:  # noqa: ANN401 - a call without arguments
        with calling(self._locator, FINDINGS):
            findings = call()
        is_right = isinstance(findings, tuple) and all(
            isinstance(finding, Finding) and np.isfinite(finding.position_m).all() for finding in findings
        )
        if not is_right:
            raise ForeignCodeError(f"{place_of(self._locator)}: gave {str(findings)[:80]!r}; expected {FINDINGS}")
        return findings
