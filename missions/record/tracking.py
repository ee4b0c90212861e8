"""Tracker: gives credible pulses to the Locator, in missions and for field data."""

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
"""Shortest time between two likelihoods over the yard, in seconds and as a fraction of the time so far. Assumed; the
robot is elsewhere by then, and a survey of days does not need one for each place."""


class Tracked(NamedTuple):
    """Pulses and findings of one step.

    Attributes:
        pulses: All pulses of the step, n rows.
        is_credible: True for pulses that the Locator was given, shape (n,).
        findings: All findings so far.
        log_likelihood: Likelihood over the yard, see `YardLikelihood`; None if it was not computed in this step.
    """

    pulses: PulseBatch
    is_credible: NDArray[np.bool_]
    findings: tuple[Finding, ...]
    log_likelihood: FloatArray | None = None


class Tracker:
    """Gives the credible pulses, consistent with a single plane wave, to a Locator; the only caller of its methods.

    Args:
        locator: Locator that makes findings of pulses.
        array: Data sheet and spread of the array.
        estimator: Estimator of the bearings.
        rules: Rules for credible pulses.
        likelihood: Likelihood over the yard of the same pulses.
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
        self._next_likelihood_s = -np.inf
        self._pending: list[tuple[PulseBatch, FloatArray]] = []

    @property
    def contradicts_calibration(self) -> bool:
        """True if the pulses contradict the array errors of the calibration."""
        return isinstance(self._locator, Locator) and self._locator.contradicts_errors

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Findings so far."""
        return self._locator.findings

    def track(self, time_s: float, pose: FloatArray, pulses: PulseBatch) -> Tracked:
        """Locate with the pulses of one step.

        Args:
            time_s: Time of the step.
            pose: Estimated x m, y m, yaw rad, world frame, shape (3,).
            pulses: Pulses with their directions.
        """
        credible = np.empty(0, dtype=np.bool_)
        if pulses.n_pulses:
            credible = is_credible(pulses, self._array, self._method_deviation.of(pulses), self._rules)
        accepted = pulses.take(credible)
        findings = self._locator.update(time_s, pose, accepted)
        self._n_tracked += accepted.n_pulses
        if accepted.n_pulses:
            self._pending.append((accepted.without_bands(), np.tile(pose, (accepted.n_pulses, 1))))
        self._began_s = time_s if self._began_s is None else self._began_s
        is_due = bool(self._pending) and time_s >= self._next_likelihood_s
        if is_due:
            self._next_likelihood_s = time_s + max(LIKELIHOOD_S, LIKELIHOOD_SHARE * (time_s - self._began_s))
        return Tracked(pulses, credible, findings, self.log_likelihood() if is_due else None)

    def log_likelihood(self) -> FloatArray:
        """Return the likelihood over the yard by all pulses so far; see `YardLikelihood`."""
        if self._pending:
            pulses, poses = zip(*self._pending, strict=True)
            self._likelihood.add(PulseBatch.join(pulses), np.concatenate(poses))
            self._pending = []
        return self._likelihood.log_likelihood

    def refit(self, time_s: float) -> tuple[Finding, ...]:
        """Fit all pulses again after the last one."""
        return self._locator.refit(time_s)

    def association(self) -> NDArray[np.intp]:
        """Return the finding of every credible pulse; see `LocatorProtocol.association`."""
        return self._locator.association()[: self._n_tracked]

    def calibration(
        self, mission: str, serial_number: int | None, before: ArrayCalibration | None
    ) -> ArrayCalibration | None:
        """Return the calibration of the array by the Locator; None without one, and for a user's Locator.

        Args:
            mission: Name of the mission.
            serial_number: Serial number of the array.
            before: Calibration that the mission started with.
        """
        learned = self._locator.learned() if isinstance(self._locator, Locator) else None
        if learned is None:
            return None
        used = None if self.contradicts_calibration else before
        return ArrayCalibration.after(mission, learned, CalibratedArray.of(self._array, serial_number), used)
