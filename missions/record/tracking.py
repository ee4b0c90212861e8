"""Tracker: passes usable pulses to the Locator and logs its findings, in missions and for field data."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace

import numpy as np

from dirmusic import ArrayModel, Finding, Locator, PulseBatch
from dirmusic.angles import wrap
from dirmusic.arrays import FloatArray, IntArray
from dirmusic.bearing.elevation import total_std
from dirmusic.frame import FrameEstimate
from dirmusic.locating.finding import State
from dirmusic.locating.protocol import LocatorProtocol, PoseError
from dirmusic.locating.yard_likelihood import YardLikelihood
from pdpatrol.envs.scenario.array import ArrayCalibration
from pdpatrol.envs.user_code import UserCodeError, calling, place_of
from pdpatrol.missions.record.events import EventKind
from pdpatrol.missions.record.log_contents import grid_of
from pdpatrol.missions.record.mission_log import TABLES, MissionLog
from pdpatrol.missions.record.words import name_of, percent

FINDINGS = "a tuple of dirmusic.Finding, with ids from 1 on that differ"

FINDING_EVENTS = ("candidate", "confirmed", "outside", "possibly two", "dropped")
"""Kinds of the events of a finding."""

LIKELIHOOD_S, LIKELIHOOD_SHARE = 8.0, 0.01
"""Shortest time between two likelihoods over the yard, in seconds and as a fraction of the time so far. Assumed; by
then the robot is elsewhere, and a survey of several days does not need one for each place."""


class Tracker:
    """Adapter that passes usable pulses to a Locator: those with a direction, and without clipped channels.

    No other code calls the Locator. The covariances of its findings refer to the frame of the poses;
    the tracker adds the error of that frame against the map.

    Pulses, bearings, findings and their new states are logged in the last step of the log.

    Args:
        log: Log to write to, whose `meta` has the bounds of the yard.
        locator: Locator that makes findings from pulses.
        array: Data sheet and spread of the array.
        pose_error: Error of the poses.
        max_std_rad: Largest standard deviation of a direction that is used.

    Attributes:
        findings: Findings so far, on the map.

    Raises:
        UserCodeError: In any call, if a user's Locator raises an exception or breaks the contract.
    """

    def __init__(
        self,
        log: MissionLog,
        locator: LocatorProtocol,
        array: ArrayModel,
        pose_error: PoseError,
        max_std_rad: float,
    ) -> None:
        self.findings: tuple[Finding, ...] = ()
        self._given: tuple[tuple[Finding, ...], bytes] = (), b""
        self._log = log
        self._locator = locator
        self._built_in: Locator | None = locator if type(locator) is Locator else None
        self._array = array
        self._max_std_rad = max_std_rad
        self._frame: FrameEstimate | None = None
        self._pose_error = pose_error
        self._likelihood = YardLikelihood(array, pose_error, grid_of(log.meta))
        self._next_likelihood_s = -np.inf
        self._pending: list[tuple[PulseBatch, FloatArray]] = []

    def track(
        self,
        time_s: float,
        pose: FloatArray,
        pulses: PulseBatch,
        frame: FrameEstimate | None = None,
        *,
        is_last: bool = False,
    ) -> None:
        """Locate with the pulses of one step.

        Args:
            time_s: Time of the step.
            pose: Estimated x m, y m, yaw rad, world frame, shape (3,).
            pulses: Pulses with their directions.
            frame: Error of the poses and their frame against the map; None without a map.
            is_last: Fit all pulses again with those of this step.
        """
        self._frame = frame
        if frame is not None:
            self._pose_error = self._likelihood.pose_error = frame.pose_error
            if self._built_in:
                self._built_in.pose_error = frame.pose_error
        is_clipped = pulses.is_overdriven
        is_used = ~is_clipped & (pulses.std_rad < self._max_std_rad)
        used, first = pulses if is_used.all() else pulses.take(is_used), self._log.n_rows("pulse")
        with self._calling(FINDINGS):
            findings = self._locator.update(time_s, pose.copy(), used)
            if is_last:
                findings = self._locator.refit(time_s)
        if is_clipped.any():
            self._log_once("clipped", "a pulse exceeded full scale: clipped pulses are not used for locating")
        self._log.extend(
            "pulse",
            step=np.full(pulses.n_pulses, self._log.last_step),
            strengths_v=pulses.strengths_v,
            std_v=np.sqrt(pulses.variance_v2),
            mains_phase_rad=pulses.mains_phase_rad,
            is_clipped=is_clipped,
            is_used=is_used,
        )
        self._log.extend(
            "bearing",
            pulse=first + np.flatnonzero(is_used),
            azimuth_rad=used.azimuth_rad,
            bearing_rad=wrap(used.azimuth_rad + pose[2]),
            std_rad=used.std_rad,
            total_std_rad=np.hypot(total_std(used, self._array), self._pose_error.heading_rad),
            elevation_rad=used.elevation_rad,
        )
        self._update_findings(findings)
        if used.n_pulses:
            self._pending.append((used, pose))
        if self._pending and time_s >= self._next_likelihood_s:
            tracked_s = time_s - self._log.column("step", "time_s", 0, 1).item()
            self._next_likelihood_s = time_s + max(LIKELIHOOD_S, LIKELIHOOD_SHARE * tracked_s)
            self._log_likelihood()
        if self._contradicts_calibration:
            text = "the pulses contradict the calibration: it is not used, for the array has changed or is another one"
            self._log_once("calibration", text)

    def refit(self, time_s: float) -> None:
        """Fit all pulses again; the last step must not have been fitted."""
        with self._calling(FINDINGS):
            findings = self._locator.refit(time_s)
        self._update_findings(findings)

    def finish(self, mission: str, serial_number: int | None, before: ArrayCalibration | None) -> None:
        """Log at the end which finding each used pulse belongs to, the likelihood, the array and its calibration.

        No calibration is logged without new information on the array, or for a user's Locator.

        Args:
            mission: Name of the mission.
            serial_number: Serial number of the array.
            before: Calibration that the mission started with.
        """
        used = self._log.column("bearing", "pulse")
        self._log.extend("association", pulse=used, finding=self._association(used.size))
        if self._log.n_rows("step"):
            self._log_likelihood()
        estimate = self._built_in.array_estimate() if self._built_in else None
        if estimate is not None:
            errors, n_pulses = estimate.errors, estimate.n_pulses
            used = None if self._contradicts_calibration else before
            calibration = ArrayCalibration.after(mission, errors, n_pulses, self._array, serial_number, used)
            self._log.meta["calibration"] = calibration.model_dump(mode="json", exclude_none=True)
            self._log.meta["array_estimate"] = {
                name: value for name, value in vars(estimate).items() if isinstance(value, float)
            }
            for text in estimate.contradictions():
                self._log.event("array", text)

    def renumber(self) -> None:
        """Renumber the findings in the log from 1: confirmed ones first, then the others, then those that were dropped.

        For logs that nobody has seen yet; a mission keeps the numbers that its findings had from the beginning.
        """
        log, events = self._log, self._log.table("event")
        ids, owner = log.column("finding", "id").tolist(), log.column("association", "finding").tolist()
        shown = sorted(self.findings, key=lambda finding: (finding.state != "confirmed", finding.id))
        order = dict.fromkeys([0, *(finding.id for finding in shown), *ids])
        new = {old: number for number, old in enumerate(order)}
        log.replace("finding", id=[new[old] for old in ids])
        log.replace("association", finding=[new[old] for old in owner])
        numbers, texts = events["number"].tolist(), events["text"].tolist()
        for row in np.flatnonzero(np.isin(events["kind"], FINDING_EVENTS)).tolist():
            noun, _, rest = texts[row].split(" ", 2)  # all these texts begin with "finding 3" or "candidate 3"
            numbers[row] = new[numbers[row]]
            texts[row] = f"{noun} {numbers[row]} {rest}"
        log.replace("event", number=numbers, text=texts)
        self.findings = tuple(replace(finding, id=new[finding.id]) for finding in shown)

    @property
    def _contradicts_calibration(self) -> bool:
        return self._built_in is not None and self._built_in.contradicts_errors

    def _calling(self, expected: str) -> AbstractContextManager[None]:
        """Return a context in which errors of a user's Locator name its line and the expected result."""
        return nullcontext() if self._built_in else calling(self._locator, expected)

    def _association(self, n_pulses: int) -> IntArray:
        """Return the finding of each of the first pulses that the Locator was given, shape (n_pulses,)."""
        known = [0, *(finding.id for finding in self.findings)]
        expected = f"an integer for each of {n_pulses} pulses, of {', '.join(map(str, known))}"
        with self._calling(expected):
            association = np.asarray(self._locator.association())
        is_integer = association.ndim == 1 and association.size >= n_pulses and association.dtype.kind in "iu"
        if not is_integer or not np.isin(association, known).all():
            raise UserCodeError(
                f"{place_of(self._locator)}: association gave {association.dtype} of shape {association.shape}, "
                f"{' '.join(repr(association).split()):.60}; expected {expected}"
            )
        return association[:n_pulses]

    def _log_once(self, kind: EventKind, text: str) -> None:
        """Log the first event of a kind."""
        if kind not in self._log.column("event", "kind"):
            self._log.event(kind, text)

    def _log_likelihood(self) -> None:
        """Log the likelihood over the yard by all pulses so far; see `YardLikelihood`."""
        if self._pending:
            pulses, poses = zip(*self._pending, strict=True)
            pose = np.repeat(poses, [batch.n_pulses for batch in pulses], axis=0)
            self._likelihood.add(PulseBatch.join(pulses).without_bands(), pose)
            self._pending = []
        self._log.append("likelihood", step=self._log.last_step, log_likelihood=self._likelihood.log_likelihood)

    def _on_map(self, finding: Finding) -> Finding:
        """Return a finding with the error of the frame in its covariance."""
        if self._frame is None:
            return finding
        covariance_m2 = finding.covariance_m2.copy()
        covariance_m2[:2, :2] += self._frame.covariance_at(finding.position_m[:2])
        return replace(finding, covariance_m2=covariance_m2)

    def _update_findings(self, findings: tuple[Finding, ...]) -> None:
        """Check findings, log all if they have changed, and each new state as an event."""
        is_tuple = isinstance(findings, tuple) and all(isinstance(finding, Finding) for finding in findings)
        if not is_tuple or len({finding.id for finding in findings}) < len(findings):
            raise UserCodeError(f"{place_of(self._locator)}: gave {findings!r:.80}; expected {FINDINGS}")
        given = findings, b"" if self._frame is None else self._frame.covariance.tobytes()
        if given == self._given:
            return
        self._given, findings = given, tuple(self._on_map(finding) for finding in findings)
        before = {finding.id: finding for finding in self.findings}
        self.findings = findings
        for finding in findings:
            was = before.pop(finding.id, None)
            if was is None or was.state != finding.state:
                self._log.event(finding.state, _state_text(finding, was and was.state), finding.id)
            if finding.possibly_two and not (was and was.possibly_two):
                name = name_of(finding.state, finding.id)
                text = f"{name} is possibly two sources: two explain its pulses better than one"
                self._log.event("possibly two", text, finding.id)
        for gone in before.values():
            text = f"{name_of(gone.state, gone.id)} was multipath, interference, or part of another source"
            self._log.event("dropped", text, gone.id)
        logged = [*((finding, finding.state) for finding in findings), *((gone, "dropped") for gone in before.values())]
        for finding, state in logged:
            values = {name: value for name, value in vars(finding).items() if name in TABLES["finding"]}
            self._log.append("finding", **values | {"step": self._log.last_step, "state": state})


def _state_text(finding: Finding, was: State | None) -> str:
    """Describe the new state of a finding; `was` is its state before, None if it is new."""
    x, y, z = finding.position_m
    match finding.state, was:
        case "confirmed", _:
            return (
                f"finding {finding.id} at ({x:.2f}, {y:.2f}, {z:.2f}) m, 95 % in {finding.semi_major_m:.2f} m, "
                f"probability {percent(finding.existence)}"
            )
        case "candidate", "confirmed":
            return f"finding {finding.id} is in doubt: a candidate again, near ({x:.1f}, {y:.1f}) m"
        case "candidate", None:
            words = "towards"
        case "candidate", _:
            words = "may be a source after all, near"
        case _:
            words = "seems to lie beyond the fence, near"
    return f"candidate {finding.id} {words} ({x:.1f}, {y:.1f}) m"
