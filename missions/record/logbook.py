"""Logbook: writes pulses, bearings, findings and events as rows of a MissionLog."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dirmusic import Finding
from dirmusic.angles import wrap
from dirmusic.locating.finding import State
from pdpatrol.missions.record.events import EventKind
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.tracking import Tracked

FloatArray = NDArray[np.float64]


class Logbook:
    """Writes what happened in the last step of a log, which contains the step itself already.

    Args:
        log: Log to write to.
    """

    def __init__(self, log: MissionLog) -> None:
        self.log = log
        self._logged: tuple[Finding, ...] = ()
        self._has_clipped = self._has_contradicted = False

    def event(self, kind: EventKind, text: str, number: int = 0, subject: str = "") -> None:
        """Log something that happened in the last step.

        Args:
            kind: Kind of the event.
            text: One sentence for people, which can be understood without the other arguments.
            number: Number of the waypoint, from 1, or id of the finding; 0 for other events.
            subject: Name of the touched object, or the reason for the end of the mission; empty for other events.
        """
        step = max(self.log.n_rows("step") - 1, 0)
        self.log.append("event", step=step, kind=kind, number=number, subject=subject, text=text)

    def log_tracked(self, pose: FloatArray, tracked: Tracked) -> None:
        """Log pulses, the bearings of the credible ones, and findings if they have changed.

        Args:
            pose: Estimated x m, y m, yaw rad, world frame, shape (3,).
            tracked: Pulses and findings of the last step.
        """
        pulses, is_overdriven = tracked.pulses, tracked.pulses.is_overdriven
        if is_overdriven.any() and not self._has_clipped:
            self._has_clipped = True
            self.event("clipped", "a pulse exceeded full scale: clipped pulses are not used for locating")
        step, bearing_rad = self.log.n_rows("step") - 1, wrap(pulses.azimuth_rad + pose[2])
        for i in range(pulses.n_pulses):
            pulse = self.log.append(
                "pulse",
                step=step,
                strengths_v=pulses.strengths_v[i],
                mains_phase_rad=pulses.mains_phase_rad[i],
                is_clipped=is_overdriven[i],
                is_credible=tracked.is_credible[i],
            )
            if tracked.is_credible[i]:
                self.log.append(
                    "bearing",
                    pulse=pulse,
                    azimuth_rad=pulses.azimuth_rad[i],
                    bearing_rad=bearing_rad[i],
                    std_rad=pulses.std_rad[i],
                )
        self.log_findings(tracked.findings)
        if tracked.log_likelihood is not None:
            self.log_likelihood(tracked.log_likelihood)

    def log_likelihood(self, log_likelihood: FloatArray) -> None:
        """Log the likelihood over the yard (n_cells,) at the last step, if there is a step."""
        if self.log.n_rows("step"):
            self.log.append("likelihood", step=self.log.n_rows("step") - 1, log_likelihood=log_likelihood)

    def log_findings(self, findings: Sequence[Finding]) -> None:
        """Log all findings if they have changed, and each new state as an event."""
        if tuple(findings) == self._logged:
            return
        before: dict[int, State] = {finding.id: finding.state for finding in self._logged}
        for finding in findings:
            self._log_finding(finding, finding.state)
            was = before.pop(finding.id, None)
            if was != finding.state:
                self.event(finding.state, _state_text(finding, was), finding.id)
        for gone in (finding for finding in self._logged if finding.id in before):
            self._log_finding(gone, "dropped")
            self.event("dropped", f"{_noun(gone.state)} {gone.id} was not a separate source", gone.id)
        self._logged = tuple(findings)

    def log_contradiction(self, contradicts_calibration: bool) -> None:
        """Log once that the pulses contradict the calibration in use."""
        if contradicts_calibration and not self._has_contradicted:
            text = "the pulses contradict the calibration: it is not used, for the array has changed or is another one"
            self.event("calibration", text)
        self._has_contradicted = contradicts_calibration

    def log_association(self, finding: NDArray[np.intp]) -> None:
        """Log, at the end, which finding each credible pulse belongs to.

        Args:
            finding: Id or code of `Unassociated` for each row of the table `bearing`, shape (n_bearings,).
        """
        for pulse, number in zip(self.log.column("bearing", "pulse"), finding, strict=True):
            self.log.append("association", pulse=pulse, finding=number)

    def _log_finding(self, finding: Finding, state: str) -> None:
        self.log.append(
            "finding",
            step=self.log.n_rows("step") - 1,
            id=finding.id,
            position_m=finding.position_m,
            covariance_m2=finding.covariance_m2,
            state=state,
            n_bearings=finding.n_bearings,
            first_detected_s=finding.first_detected_s,
            confirmed_s=np.nan if finding.confirmed_s is None else finding.confirmed_s,
            aperture_rad=finding.aperture_rad,
        )


def _noun(state: State | None) -> str:
    """Return the noun for a finding in a state."""
    return "finding" if state == "confirmed" else "candidate"


def _state_text(finding: Finding, was: State | None) -> str:
    """Describe the new state of a finding; `was` is its state before, None if it is new."""
    x, y, z = finding.position_m
    prefix = {
        None: "towards",
        "confirmed": "is in doubt: a candidate again, near",
        "outside": "may lie inside the fence after all, near",
        "ghost": "is not a ghost after all, near",
    }
    return {
        "candidate": f"{_noun(was)} {finding.id} {prefix.get(was)} ({x:.1f}, {y:.1f}) m",
        "confirmed": f"finding {finding.id} at ({x:.2f}, {y:.2f}, {z:.2f}) m, 95 % in {finding.semi_major_m:.2f} m",
        "ghost": f"candidate {finding.id} is a multipath ghost near ({x:.1f}, {y:.1f}) m",
        "outside": f"candidate {finding.id} seems to lie beyond the fence, near ({x:.0f}, {y:.0f}) m",
    }[finding.state]
