"""Tracker: pulses to the Locator, the same for a mission and for data from the field."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic import ArrayModel, BearingEstimator, Finding, Locator, PulseBatch
from dirmusic.locating.plane_wave import MethodDeviation, is_credible
from dirmusic.locating.protocol import LocatorProtocol
from dirmusic.locating.rules import CredibilityRules
from dirmusic.locating.yard_likelihood import YardLikelihood
from pdpatrol.envs.scenario.array import ArrayCalibration, CalibratedArray

FloatArray = NDArray[np.float64]


LIKELIHOOD_S, LIKELIHOOD_SHARE = 8.0, 0.01
"""Time between two looks at the likelihood over the yard (assumed): the robot has got elsewhere by then. No less than
this share of the time so far, or a survey of days would be looked at as often as it has places."""


class Tracked(NamedTuple):
    """The pulses of one step, and the findings with them.

    Attributes:
        pulses: All pulses of the step, n rows.
        is_credible: Which of them the Locator was given, shape (n,).
        findings: All findings so far.
        log_likelihood: Over the yard, as of `YardLikelihood`, where it was looked at in this step.
    """

    pulses: PulseBatch
    is_credible: NDArray[np.bool_]
    findings: tuple[Finding, ...]
    log_likelihood: FloatArray | None = None


class Tracker:
    """Judges pulses, once, and gives the credible ones to a Locator; nobody else calls the Locator's methods.

    Args:
        locator: Makes findings of pulses.
        array: Data sheet and spread of the array.
        estimator: Took the bearings of the pulses.
        rules: When a pulse is credible.
        likelihood: Over the yard, of the same pulses.
    """

    def __init__(
        self,
        locator: LocatorProtocol,
        array: ArrayModel,
        estimator: BearingEstimator,
        rules: CredibilityRules,
        likelihood: YardLikelihood,
    ) -> None:
        self._locator = locator
        self._array = array
        self._method_deviation = MethodDeviation(estimator, array)
        self._rules = rules
        self._n_tracked = 0
        self._likelihood = likelihood
        self._began_s: float | None = None
        self._next_look_s = -np.inf
        self._unseen: list[tuple[PulseBatch, FloatArray]] = []

    @property
    def contradicts_calibration(self) -> bool:
        """Whether the pulses have shown that the errors known of the array before are those of another one."""
        return isinstance(self._locator, Locator) and self._locator.contradicts_errors

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All findings so far."""
        return self._locator.findings

    def track(self, time_s: float, pose: FloatArray, pulses: PulseBatch) -> Tracked:
        """Locate with the pulses of one step.

        Args:
            time_s: Of the step.
            pose: Believed x m, y m, yaw rad, world frame, shape (3,).
            pulses: With their directions.
        """
        credible = np.empty(0, dtype=np.bool_)
        if pulses.n_pulses:
            credible = is_credible(pulses, self._array, self._method_deviation.of(pulses), self._rules)
        given = pulses.take(credible)
        findings = self._locator.update(time_s, pose, given)
        self._n_tracked += given.n_pulses
        if given.n_pulses:
            self._unseen.append((given.without_bands(), np.tile(pose, (given.n_pulses, 1))))
        self._began_s = time_s if self._began_s is None else self._began_s
        is_due = bool(self._unseen) and time_s >= self._next_look_s
        if is_due:
            self._next_look_s = time_s + max(LIKELIHOOD_S, LIKELIHOOD_SHARE * (time_s - self._began_s))
        return Tracked(pulses, credible, findings, self.log_likelihood() if is_due else None)

    def log_likelihood(self) -> FloatArray:
        """Over the yard, by all pulses so far; see `YardLikelihood`."""
        if self._unseen:
            pulses, poses = zip(*self._unseen, strict=True)
            self._likelihood.add(PulseBatch.join(pulses), np.concatenate(poses))
            self._unseen = []
        return self._likelihood.log_likelihood

    def refit(self, time_s: float) -> tuple[Finding, ...]:
        """Fit all pulses once more, when none is left to come."""
        return self._locator.refit(time_s)

    def association(self) -> NDArray[np.intp]:
        """Finding of every credible pulse that was tracked; see `LocatorProtocol.association`."""
        return self._locator.association()[: self._n_tracked]

    def calibration(
        self, mission: str, serial_number: int | None, before: ArrayCalibration | None
    ) -> ArrayCalibration | None:
        """What the Locator has learned of the array; None if nothing, or if it is one of the user's own.

        Args:
            mission: Its name.
            serial_number: Of the array.
            before: The calibration that the mission took up.
        """
        learned = self._locator.learned() if isinstance(self._locator, Locator) else None
        if learned is None:
            return None
        made_use_of = None if self.contradicts_calibration else before
        return ArrayCalibration.after(mission, learned, CalibratedArray.of(self._array, serial_number), made_use_of)
