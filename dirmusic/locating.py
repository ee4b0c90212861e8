"""Locator: the one place that turns bearings into findings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dirmusic.angles import difference, opening
from dirmusic.bearing import Bearings
from dirmusic.bounds import manifold_error, manifold_error_std, perpendicular_slope
from dirmusic.element_errors import ElementErrors
from dirmusic.joint_fix import ArrayModel, PoseError, Sightings, locate_jointly
from dirmusic.triangulation import triangulate

FloatArray = NDArray[np.float64]
State = Literal["candidate", "confirmed", "outside"]

CHI2_95 = 5.991
"""95 % quantile of chi-square with two degrees of freedom."""

NEAR_FIELD_SHARE = 0.5
"""Share of the ring's radius by which a far-field bearing may miss a source close by (assumed)."""

FARTHEST_START_M = 60.0
"""Lines of sight that cross further away are taken to cross here, to start the fit (assumed)."""

UNKNOWN_M = 10.0
"""Standard deviation of a position of which only the bearing is known, until the first fit (assumed)."""

UNASSIGNED, AMBIGUOUS = -1, -2


@dataclass(frozen=True, kw_only=True)
class LocatingRules:
    """When sightings count, belong together, make a candidate, and confirm it. All values are assumed.

    Attributes:
        max_std_rad: A pulse with a wider bearing is not credible; noise triggers are wider by far.
        misfit_factor: A pulse is not credible if no direction explains its strengths to this many times what noise, the
            array's spread and `misfit_floor` explain.
        misfit_floor: Share of the energy that the far-field model of a perfect array leaves unexplained close by.
        gate_sigmas: How far from a candidate a bearing may point and still belong to it.
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
        confirm_pulses: And this often.
        merge_m: Candidates nearer to each other than this are one.
    """

    max_std_rad: float = np.radians(4.0)
    misfit_factor: float = 9.0
    misfit_floor: float = 0.05**2
    gate_sigmas: float = 3.0
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
    merge_m: float = 1.0


@dataclass(frozen=True, kw_only=True)
class Finding:
    """A discharge as located so far.

    Attributes:
        id: Stays with it through the mission; counts from 1.
        state: `candidate` until the rules confirm it; `outside` where its 95 % ellipse lies beyond the fence.
        position_m: Shape (2,), world frame.
        covariance_m2: Shape (2, 2), the array's common error included.
        n_bearings: Pulses that belong to it.
        first_heard_s: When its first pulse came.
        fixed_s: When it was first confirmed, or None.
        opening_rad: Angle by which the lines of sight have opened, as seen from the finding.
        nearest_m: Least distance from which it was heard.
    """

    id: int
    state: State
    position_m: FloatArray
    covariance_m2: FloatArray
    n_bearings: int
    first_heard_s: float
    fixed_s: float | None
    opening_rad: float
    nearest_m: float

    @property
    def semi_major_m(self) -> float:
        """Longer half-axis of the 95 % ellipse."""
        return float(np.sqrt(CHI2_95 * np.linalg.eigvalsh(self.covariance_m2)[-1]))


class Locator:
    """Keeps every credible pulse, sorts pulses by candidate, and fits all candidates and the array together.

    Args:
        array: The array's data sheet and spread; never the array that made the data.
        pose_error: How wrong the poses given to `update` may be.
        fence_m: Length of the yard along x and y, origin at the corner; None where there is no fence.
        rules: When sightings count.
    """

    def __init__(
        self,
        array: ArrayModel,
        pose_error: PoseError,
        *,
        fence_m: tuple[float, float] | None = None,
        rules: LocatingRules | None = None,
    ) -> None:
        self.array = array
        self.pose_error = pose_error
        self.fence_m = fence_m
        self.rules = rules or LocatingRules()
        self.findings: tuple[Finding, ...] = ()
        self._n_named = 0
        self._next_fit_s = -np.inf
        n_elements = array.manifold.n_elements
        self._aperture_m = float(np.linalg.norm(array.positions_m[:, :2], axis=-1).max())
        self._errors = ElementErrors.none(n_elements)
        self._sightings = Sightings(np.empty(0), np.empty((0, 3)), *(np.empty((0, n_elements)) for _ in range(2)))
        self._azimuth_rad = np.empty(0)
        self._std_rad = np.empty(0)

    def is_credible(self, bearings: Bearings) -> NDArray[np.bool_]:
        """Whether each pulse looks like one plane wave from one direction, strong enough to tell which; shape (...)."""
        manifold = self.array.manifold
        azimuth = np.nan_to_num(bearings.azimuth_rad)
        gain = manifold.gain(azimuth)
        slope = perpendicular_slope(gain, manifold.derivative(azimuth))
        by_noise = np.square(bearings.std_rad) * np.square(slope).sum(axis=0) / np.square(gain).sum(axis=0)
        spread = self.array.spread
        by_offset = manifold.n_elements * spread.offset**2 / np.square(gain).sum(axis=0)
        by_array = spread.gain**2 + spread.pointing_rad**2 + by_offset
        expected = by_noise + by_array + self.rules.misfit_floor
        return (bearings.std_rad < self.rules.max_std_rad) & (bearings.misfit < self.rules.misfit_factor * expected)

    def update(
        self,
        time_s: float,
        pose: FloatArray,
        bearings: Bearings,
        strengths: FloatArray,
        strength_variance: FloatArray,
    ) -> tuple[Finding, ...]:
        """Take in what was heard from one pose; look again at all that was heard, once every `refit_s`.

        Args:
            time_s: When.
            pose: Believed x m, y m, yaw rad, world frame, shape (3,).
            bearings: One per pulse, shape (n_pulses,), array frame.
            strengths: Shape (n_pulses, n_elements), volts.
            strength_variance: Of those, shape (n_pulses, n_elements), V^2.

        Returns:
            All findings so far, in the order of their ids.
        """
        credible = np.flatnonzero(self.is_credible(bearings))
        if credible.size:
            norm = np.linalg.norm(strengths[credible], axis=-1, keepdims=True)
            new = (
                np.full(credible.size, time_s),
                np.tile(pose, (credible.size, 1)),
                strengths[credible] / norm,
                strength_variance[credible] / norm**2,
            )
            self._sightings = Sightings(*(np.concatenate(pair) for pair in zip(self._sightings, new, strict=True)))
            self._azimuth_rad = np.concatenate([self._azimuth_rad, bearings.azimuth_rad[credible]])
            self._std_rad = np.concatenate([self._std_rad, bearings.std_rad[credible]])
        if time_s >= self._next_fit_s and credible.size:
            self._next_fit_s = time_s + self.rules.refit_s
            self.look_again(time_s)
        return self.findings

    def look_again(self, time_s: float) -> tuple[Finding, ...]:
        """Sort and fit all that was heard so far anew, whenever the last time was; all findings."""
        owner = self._assign(self.findings)
        counts = [(owner == k).sum() for k in range(len(self.findings))]
        kept = [
            finding
            for finding, count in zip(self.findings, counts, strict=True)
            if finding.state == "confirmed" or count >= self.rules.birth_pulses
        ]
        if len(kept) < len(self.findings):
            self.findings = tuple(kept)
            owner = self._assign(self.findings)
        owner = self._birth(owner, time_s)
        chosen = {k: self._choose(np.flatnonzero(owner == k)) for k in range(len(self.findings))}
        fitted = [k for k, index in chosen.items() if index.size >= self.rules.birth_pulses]
        if not fitted:
            return self.findings
        fix = locate_jointly(
            self._sightings.take(np.concatenate([chosen[k] for k in fitted])),
            np.repeat(np.arange(len(fitted)), [chosen[k].size for k in fitted]),
            np.array([self._start(self.findings[k], chosen[k]) for k in fitted]),
            self.array,
            self.pose_error,
        )
        self._errors = fix.errors
        moved = list(self.findings)
        for k, position, covariance in zip(fitted, fix.positions_m, fix.covariances_m2, strict=True):
            moved[k] = replace(moved[k], position_m=position, covariance_m2=covariance)
        self._conclude(moved, time_s)
        return self.findings

    def _choose(self, index: NDArray[np.intp]) -> NDArray[np.intp]:
        """At most `max_pulses` of the rows `index`, evenly."""
        if index.size <= self.rules.max_pulses:
            return index
        return index[np.linspace(0, index.size - 1, self.rules.max_pulses).astype(np.intp)]

    def _bearings(self, index: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
        """World bearings of sightings with the array's known error taken out, and their deviation with what is left."""
        azimuth, manifold = self._azimuth_rad[index], self.array.manifold
        error = manifold_error(manifold, azimuth, self._errors)
        common = manifold_error_std(manifold, azimuth, self.array.spread)
        variance = self._std_rad[index] ** 2 + common**2 + self.pose_error.heading_rad**2
        return azimuth - error + self._sightings.pose[index, 2], np.sqrt(variance)

    def _assign(self, findings: Sequence[Finding]) -> NDArray[np.intp]:
        """For each sighting the position in `findings` it belongs to, or UNASSIGNED, or AMBIGUOUS; shape (n,)."""
        n = self._azimuth_rad.size
        if not findings:
            return np.full(n, UNASSIGNED)
        bearing, std = self._bearings(np.arange(n))
        off = np.empty((len(findings), n))
        for k, finding in enumerate(findings):
            sight = finding.position_m - self._sightings.pose[:, :2]
            range_m = np.maximum(np.linalg.norm(sight, axis=-1), 0.3)
            across = np.stack([-sight[:, 1], sight[:, 0]], axis=-1) / range_m[:, np.newaxis]
            spread_m2 = np.einsum("ni,ij,nj->n", across, finding.covariance_m2, across)
            spread_m2 += self.pose_error.position_m**2 + (NEAR_FIELD_SHARE * self._aperture_m) ** 2
            allowed = np.sqrt(std**2 + np.minimum(spread_m2 / range_m**2, np.radians(15.0) ** 2))
            off[k] = np.abs(difference(bearing, np.arctan2(sight[:, 1], sight[:, 0]))) / allowed
        owner = off.argmin(axis=0)
        owner[off.min(axis=0) > self.rules.gate_sigmas] = UNASSIGNED
        owner[(off < self.rules.gate_sigmas).sum(axis=0) > 1] = AMBIGUOUS
        return owner

    def _birth(self, owner: NDArray[np.intp], time_s: float) -> NDArray[np.intp]:
        """Owners with recent loose pulses from one direction given to a new candidate.

        If they cross where a candidate is already, that one is off, not doubled: they become its own.
        """
        loose = np.flatnonzero(owner == UNASSIGNED)
        recent = loose[self._sightings.time_s[loose] > time_s - self.rules.birth_s]
        if recent.size < self.rules.birth_pulses:
            return owner
        bearing, _ = self._bearings(recent)
        near = np.abs(difference(bearing[:, np.newaxis], bearing)) < self.rules.birth_arc_rad
        group = recent[near[near.sum(axis=0).argmax()]]
        if group.size < self.rules.birth_pulses and self.rules.birth_by_crossing:
            some = self._choose(recent)
            group = some[triangulate(self._sightings.pose[some, :2], *self._bearings(some)).is_inlier]
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
            first_heard_s=float(self._sightings.time_s[group[0]]),
            fixed_s=None,
            opening_rad=0.0,
            nearest_m=np.inf,
        )
        owner[group] = len(self.findings)
        self.findings += (born,)
        return owner

    def _triangulate(self, index: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
        bearing, std = self._bearings(index)
        from_m = self._sightings.pose[index, :2]
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
        owner = self._assign(distinct)
        self.findings = tuple(
            self._judge(finding, np.flatnonzero(owner == k), time_s) for k, finding in enumerate(distinct)
        )

    def _judge(self, finding: Finding, index: NDArray[np.intp], time_s: float) -> Finding:
        if index.size == 0:
            return finding
        sight = self._sightings.pose[index, :2] - finding.position_m
        finding = replace(
            finding,
            n_bearings=index.size,
            opening_rad=opening(np.arctan2(sight[:, 1], sight[:, 0])),
            nearest_m=float(np.linalg.norm(sight, axis=-1).min()),
        )
        if self._lies_outside(finding):
            return replace(finding, state="outside")
        rules = self.rules
        if finding.state == "confirmed" or (
            finding.opening_rad >= rules.confirm_opening_rad
            and finding.semi_major_m <= rules.confirm_semi_major_m
            and finding.nearest_m <= rules.confirm_range_m
            and finding.n_bearings >= rules.confirm_pulses
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
