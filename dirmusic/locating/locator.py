"""Locator: the one place that turns pulses with bearings into findings."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.element_errors import ElementErrors, EstimatedErrors
from dirmusic.array.model import ArrayModel
from dirmusic.locating.association.assignment import Assigner, Assignment
from dirmusic.locating.association.pulse_record import Detections, PulseRecord, Rows, evenly
from dirmusic.locating.association.sight_lines import Sight
from dirmusic.locating.births import find_birth
from dirmusic.locating.confirmation import updated_state
from dirmusic.locating.finding import Finding
from dirmusic.locating.fitting.bearing_fix import locate_by_bearings
from dirmusic.locating.fitting.joint_fix import JointFix, PoseError, locate_jointly
from dirmusic.locating.rules import LocatingRules
from dirmusic.locating.support import Support, are_worth_a_fit
from dirmusic.pulses.batch import PulseBatch

FloatArray = NDArray[np.float64]


TEACHING = ("candidate", "confirmed")
"""States of findings by which the array's errors are learned. What lies outside the fence may move and have any
polarisation, and what is a ghost came from no one place: they would teach errors that are none."""


class Learned(NamedTuple):
    """What a mission has learned of its array.

    Attributes:
        errors: Of its elements, with all that was known of them before in it.
        n_pulses: Pulses of this mission behind it.
    """

    errors: EstimatedErrors
    n_pulses: int


class Locator:
    """Keeps every credible pulse, assigns pulses to findings, and fits all findings and the array together.

    Args:
        array: The array's data sheet and spread, and what earlier missions have learned of its errors, which counts
            until the pulses contradict it; never the array that made the data.
        pose_error: How wrong the poses given to `update` may be.
        fence_m: Length of the yard along x and y, origin at the corner; None where there is no fence.
        rules: When pulses make and confirm a finding.
        sight: What the map of the yard obstructs; None where there is no map.

    Attributes:
        findings: All findings so far, in the order of their ids.
        array: As given; without errors from the fit on that has contradicted them.

    Raises:
        ValueError: If errors are known and bearings are to be fitted, which makes no use of them.
    """

    def __init__(
        self,
        array: ArrayModel,
        pose_error: PoseError,
        *,
        fence_m: tuple[float, float] | None = None,
        rules: LocatingRules | None = None,
        sight: Sight | None = None,
    ) -> None:
        self.array = array
        self.pose_error = pose_error
        self.fence_m = fence_m
        self.rules = rules or LocatingRules()
        if array.errors is not None and self.rules.solver != "joint":
            raise ValueError(f"`array.errors` count in the joint fit alone, got them with solver {self.rules.solver!r}")
        self.findings: tuple[Finding, ...] = ()
        self._n_born = 0
        self._next_fit_s = -np.inf
        self._errors = array.errors.mean if array.errors else ElementErrors.none(array.manifold.n_elements)
        self._record = PulseRecord(array, pose_error, sight, self.rules.assignment)
        self._not_recorded: list[Detections] = []
        self._fitted: dict[int, Support] = {}
        self._assigner = Assigner(self._record, self.rules.assignment)

    def update(self, time_s: float, pose: FloatArray, pulses: PulseBatch) -> tuple[Finding, ...]:
        """Take in what was detected from one pose; refit everything once every `refit_s`.

        Args:
            time_s: When.
            pose: Believed x m, y m, yaw rad, world frame, shape (3,).
            pulses: Credible pulses, with their directions; see `credibility.is_credible`.

        Returns:
            All findings so far, in the order of their ids.
        """
        self._not_recorded.append(Detections(time_s, pose, pulses))
        if (pulses.n_pulses or self._is_waiting) and time_s >= self._next_fit_s:
            self._next_fit_s = time_s + self.rules.refit_s
            self._renew(time_s, always=False)
        return self.findings

    def refit(self, time_s: float) -> tuple[Finding, ...]:
        """Assign and fit all pulses so far anew, whenever the last fit was; all findings."""
        return self._renew(time_s, always=True)

    def _assigned(self) -> Assignment:
        """All pulses so far, assigned to the findings as they stand.

        What was detected since goes into the record at once: step by step that takes several times as long.
        """
        self._record.extend(self._not_recorded)
        self._not_recorded = []
        return self._assigner.assign(self.findings, self._errors)

    def _renew(self, time_s: float, *, always: bool) -> tuple[Finding, ...]:
        """Assign all pulses so far, and fit them where that is asked for or worth it; all findings."""
        assignment = self._with_birth(self._without_unsupported(), time_s)
        supports: dict[int, Support] = {}
        for k, finding in enumerate(self.findings):
            own = assignment.owner == k
            n_in_sight = int(np.count_nonzero(own & assignment.in_sight))
            supports[finding.id] = Support(int(np.count_nonzero(own)), n_in_sight, finding.aperture_rad)
        distinct = self.findings
        if always or are_worth_a_fit(supports, self._fitted):
            self._fitted = supports
            distinct = merge_findings(self._fit(assignment), self.rules.merge_m)
            assignment = self._assigner.assign(distinct, self._errors)
        self.findings = self._with_states(distinct, assignment, time_s)
        return self.findings

    def _with_states(self, findings: Sequence[Finding], assignment: Assignment, time_s: float) -> tuple[Finding, ...]:
        """Findings with their states; confirmed anew are those that stay so with the pulses of confirmed findings."""
        now = self._states(findings, assignment, time_s)
        is_new = [a.state == "confirmed" != b.state for a, b in zip(now, findings, strict=True)]
        if not any(is_new):
            return now
        then = self._states(now, self._assigner.assign(now, self._errors), time_s)
        return tuple(
            replace(finding, state="candidate", confirmed_s=before.confirmed_s)
            if new and after.state != "confirmed"
            else finding
            for finding, before, after, new in zip(now, findings, then, is_new, strict=True)
        )

    def _states(self, findings: Sequence[Finding], assignment: Assignment, time_s: float) -> tuple[Finding, ...]:
        return tuple(
            updated_state(finding, k, assignment, self._record, self._errors, self.rules, self.fence_m, time_s)
            for k, finding in enumerate(findings)
        )

    @property
    def _is_waiting(self) -> bool:
        """Whether silence tells something: there is a candidate."""
        return any(finding.state == "candidate" for finding in self.findings)

    def association(self) -> Rows:
        """Id of the finding of each pulse so far, or a code of `NoOwner`; shape (n_pulses_so_far,)."""
        owner = self._assigned().owner.copy()
        ids = np.array([finding.id for finding in self.findings], dtype=np.intp)
        is_owned = owner >= 0
        owner[is_owned] = ids[owner[is_owned]]
        return owner

    def learned(self) -> Learned | None:
        """What the confirmed findings have taught of the array; None before there is one, and of bearings.

        Candidates do not count: one that is a mirror image would teach errors that are none.
        """
        assignment = self._assigned()
        chosen = {
            k: seen
            for k, finding in enumerate(self.findings)
            if finding.state == "confirmed"
            and (seen := np.flatnonzero((assignment.owner == k) & assignment.in_sight)).size
        }
        if not chosen or self.rules.solver != "joint":
            return None
        return Learned(self._locate(chosen, self.array).errors, sum(rows.size for rows in chosen.values()))

    def _without_unsupported(self) -> Assignment:
        """Drop findings with too few pulses to make one, and assign all pulses to the others."""
        assignment = self._assigned()
        owner = assignment.owner
        n_pulses = np.bincount(owner[owner >= 0], minlength=len(self.findings))
        kept = [finding for n, finding in zip(n_pulses, self.findings, strict=True) if n >= self.rules.birth_pulses]
        if len(kept) == len(self.findings):
            return assignment
        self.findings = tuple(kept)
        return self._assigned()

    def _with_birth(self, assignment: Assignment, time_s: float) -> Assignment:
        """The assignment with recent unassigned pulses given to a new candidate.

        If they cross where a finding is already, that one is off, not doubled: they become its own.
        """
        is_first = all(finding.state not in ("candidate", "confirmed") for finding in self.findings)
        birth = find_birth(self._record, assignment.owner, self._errors, self.rules, time_s, is_first=is_first)
        if birth is None:
            return assignment
        apart_m = [float(np.linalg.norm((birth.position_m - finding.position_m)[:2])) for finding in self.findings]
        owner = assignment.owner.copy()
        if apart_m and min(apart_m) < self.rules.merge_m:
            owner[birth.rows] = int(np.argmin(apart_m))
            return assignment._replace(owner=owner)
        self._n_born += 1
        owner[birth.rows] = len(self.findings)
        self.findings += (birth.candidate(self._n_born),)
        return self._assigner.assign(self.findings, self._errors)._replace(owner=owner)

    def _fit(self, assignment: Assignment) -> list[Finding]:
        """Findings at the positions that their pulses give, or by crossing where none is in sight.

        What may discharge is fitted together with the errors of the array, the others with what was learned of these.
        """
        moved, chosen = list(self.findings), dict[int, Rows]()
        for k, finding in enumerate(self.findings):
            own = np.flatnonzero(assignment.owner == k)
            seen = own[assignment.in_sight[own]]
            if seen.size >= self.rules.birth_pulses:
                chosen[k] = seen
            elif own.size >= self.rules.birth_pulses and finding.state != "confirmed":
                position, covariance = self._record.crossing(evenly(own, self.rules.max_pulses), self._errors)
                if np.isfinite(covariance).all():
                    moved[k] = replace(finding, position_m=position, covariance_m2=covariance)
        teaching = {k: rows for k, rows in chosen.items() if moved[k].state in TEACHING}
        array = self.array
        if teaching:
            fix = self._learn(teaching)
            self._move(moved, teaching, fix)
            array = replace(self.array, errors=fix.errors)
        others = {k: rows for k, rows in chosen.items() if k not in teaching}
        if others:
            self._move(moved, others, self._locate(others, array))
        return moved

    def _learn(self, teaching: dict[int, Rows]) -> JointFix:
        """Fit findings together with the errors of the array, and keep these."""
        fix = self._locate(teaching, self.array)
        if self.array.errors is not None and fix.errors.contradicts(self.array.errors):
            self.array = replace(self.array, errors=None)
            fix = self._locate(teaching, self.array)
        self._errors = fix.errors.mean
        return fix

    def _move(self, findings: list[Finding], fitted: Iterable[int], fix: JointFix) -> None:
        """Put those of the findings that were fitted where the fix has them."""
        for k, position, covariance in zip(fitted, fix.positions_m, fix.covariances_m2, strict=True):
            has_jumped = np.linalg.norm((position - findings[k].position_m)[:2]) > self.rules.merge_m
            state = "candidate" if has_jumped else findings[k].state
            findings[k] = replace(findings[k], position_m=position, covariance_m2=covariance, state=state)

    def _locate(self, chosen: dict[int, Rows], array: ArrayModel) -> JointFix:
        """Fit some of the findings, each by the chosen rows of its pulses, as the rules say."""
        locate = locate_jointly if self.rules.solver == "joint" else locate_by_bearings
        pulses, poses = zip(*(self._record.pooled(own, self.rules.max_pulses) for own in chosen.values()), strict=True)
        return locate(
            PulseBatch.join(pulses),
            np.concatenate(poses),
            np.repeat(np.arange(len(chosen)), [len(pose) for pose in poses]),
            np.array([self._start(self.findings[k], own) for k, own in chosen.items()]),
            array,
            self.pose_error,
        )

    def _start(self, finding: Finding, rows: Rows) -> FloatArray:
        """Where the joint fit starts: the last position, or a fresh one while that is not worth much."""
        if finding.semi_major_m < 2 * self.rules.merge_m:
            return finding.position_m
        return self._record.rough_crossing(evenly(rows, self.rules.max_pulses), self._errors)


def merge_findings(findings: Iterable[Finding], merge_m: float) -> list[Finding]:
    """Drop every finding that lies within `merge_m` of a confirmed one, or else of one with a lower id.

    Distances are on plan. The others keep the order of their ids.
    """
    distinct: list[Finding] = []
    for finding in sorted(findings, key=lambda one: (one.state != "confirmed", one.id)):
        apart_m = [np.linalg.norm((finding.position_m - other.position_m)[:2]) for other in distinct]
        if not apart_m or min(apart_m) > merge_m:
            distinct.append(finding)
    return sorted(distinct, key=lambda one: one.id)
