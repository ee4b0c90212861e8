"""The Locator, which turns pulses with bearings into findings."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dirmusic.angles import difference
from dirmusic.array.element_errors import ElementErrors, EstimatedErrors
from dirmusic.array.model import ArrayModel
from dirmusic.arrays import BoolArray, FloatArray, IntArray
from dirmusic.locating.association import Assigner, Assignment, Unassociated
from dirmusic.locating.bearing_fit import locate_by_bearings, triangulate
from dirmusic.locating.confirmation import updated_state
from dirmusic.locating.finding import Finding
from dirmusic.locating.joint_fit import JointEstimate, locate_jointly, with_height_covariance
from dirmusic.locating.protocol import LineOfSight, PoseError
from dirmusic.locating.pulse_record import PulseRecord, PulsesAtPose, Rows, choose_evenly
from dirmusic.locating.rules import LocatingRules
from dirmusic.pulses.batch import PulseBatch

LEARNING_STATES = ("candidate", "confirmed")
"""States of findings from which the array errors are estimated. A source outside the fence may move and have any
polarisation, and the pulses of a ghost do not come from a single point: both would bias the estimate."""

REFIT_SHARE = 0.1
"""Relative change in the number of a finding's pulses that triggers a new fit (assumed). If the new pulses are as good
as the others, they move the position by a twentieth of its standard deviation."""

REFIT_RAD = np.radians(10.0)
"""Change of a finding's aperture that triggers a new fit (assumed): a few pulses from another side contribute more than
many from a direction that is already covered."""

INITIAL_RANGE_M = 10.0
"""Range of a new candidate of which only the bearing is known, and also its standard deviation (assumed)."""


class Learned(NamedTuple):
    """Array errors estimated in a mission.

    Attributes:
        errors: Posterior errors of the elements, which include those known from earlier missions.
        n_pulses: Number of pulses of this mission that were used.
    """

    errors: EstimatedErrors
    n_pulses: int


class FitBasis(NamedTuple):
    """Summary of the pulses of a finding on which a fit is based.

    Attributes:
        n_pulses: Number of pulses of the finding.
        n_in_sight: Number of those pulses that were detected in sight of it.
        aperture_rad: Angle over which its lines of sight spread.
    """

    n_pulses: int
    n_in_sight: int
    aperture_rad: float

    def differs_from(self, fitted: FitBasis) -> bool:
        """Return whether a new fit would be based on considerably different pulses."""
        return (
            abs(self.n_pulses - fitted.n_pulses) > REFIT_SHARE * fitted.n_pulses
            or abs(self.n_in_sight - fitted.n_in_sight) > REFIT_SHARE * fitted.n_in_sight
            or abs(self.aperture_rad - fitted.aperture_rad) > REFIT_RAD
        )


def needs_refit(basis: dict[int, FitBasis], fitted: dict[int, FitBasis]) -> bool:
    """Return whether the set of findings has changed since the last fit, or the pulses of one considerably."""
    if basis.keys() != fitted.keys():
        return True
    return any(of_finding.differs_from(fitted[number]) for number, of_finding in basis.items())


class Locator:
    """Locator that associates pulses with findings, and fits all findings and the array errors jointly.

    It stores every pulse that is consistent with a plane wave.

    Args:
        array: The array's data sheet and spread, and its errors as estimated in earlier missions, which are used until
            the pulses contradict them; never the true array that generated the data.
        pose_error: Error of the poses given to `update`.
        fence_m: Length of the yard along x and y, with the origin at its corner; None without a fence.
        rules: Conditions under which pulses initiate and confirm a finding.
        sight: Transmission along lines of sight according to the map of the yard; None without a map.

    Attributes:
        findings: All current findings, in the order of their ids.
        array: The array as given; its errors are removed once the pulses have contradicted them.
        contradicts_errors: True once the pulses have contradicted the known errors of the array.

    Raises:
        ValueError: If errors of the array are given and the solver is not `joint`, the only one that uses them.
    """

    def __init__(
        self,
        array: ArrayModel,
        pose_error: PoseError,
        *,
        fence_m: tuple[float, float] | None = None,
        rules: LocatingRules | None = None,
        sight: LineOfSight | None = None,
    ) -> None:
        self.array = array
        self.contradicts_errors = False
        self.pose_error = pose_error
        self.fence_m = fence_m
        self.rules = rules or LocatingRules()
        if array.errors is not None and self.rules.solver != "joint":
            raise ValueError(f"`array.errors` needs the solver 'joint', got {self.rules.solver!r}")
        self.findings: tuple[Finding, ...] = ()
        self._n_initiated = 0
        self._next_fit_s = -np.inf
        self._record = PulseRecord(array, pose_error, sight, self.rules.assignment)
        errors = array.errors.mean if array.errors else ElementErrors.none(array.manifold.n_elements)
        self._error_rad = self._record.error_table(errors)
        self._not_recorded: list[PulsesAtPose] = []
        self._fitted: dict[int, FitBasis] = {}
        self._assigner = Assigner(self._record, self.rules.assignment)

    def update(self, time_s: float, pose: FloatArray, pulses: PulseBatch) -> tuple[Finding, ...]:
        """Add the pulses that were detected at one pose, and refit all findings every `refit_s`.

        Args:
            time_s: Time of the pose.
            pose: Estimated x m, y m, yaw rad, world frame, shape (3,).
            pulses: Pulses that are consistent with a single plane wave, with their directions; see
                `plane_wave.is_credible`.

        Returns:
            All current findings, in the order of their ids.
        """
        self._not_recorded.append(PulsesAtPose(time_s, pose, pulses))
        has_candidate = any(finding.state == "candidate" for finding in self.findings)  # may become a ghost
        if (pulses.n_pulses or has_candidate) and time_s >= self._next_fit_s:
            self._next_fit_s = time_s + self.rules.refit_s
            self._renew(time_s, always=False)
        return self.findings

    def refit(self, time_s: float) -> tuple[Finding, ...]:
        """Associate and fit all pulses so far, even if `refit_s` has not passed, and return all findings."""
        return self._renew(time_s, always=True)

    def association(self) -> Rows:
        """Return the id of the finding of each pulse so far, or a code of `Unassociated`; shape (n_pulses_so_far,)."""
        finding = self._assigned().finding.copy()
        ids = np.array([finding.id for finding in self.findings], dtype=np.intp)
        has_finding = finding >= 0
        finding[has_finding] = ids[finding[has_finding]]
        return finding

    def learned(self) -> Learned | None:
        """Return the errors of the array as estimated from confirmed findings.

        Returns None without a confirmed finding, or with the solver `bearings`. Candidates are not used,
        because a mirror image would bias the errors.
        """
        assignment = self._assigned()
        chosen = {
            k: seen
            for k, finding in enumerate(self.findings)
            if finding.state == "confirmed"
            and (seen := np.flatnonzero((assignment.finding == k) & assignment.in_sight)).size
        }
        if not chosen or self.rules.solver != "joint":
            return None
        return Learned(self._locate(chosen, self.array).errors, sum(rows.size for rows in chosen.values()))

    def _assigned(self) -> Assignment:
        """Assign all pulses so far to the current findings; new pulses are recorded here in bulk, which is faster."""
        self._record.extend(self._not_recorded)
        self._not_recorded = []
        return self._assigner.assign(self.findings, self._error_rad)

    def _renew(self, time_s: float, *, always: bool) -> tuple[Finding, ...]:
        """Assign all pulses so far, fit if they have changed considerably or `always`, and return all findings."""
        assignment = self._with_initiation(self._without_unsupported(), time_s)
        basis: dict[int, FitBasis] = {}
        for k, finding in enumerate(self.findings):
            own = assignment.finding == k
            n_in_sight = int(np.count_nonzero(own & assignment.in_sight))
            basis[finding.id] = FitBasis(int(np.count_nonzero(own)), n_in_sight, finding.aperture_rad)
        distinct: Sequence[Finding] = self.findings
        if always or needs_refit(basis, self._fitted):
            self._fitted = basis
            distinct = merge_findings(self._fit(assignment), self.rules.merge_m)
            assignment = self._assigner.assign(distinct, self._error_rad)
        self.findings = self._with_states(distinct, assignment, time_s)
        return self.findings

    def _without_unsupported(self) -> Assignment:
        """Drop findings that have fewer pulses than initiate a candidate, and assign all pulses to the others."""
        assignment = self._assigned()
        finding = assignment.finding
        n_pulses = np.bincount(finding[finding >= 0], minlength=len(self.findings))
        least = self.rules.initiation_pulses
        kept = [finding for n, finding in zip(n_pulses, self.findings, strict=True) if n >= least]
        if len(kept) == len(self.findings):
            return assignment
        self.findings = tuple(kept)
        return self._assigned()

    def _with_initiation(self, assignment: Assignment, time_s: float) -> Assignment:
        """Initiate a candidate from recent unassigned pulses.

        If their lines of sight cross near an existing finding, its position is wrong, and they are assigned to it.
        """
        is_first = all(finding.state not in ("candidate", "confirmed") for finding in self.findings)
        unassigned = assignment.finding == Unassociated.UNASSIGNED
        rows = rows_of_candidate(self._record, unassigned, self._error_rad, self.rules, time_s, is_first=is_first)
        if not rows.size:
            return assignment
        candidate = new_candidate(self._record, rows, self._error_rad, self._n_initiated + 1)
        apart_m = [float(np.linalg.norm((candidate.position_m - other.position_m)[:2])) for other in self.findings]
        finding = assignment.finding.copy()
        if apart_m and min(apart_m) < self.rules.merge_m:
            finding[rows] = int(np.argmin(apart_m))
            return assignment._replace(finding=finding)
        self._n_initiated += 1
        finding[rows] = len(self.findings)
        self.findings += (candidate,)
        return self._assigner.assign(self.findings, self._error_rad)._replace(finding=finding)

    def _with_states(self, findings: Sequence[Finding], assignment: Assignment, time_s: float) -> tuple[Finding, ...]:
        """Update the states of findings; a new confirmation must still hold after the pulses are reassigned."""
        now = self._states(findings, assignment, time_s)
        is_new = [a.state == "confirmed" != b.state for a, b in zip(now, findings, strict=True)]
        if not any(is_new):
            return now
        then = self._states(now, self._assigner.assign(now, self._error_rad), time_s)
        return tuple(
            replace(finding, state="candidate", confirmed_s=before.confirmed_s)
            if new and after.state != "confirmed"
            else finding
            for finding, before, after, new in zip(now, findings, then, is_new, strict=True)
        )

    def _states(self, findings: Sequence[Finding], assignment: Assignment, time_s: float) -> tuple[Finding, ...]:
        return tuple(
            updated_state(finding, k, assignment, self._record, self._error_rad, self.rules, self.fence_m, time_s)
            for k, finding in enumerate(findings)
        )

    def _fit(self, assignment: Assignment) -> list[Finding]:
        """Fit the positions of findings to their pulses in sight; triangulate findings that have too few of these.

        Findings in `LEARNING_STATES` are fitted jointly with the errors of the array; the others with these errors.
        """
        moved, chosen = list(self.findings), dict[int, Rows]()
        for k, finding in enumerate(self.findings):
            own = np.flatnonzero(assignment.finding == k)
            seen = own[assignment.in_sight[own]]
            if seen.size >= self.rules.initiation_pulses:
                chosen[k] = seen
            elif own.size >= self.rules.initiation_pulses and finding.state != "confirmed":
                rows = choose_evenly(own, self.rules.max_pulses)
                position, covariance = self._record.crossing(rows, self._error_rad)
                if np.isfinite(covariance).all():
                    moved[k] = replace(finding, position_m=position, covariance_m2=covariance)
        learning = {k: rows for k, rows in chosen.items() if moved[k].state in LEARNING_STATES}
        array = self.array
        if learning:
            estimate = self._learn(learning)
            self._move(moved, learning, estimate)
            array = replace(self.array, errors=estimate.errors)
        others = {k: rows for k, rows in chosen.items() if k not in learning}
        if others:
            self._move(moved, others, self._locate(others, array))
        return moved

    def _learn(self, learning: dict[int, Rows]) -> JointEstimate:
        """Fit findings jointly with the errors of the array, and store the errors."""
        estimate = self._locate(learning, self.array)
        if self.array.errors is not None and estimate.errors.contradicts(self.array.errors):
            self.array = replace(self.array, errors=None)
            self.contradicts_errors = True
            estimate = self._locate(learning, self.array)
        self._error_rad = self._record.error_table(estimate.errors.mean)
        return estimate

    def _move(self, findings: list[Finding], fitted: Iterable[int], estimate: JointEstimate) -> None:
        """Move the fitted findings to their estimated positions; one that moves too far becomes a candidate."""
        for k, position, covariance in zip(fitted, estimate.positions_m, estimate.covariances_m2, strict=True):
            has_jumped = np.linalg.norm((position - findings[k].position_m)[:2]) > self.rules.merge_m
            state = "candidate" if has_jumped else findings[k].state
            findings[k] = replace(findings[k], position_m=position, covariance_m2=covariance, state=state)

    def _locate(self, chosen: dict[int, Rows], array: ArrayModel) -> JointEstimate:
        """Fit some of the findings, each to the chosen rows of pulses, with the solver that the rules name."""
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
        """Return the starting point of the fit: the last position if it is known well, else a rough crossing."""
        if finding.semi_major_m < 2 * self.rules.merge_m:
            return finding.position_m
        return self._record.rough_crossing(choose_evenly(rows, self.rules.max_pulses), self._error_rad)


def rows_of_candidate(
    record: PulseRecord,
    unassigned: BoolArray,
    error_rad: FloatArray,
    rules: LocatingRules,
    time_s: float,
    *,
    is_first: bool,
) -> Rows:
    """Find the largest group of recent unassigned pulses from one direction; return no rows if it is too small.

    Pulses from above can initiate only the first candidate, because two simultaneous waves look like one from above.

    Args:
        record: All pulses.
        unassigned: True for pulses that are not associated with a finding, shape (n,).
        error_rad: Table of known bearing errors, see `PulseRecord.error_table`.
        rules: Minimum number of pulses, width of the arc, and maximum age.
        time_s: Current time.
        is_first: True if there is neither a candidate nor a confirmed finding.
    """
    rows = np.flatnonzero(unassigned & (is_first | ~record.is_from_above))
    recent = rows[record.pulses.time_s[rows] > time_s - rules.initiation_s]
    none = np.empty(0, dtype=np.intp)
    if recent.size < rules.initiation_pulses:
        return none
    bearing, std = record.bearings(recent, error_rad)
    n_near = _count_neighbours(bearing, rules.initiation_arc_rad)
    rows = recent[np.abs(difference(bearing[n_near.argmax()], bearing)) < rules.initiation_arc_rad]
    if rows.size < rules.initiation_pulses and rules.initiation_by_crossing:
        rows = choose_evenly(recent, rules.max_pulses)
        bearing, std = record.bearings(rows, error_rad)
        rows = rows[triangulate(record.pose[rows, :2], bearing, std).is_inlier]
    return rows if rows.size >= rules.initiation_pulses else none


def new_candidate(record: PulseRecord, rows: Rows, error_rad: FloatArray, number: int) -> Finding:
    """Create a candidate where the lines of sight of some pulses cross, or at a typical range if they do not.

    At most 4096 lines of sight are used, evenly selected.
    """
    position_m, covariance_m2 = record.crossing(choose_evenly(rows, 4096), error_rad)
    if not np.isfinite(covariance_m2).all():
        sight_m = position_m[:2] - record.pose[rows[-1], :2]
        position_m[:2] -= sight_m * (1.0 - INITIAL_RANGE_M / max(float(np.linalg.norm(sight_m)), INITIAL_RANGE_M))
        covariance_m2 = with_height_covariance(np.eye(2) * INITIAL_RANGE_M**2)
    first_s, last_s = record.pulses.time_s[rows[[0, -1]]].tolist()
    return Finding(
        id=number,
        state="candidate",
        position_m=position_m,
        covariance_m2=covariance_m2,
        n_bearings=rows.size,
        first_detected_s=first_s,
        last_detected_s=last_s,
        confirmed_s=None,
        aperture_rad=0.0,
        nearest_m=np.inf,
        level_db=np.nan,
    )


def _count_neighbours(bearing_rad: FloatArray, arc_rad: float) -> IntArray:
    """Count, for each bearing, the bearings within an arc to either side of it; both have the shape (n,)."""
    turned_rad = np.mod(bearing_rad, 2 * np.pi)
    sorted_rad = np.sort(turned_rad)
    around_rad = np.concatenate([sorted_rad - 2 * np.pi, sorted_rad, sorted_rad + 2 * np.pi])
    above = np.searchsorted(around_rad, turned_rad + arc_rad, side="left")
    return above - np.searchsorted(around_rad, turned_rad - arc_rad, side="right")


def merge_findings(findings: Iterable[Finding], merge_m: float) -> list[Finding]:
    """Drop every finding that lies within `merge_m` of a confirmed one, or else of one with a lower id.

    Distances are horizontal. The remaining findings stay in the order of their ids.
    """
    distinct: list[Finding] = []
    for finding in sorted(findings, key=lambda one: (one.state != "confirmed", one.id)):
        apart_m = [np.linalg.norm((finding.position_m - other.position_m)[:2]) for other in distinct]
        if not apart_m or min(apart_m) > merge_m:
            distinct.append(finding)
    return sorted(distinct, key=lambda one: one.id)
