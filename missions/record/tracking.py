"""What was heard and found, step by step, into a MissionLog: the same for a mission and for data from the field."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dirmusic import Finding, Locator, PulseBatch
from dirmusic.angles import wrap
from dirmusic.locating.credibility import is_credible
from missions.record.mission_log import MissionLog

FloatArray = NDArray[np.float64]


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

    def track(self, time_s: float, pose: FloatArray, pulses: PulseBatch) -> None:
        """Log and locate the pulses of the last step.

        Args:
            time_s: Of the step.
            pose: Believed, shape (3,).
            pulses: With their directions. Those that are not credible, and those louder than the converter can tell,
                are logged and left out of locating.
        """
        step, is_overdriven = self.log.n_rows("step") - 1, pulses.is_overdriven
        credible = is_credible(pulses, self.locator.array, self.locator.rules.credibility)
        if is_overdriven.any() and not self._has_clipped:
            self._has_clipped = True
            self.event("clipped", "a pulse beyond full scale: such pulses are left out of locating")
        for i in range(pulses.n_pulses):
            pulse = self.log.append(
                "pulse",
                step=step,
                strengths_v=pulses.strengths_v[i],
                mains_phase_rad=pulses.mains_phase_rad[i],
                is_clipped=is_overdriven[i],
                is_credible=credible[i],
            )
            if credible[i]:
                self.log.append(
                    "bearing",
                    pulse=pulse,
                    azimuth_rad=pulses.azimuth_rad[i],
                    bearing_rad=wrap(pulses.azimuth_rad[i] + pose[2]),
                    std_rad=pulses.std_rad[i],
                )
        self._log_findings(step, self.locator.update(time_s, pose, pulses.take(credible)))

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
            first_detected_s=finding.first_detected_s,
            aperture_rad=finding.aperture_rad,
        )
