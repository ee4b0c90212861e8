"""What was heard and found, step by step, into a MissionLog: the same for a mission and for data from the field."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dirmusic import Bearings, Finding, Locator
from dirmusic.angles import wrap
from missions.record.mission_log import MissionLog

FloatArray = NDArray[np.float64]


UNTRUSTED = 1e6
"""Variance of a channel that is left out, over the energy of the pulse: it weighs nothing."""


class Logbook:
    """Keeps the log of pulses, bearings, findings and events, and hands the pulses to the Locator.

    Args:
        log: Where to write.
        locator: Who makes findings of bearings.
    """

    def __init__(self, log: MissionLog, locator: Locator) -> None:
        self.log = log
        self.locator = locator
        self._logged: tuple[Finding, ...] = ()
        self._has_clipped = False

    def listen(
        self,
        time_s: float,
        pose: FloatArray,
        strengths_v: FloatArray,
        variance_v2: FloatArray,
        bearings: Bearings,
        mains_phase_rad: FloatArray,
        is_clipped: NDArray[np.bool_],
        is_good: NDArray[np.bool_],
    ) -> None:
        """Log and locate the pulses of the last step.

        Args:
            time_s: Of the step.
            pose: Believed, shape (3,).
            strengths_v: Shape (n_pulses, n_elements).
            variance_v2: Of those, same shape.
            bearings: One per pulse.
            mains_phase_rad: Shape (n_pulses,), NaN where it is not known.
            is_clipped: Which pulses were louder than the converter can tell, shape (n_pulses,): they are logged, and
                left out of locating.
            is_good: Which channels can be trusted, shape (n_elements,): the others are logged, and left out too.
        """
        step = self.log.n_rows("step") - 1
        credible = self.locator.is_credible(bearings) & ~is_clipped
        if is_clipped.any() and not self._has_clipped:
            self._has_clipped = True
            self.event("clipped", "a pulse beyond full scale: such pulses are left out of locating")
        for i in range(credible.size):
            pulse = self.log.append(
                "pulse",
                step=step,
                strengths_v=strengths_v[i],
                mains_phase_rad=mains_phase_rad[i],
                is_clipped=is_clipped[i],
                is_credible=credible[i],
            )
            if credible[i]:
                self.log.append(
                    "bearing",
                    pulse=pulse,
                    azimuth_rad=bearings.azimuth_rad[i],
                    bearing_rad=wrap(bearings.azimuth_rad[i] + pose[2]),
                    std_rad=bearings.std_rad[i],
                )
        whole = ~is_clipped
        variance_v2 = variance_v2 + np.where(
            is_good, 0.0, UNTRUSTED * np.square(strengths_v).sum(axis=-1)[:, np.newaxis]
        )
        heard = (bearings.take(whole), (strengths_v * is_good)[whole], variance_v2[whole])
        self._log_findings(step, self.locator.update(time_s, pose, *heard))

    def refit(self, time_s: float) -> None:
        """Fit all that was heard once more, when nothing is left to come."""
        self._log_findings(self.log.n_rows("step") - 1, self.locator.refit(time_s))

    def event(self, kind: str, text: str) -> None:
        """Log something that happened in the last step."""
        self.log.append("event", step=max(self.log.n_rows("step") - 1, 0), kind=kind, text=text)

    def _log_findings(self, step: int, findings: Sequence[Finding]) -> None:
        if findings is self._logged:
            return
        before = {finding.id: finding.state for finding in self._logged}
        for finding in findings:
            self._log_finding(step, finding, finding.state)
            x, y = finding.position_m
            if before.pop(finding.id, None) != finding.state:
                told = {
                    "candidate": f"candidate {finding.id} towards ({x:.1f}, {y:.1f}) m",
                    "confirmed": f"finding {finding.id} at ({x:.2f}, {y:.2f}) m, 95 % in {finding.semi_major_m:.2f} m",
                    "echo": f"candidate {finding.id} is an echo: nothing comes from near ({x:.1f}, {y:.1f}) m",
                    "outside": f"candidate {finding.id} lies beyond the fence, near ({x:.0f}, {y:.0f}) m",
                }[finding.state]
                self.event(finding.state, told)
        for gone in (finding for finding in self._logged if finding.id in before):
            self._log_finding(step, gone, "dropped")
            self.event("dropped", f"candidate {gone.id} was no source of its own")
        self._logged = tuple(findings)

    def _log_finding(self, step: int, finding: Finding, state: str) -> None:
        self.log.append(
            "finding",
            step=step,
            id=finding.id,
            position_m=finding.position_m,
            covariance_m2=finding.covariance_m2,
            state=state,
            n_bearings=finding.n_bearings,
            first_heard_s=finding.first_heard_s,
            opening_rad=finding.opening_rad,
        )
