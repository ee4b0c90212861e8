"""Locator: the one place that turns bearings into findings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from dirmusic.angles import difference, opening
from dirmusic.array.bounds import perpendicular_slope
from dirmusic.array.element_errors import ElementErrors
from dirmusic.array.model import ArrayModel
from dirmusic.locating.assignment import UNASSIGNED, Assignment, AssignmentRules, InSight, PulseRecord
from dirmusic.locating.finding import CHI2_95, Finding, State
from dirmusic.locating.joint_fix import PoseError, locate_jointly
from dirmusic.locating.triangulation import triangulate
from dirmusic.pulses.batch import PulseBatch

FloatArray = NDArray[np.float64]

FARTHEST_START_M = 60.0
"""Lines of sight that cross further away are taken to cross here, to start the fit (assumed)."""

LEVEL_QUANTILE = 0.75
"""Of the levels of a finding's pulses, the one that stands for it (assumed): those in sight are the louder ones."""

UNKNOWN_M = 10.0
"""Standard deviation of a position of which only the bearing is known, until the first fit (assumed)."""


@dataclass(frozen=True, kw_only=True)
class LocatingRules:
    """When sightings count, belong together, make a candidate, and confirm it. All values are assumed.

    Attributes:
        max_std_rad: A pulse with a wider bearing is not credible; noise triggers are wider by far.
        misfit_factor: A pulse is not credible if no direction explains its strengths to this many times what noise, the
            array's spread and `misfit_floor` explain.
        misfit_floor: Share of the energy that the far-field model of a perfect array leaves unexplained close by.
        assignment: When a pulse belongs to a candidate.
        birth_pulses: Credible pulses from one direction, within `birth_s`, that make a candidate.
        birth_s: See above.
        birth_arc_rad: Half the arc that counts as one direction.
        birth_by_crossing: Whether so many pulses whose lines of sight cross at one place make a candidate too: for data
            from the field, a pulse or two from each pose. Two sources have ghosts where their lines cross.
        refit_s: Time between fits.
        max_pulses: Pulses of one candidate that a fit uses, evenly chosen; the array limits, not the noise.
        confirm_opening_rad: Lines of sight must have opened by this much: one line of bearings is no fix.
        confirm_semi_major_m: The 95 % ellipse must be no longer than this to confirm.
        confirm_range_m: It must have been heard from within this distance.
        confirm_pulses: And this often. Confirmed findings that lose half of that, or jump by more than `merge_m`, are
            candidates again.
        confirm_presence: Near it and in sight of it, where there is a map, it must have been heard in this share of the
            seconds in which anything was: what comes from a mirror comes to few places.
        echo_presence: Where it is heard in less than this share of them, it is an echo.
        echo_s: If they are so many at least.
        echo_semi_major_m: And its 95 % ellipse is no longer than this: else it may be elsewhere.
        merge_m: Candidates nearer to each other than this are one.
    """

    max_std_rad: float = np.radians(4.0)
    misfit_factor: float = 3.0
    misfit_floor: float = 0.05**2
    assignment: AssignmentRules = field(default_factory=AssignmentRules)
    birth_pulses: int = 6
    birth_s: float = 10.0
    birth_arc_rad: float = np.radians(8.0)
    birth_by_crossing: bool = False
    refit_s: float = 1.0
    max_pulses: int = 160
    confirm_opening_rad: float = np.radians(60.0)
    confirm_semi_major_m: float = 0.5
    confirm_range_m: float = 4.0
    confirm_pulses: int = 20
    confirm_presence: float = 0.3
    echo_presence: float = 0.1
    echo_s: int = 5
    echo_semi_major_m: float = 2.0
    merge_m: float = 1.0


class Locator:
    """Keeps every credible pulse, sorts pulses by candidate, and fits all candidates and the array together.

    Args:
        array: The array's data sheet and spread; never the array that made the data.
        pose_error: How wrong the poses given to `update` may be.
        fence_m: Length of the yard along x and y, origin at the corner; None where there is no fence.
        rules: When sightings count.
        in_sight: What the map of the yard hides; None where there is no map.
    """

    def __init__(
        self,
        array: ArrayModel,
        pose_error: PoseError,
        *,
        fence_m: tuple[float, float] | None = None,
        rules: LocatingRules | None = None,
        in_sight: InSight | None = None,
    ) -> None:
        self.array = array
        self.pose_error = pose_error
        self.fence_m = fence_m
        self.rules = rules or LocatingRules()
        self.findings: tuple[Finding, ...] = ()
        self._n_named = 0
        self._next_fit_s = -np.inf
        self._errors = ElementErrors.none(array.manifold.n_elements)
        self._record = PulseRecord(array, pose_error, self.rules.assignment, in_sight)

    def is_credible(self, pulses: PulseBatch) -> NDArray[np.bool_]:
        """Whether each pulse looks like one plane wave from one direction, strong enough to tell which; shape (n,).

        Pulses that met the end of the converter's scale in a usable channel are not: their strengths are wrong.
        """
        manifold = self.array.manifold
        gain = manifold.gain(pulses.azimuth_rad)
        slope = perpendicular_slope(gain, manifold.derivative(pulses.azimuth_rad))
        by_noise = np.square(pulses.std_rad) * np.square(slope).sum(axis=0) / np.square(gain).sum(axis=0)
        spread = self.array.spread
        by_offset = manifold.n_elements * spread.offset**2 / np.square(gain).sum(axis=0)
        by_array = spread.gain**2 + spread.pointing_rad**2 + by_offset
        expected = by_noise + by_array + self.rules.misfit_floor
        is_plane_wave = pulses.misfit < self.rules.misfit_factor * expected
        return (pulses.std_rad < self.rules.max_std_rad) & is_plane_wave & ~pulses.is_overdriven

    def update(self, time_s: float, pose: FloatArray, pulses: PulseBatch) -> tuple[Finding, ...]:
        """Take in what was detected from one pose; refit all of it once every `refit_s`.

        Args:
            time_s: When.
            pose: Believed x m, y m, yaw rad, world frame, shape (3,).
            pulses: Credible pulses, with their directions; see `is_credible`.

        Returns:
            All findings so far, in the order of their ids.
        """
        if pulses.n_pulses:
            self._record.add(time_s, pose, pulses)
            if time_s >= self._next_fit_s:
                self._next_fit_s = time_s + self.rules.refit_s
                self.refit(time_s)
        return self.findings

    def refit(self, time_s: float) -> tuple[Finding, ...]:
        """Sort and fit all that was heard so far anew, whenever the last time was; all findings."""
        owner = self._assign(self.findings).owner
        counts = [(owner == k).sum() for k in range(len(self.findings))]
        kept = [
            finding for finding, count in zip(self.findings, counts, strict=True) if count >= self.rules.birth_pulses
        ]
        if len(kept) < len(self.findings):
            self.findings = tuple(kept)
            owner = self._assign(self.findings).owner
        owner = self._birth(owner, time_s)
        in_sight = self._assign(self.findings).in_sight
        moved, chosen = list(self.findings), dict[int, NDArray[np.intp]]()
        for k, finding in enumerate(self.findings):
            own = np.flatnonzero(owner == k)
            seen = own[in_sight[own]]
            if seen.size >= self.rules.birth_pulses:
                chosen[k] = self._choose(seen)
            elif own.size >= self.rules.birth_pulses and finding.state != "confirmed":
                position, covariance = self._triangulate(self._choose(own))
                if np.isfinite(covariance).all():
                    moved[k] = replace(finding, position_m=position, covariance_m2=covariance)
        if chosen:
            fix = locate_jointly(
                self._record.pulses.take(index := np.concatenate(list(chosen.values()))),
                self._record.pose[index],
                np.repeat(np.arange(len(chosen)), [index.size for index in chosen.values()]),
                np.array([self._start(self.findings[k], index) for k, index in chosen.items()]),
                self.array,
                self.pose_error,
            )
            self._errors = fix.errors
            for k, position, covariance in zip(chosen, fix.positions_m, fix.covariances_m2, strict=True):
                has_jumped = np.linalg.norm(position - moved[k].position_m) > self.rules.merge_m
                state = "candidate" if has_jumped else moved[k].state
                moved[k] = replace(moved[k], position_m=position, covariance_m2=covariance, state=state)
        self._conclude(moved, time_s)
        return self.findings

    def _choose(self, index: NDArray[np.intp]) -> NDArray[np.intp]:
        """At most `max_pulses` of the rows `index`, evenly."""
        if index.size <= self.rules.max_pulses:
            return index
        return index[np.linspace(0, index.size - 1, self.rules.max_pulses).astype(np.intp)]

    def _assign(self, findings: Sequence[Finding]) -> Assignment:
        return self._record.assign(findings, self._errors)

    def _birth(self, owner: NDArray[np.intp], time_s: float) -> NDArray[np.intp]:
        """Owners with recent loose pulses from one direction given to a new candidate.

        If they cross where a candidate is already, that one is off, not doubled: they become its own.
        """
        loose = np.flatnonzero(owner == UNASSIGNED)
        recent = loose[self._record.pulses.time_s[loose] > time_s - self.rules.birth_s]
        if recent.size < self.rules.birth_pulses:
            return owner
        bearing, _ = self._record.bearings(recent, self._errors)
        near = np.abs(difference(bearing[:, np.newaxis], bearing)) < self.rules.birth_arc_rad
        group = recent[near[near.sum(axis=0).argmax()]]
        if group.size < self.rules.birth_pulses and self.rules.birth_by_crossing:
            some = self._choose(recent)
            group = some[triangulate(self._record.pose[some, :2], *self._record.bearings(some, self._errors)).is_inlier]
        if group.size < self.rules.birth_pulses:
            return owner
        position, covariance = self._triangulate(group)
        owner = owner.copy()
        apart = [float(np.linalg.norm(position - finding.position_m)) for finding in self.findings]
        if apart and min(apart) < self.rules.merge_m:
            owner[group] = int(np.argmin(apart))
            return owner
        self._n_named += 1
        born = Finding(
            id=self._n_named,
            state="candidate",
            position_m=position,
            covariance_m2=covariance if np.isfinite(covariance).all() else np.eye(2) * UNKNOWN_M**2,
            n_bearings=group.size,
            first_heard_s=float(self._record.pulses.time_s[group[0]]),
            fixed_s=None,
            opening_rad=0.0,
            nearest_m=np.inf,
            level_db=np.nan,
        )
        owner[group] = len(self.findings)
        self.findings += (born,)
        return owner

    def _triangulate(self, index: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
        bearing, std = self._record.bearings(index, self._errors)
        from_m = self._record.pose[index, :2]
        fix = triangulate(from_m, bearing, std)
        sight = fix.position_m - from_m[-1]
        return from_m[-1] + sight * min(1.0, FARTHEST_START_M / np.linalg.norm(sight)), fix.covariance_m2

    def _start(self, finding: Finding, index: NDArray[np.intp]) -> FloatArray:
        """Where the joint fit starts: the last position, or a fresh one while that is not worth much."""
        if finding.semi_major_m < 2 * self.rules.merge_m:
            return finding.position_m
        return self._triangulate(index)[0]

    def _conclude(self, moved: Sequence[Finding], time_s: float) -> None:
        """Findings from a joint fit: which are one, who owns what now, and which are confirmed."""
        distinct: list[Finding] = []
        for finding in moved:
            apart = [np.linalg.norm(finding.position_m - other.position_m) for other in distinct]
            if not apart or min(apart) > self.rules.merge_m:
                distinct.append(finding)
        assignment = self._assign(distinct)
        self.findings = tuple(
            self._judge(finding, np.flatnonzero((assignment.owner == k) & assignment.in_sight), assignment, time_s)
            for k, finding in enumerate(distinct)
        )

    def _judge(self, finding: Finding, index: NDArray[np.intp], assignment: Assignment, time_s: float) -> Finding:
        """A finding in the light of the pulses `index` that were heard in sight of it."""
        presence, near_s = self._record.presence(finding, index)
        if self._lies_outside(finding):
            doubt: State = "outside"
        else:
            is_known = finding.semi_major_m < self.rules.echo_semi_major_m and near_s >= self.rules.echo_s
            is_absent = is_known and presence < self.rules.echo_presence
            doubt = "echo" if is_absent and finding.state != "confirmed" else "candidate"
        if index.size == 0:
            return replace(finding, state=doubt)
        sight = self._record.pose[index, :2] - finding.position_m
        finding = replace(
            finding,
            n_bearings=index.size,
            opening_rad=opening(np.arctan2(sight[:, 1], sight[:, 0])),
            nearest_m=float(np.linalg.norm(sight, axis=-1).min()),
            level_db=float(np.quantile(assignment.level_db[index], LEVEL_QUANTILE)),
        )
        if doubt != "candidate":
            return replace(finding, state=doubt)
        rules = self.rules
        is_kept = finding.state == "confirmed" and finding.n_bearings >= rules.confirm_pulses // 2
        if is_kept or (
            finding.opening_rad >= rules.confirm_opening_rad
            and finding.semi_major_m <= rules.confirm_semi_major_m
            and finding.nearest_m <= rules.confirm_range_m
            and finding.n_bearings >= rules.confirm_pulses
            and presence >= rules.confirm_presence
        ):
            fixed_s = finding.fixed_s if finding.fixed_s is not None else time_s
            return replace(finding, state="confirmed", fixed_s=fixed_s)
        return replace(finding, state="candidate")

    def _lies_outside(self, finding: Finding) -> bool:
        """Whether the 95 % ellipse leaves no room inside the fence."""
        if self.fence_m is None:
            return False
        angle = np.linspace(0, 2 * np.pi, 73)
        root = np.linalg.cholesky(CHI2_95 * finding.covariance_m2)
        edge = finding.position_m + np.stack([np.cos(angle), np.sin(angle)], axis=-1) @ root.T
        points = np.concatenate([edge, finding.position_m[np.newaxis]])
        return not bool(np.any(np.all((points >= 0) & (points <= np.asarray(self.fence_m)), axis=-1)))
