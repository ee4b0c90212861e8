"""The Locator, which turns pulses with bearings into findings; docs/explanation/locating.md gives the model."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.special import logit

from dirmusic.angles import aperture, azimuth_of, unit_vector
from dirmusic.array.model import ArrayModel
from dirmusic.arrays import BoolArray, FloatArray, IntArray
from dirmusic.locating.array_estimate import ArrayEstimate
from dirmusic.locating.association import (
    EQUAL_LOSS_DB,
    Association,
    Comparison,
    Level,
    associate,
    compare_groups,
    in_sight_probability,
    likelihoods,
    pooled,
    possible_origin,
    window_shares,
)
from dirmusic.locating.existence import (
    DIFFUSE,
    OCCAM,
    WANDERING,
    Wander,
    image_evidence,
    level_evidence,
    log_ratios,
    pulse_evidence,
    rate_evidence,
)
from dirmusic.locating.finding import Finding, State, reaches95
from dirmusic.locating.initiation import (
    APART_M,
    CANDIDATE_APART_M,
    EXTRA_STD_RAD,
    INITIATION_S,
    OF_MULTIPATH,
    OF_UNEXPLAINED,
    Occupied,
    Search,
    find_crossing,
)
from dirmusic.locating.joint_fit import ErrorLevels, JointEstimate, JointFit, array_prior, nominal_array
from dirmusic.locating.measurement import N_PLACE, Noise
from dirmusic.locating.protocol import LineOfSight, PoseError
from dirmusic.locating.pulse_pairs import compare_pairs
from dirmusic.locating.pulse_pool import ROUNDING, PulsePool, Visibility, choose_evenly
from dirmusic.locating.rules import LocatingRules
from dirmusic.locating.track import NEVER_FITTED, NEVER_TESTED, Evidence, Track, merge
from dirmusic.locating.two_sources import ONE_SOURCE, TwoSources, compare_with_two
from dirmusic.pulses.batch import PulseBatch

INITIAL_LEVELS = ErrorLevels(0.04, 0.05)
"""Error levels from which the first fit starts (assumed). From a smaller pattern error, the fit of an antenna that
differs from its data sheet may end in a local minimum."""

MULTIPATH = 0.08
"""Relative error of strengths by reflections that arrive together with the direct wave, added for the association
(assumed): such pulses still belong to their source, although the fit weights them by a smaller error."""

FITTED_PROBABILITY, LEAST_GROUPS, LEAST_PULSES = 0.1, 2.5, 2.0
"""Least probability with which a group is used in a fit, least sum of these for a fit, and least number of pulses of a
track (assumed)."""

NEAR_M = 5.0
"""Distance below which groups are preferred about equally where only some are used; beyond, preference falls with the
square of the distance, as the information of a bearing about the position does. Assumed: below it, elevations are
large, where patterns are less certain. In a substation with seven sources, errors are 0.06 m and those of heights
0.05 m (root mean squares) with 3 and 5 m, and 0.08 and 0.14 m without preference; in yards, positions hardly change."""

CHANGED_SHARE, CHANGED_RAD = 0.1, np.radians(10.0)
"""Change of the number of groups, and of the aperture, after which a source is fitted again (assumed)."""

UNEXPLAINED_PROBABILITY, LEAST_NEW, LEAST_NEW_SHARE = 0.3, 4, 0.1
"""Probability of any source below which a group may initiate a track, and change of the number of such pulses,
absolute and relative, after which initiation is tried again (assumed)."""

ACTIVE_SHARE = 0.1
"""Share of the pulses of a window above which a source is active there (assumed)."""

LEAST_UNTRIED = 0.5
"""Least share of the pulses of a new track that no deleted track had (assumed): a refuted place is tried again when it
has twice as many pulses, or when a newly confirmed source explains others."""

LEAST_TESTED, MOST_TESTED, TESTED_CHANGE = 10, 500, 1.5
"""Least and largest number of groups of a track that are compared with two sources, and factor by which their number or
that of groups near it rises or falls before they are compared again (assumed); they are, too, when another source has
been confirmed."""

MAX_CANDIDATES, STALE_S, LEAST_EVIDENCE = 4, 15.0, -1.0
"""Number of candidates from which on a new one replaces another; and the age of the last pulse, or the evidence, from
which on a candidate is replaced (assumed)."""

LOCATED_M = 2.0
"""Semi-major axis up to which the map decides whether a track is visible; a larger ellipse reaches around obstacles
(assumed)."""

DOUBT_LOG_ODDS, DOUBT_FACTOR = 0.0, 1.5
"""Log odds below which, and factor of the largest semi-major axis above which, a confirmed finding becomes a candidate
again (assumed)."""

MOST_IN_SIGHT = 0.5
"""Share of the groups near a track that come from poses with the track in sight, up to which they are no reflections
(assumed)."""

ONE_FINDING_M = 2.0
"""Largest distance of two sources that become confirmed as one finding (assumed); farther apart, they are located one
by one. Once it is confirmed, it may be again, because reflections from afar do not change where it is."""

KEPT_OUTSIDE = 0.5
"""Factor of the ellipse and of the evidence with which a track beyond the fence stays there (assumed), so that its
state does not change to and fro."""

REFUTED_LOG_ODDS, REFUTED_WINDOWS, REFUTED_EVIDENCE = -5.0, 6, 0.0
"""Log odds below which a track is deleted once it is tested: silence or an image have that much weight, or it has had
pulses in so many windows and little evidence from them (assumed)."""

THRESHOLD_QUANTILE, THRESHOLD_MARGIN_DB = 0.05, 6.0
"""Quantile of the levels of all pulses that is taken as the threshold of detection, and margin above it from which on a
source is expected to be detected (assumed)."""

FREE_QUANTILE, MOST_WEAKENED_DB, LEAST_RANGE_M = 0.75, 20.0, 0.5
"""Quantile of the levels at 1 m of a track that is taken as that in free sight, largest weakening of its direct wave,
and least range for these levels (assumed). With a quantile of 0.6 or 0.9, ellipses of surveys among equipment without a
map are hardly worse."""

EDGE_M = 0.09
"""Standard deviation of the apparent position, in each direction, of a source whose direct paths all pass close above
an edge, such as a bushing on a tank: waves diffracted there arrive together with the direct one. The likeliest value
for 83 findings at bushings in yards of both parts of the suite; 0.07 and 0.12 m are less likely by factors of 15 and
24."""

SPREAD_DB = (1.5, 8.0)
"""Limits of the estimated spread of levels (assumed)."""


class Detections(NamedTuple):
    """Detections of a source in each second of the mission; every array has shape (n_seconds,).

    Attributes:
        detected: Number of detections.
        possible: Number of detections if the other candidates did not exist.
        expected: Expected number of detections; 0 where the source may be hidden or too weak.
        strongest_db: Level of the strongest pulse at the array, dB relative to 1 V; minus infinity without one.
        range_m: Distance of the array.
        rate_hz: Rate of the detections where the source is visible and active; 0 without detections.
    """

    detected: FloatArray
    possible: FloatArray
    expected: FloatArray
    strongest_db: FloatArray
    range_m: FloatArray
    rate_hz: float


class Listening(NamedTuple):
    """When the array listened, and how well.

    Attributes:
        window: Time window of each second of the mission, shape (n_seconds,).
        second: Number of the second of each group, from 0 on, shape (n,).
        threshold_db: Threshold of detection, dB relative to 1 V.
    """

    window: IntArray
    second: IntArray
    threshold_db: float


class Locator:
    """Locator by expectation maximisation over all pulses of a mission.

    Every `refit_s`, or less often later, it associates all pulses with the tracks (E step), initiates a track where
    unexplained pulses cross, fits positions and array if the association has changed (M step), merges tracks of one
    place, and updates the probability that each exists. The states of the array and the error levels are fitted
    together with confirmed sources, or with the likeliest candidate while none is confirmed.

    Args:
        array: The array's data sheet and spread, and its errors if they are known.
        pose_error: Error of the poses.
        fence_m: Length of the yard along x and y, with the origin at its corner; None without a fence.
        rules: Rules; None for the defaults.
        sight: Transmission along lines of sight according to the map; None without a map.

    Attributes:
        findings: Current findings.
        pose_error: Error of the poses, used in later fits; may be changed if poses prove to be worse.
        estimate: Latest fit of the array; None before the first.
        contradicts_errors: True if the pulses contradicted the known errors of the array, which are then not used.
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
        self.array, self.pose_error, self.fence_m = array, pose_error, fence_m
        self.rules = rules or LocatingRules()
        self.findings: tuple[Finding, ...] = ()
        self.contradicts_errors = False
        self.estimate: JointEstimate | None = None
        self._pool = PulsePool(array, pose_error)
        self._visibility = Visibility(self._pool, sight)
        self._nominal = nominal_array(array)
        self._restart_array()
        self._compared_state, self._compared_levels = self._array_state, self._levels
        self._tracks: list[Track] = []
        self._association = Association(np.empty((0, 0)), np.empty((0, 0)), np.empty((1, 0)))
        self._likelihood: tuple[FloatArray, FloatArray, FloatArray] = np.empty((0, 0)), np.empty((0, 0)), np.empty(0)
        self._window: IntArray = np.empty(0, dtype=np.intp)
        self._is_tried: BoolArray = np.empty(0, dtype=np.bool_)
        self._n_unexplained = np.zeros(2)  # pulses that no source explains, and those that multipath explains
        self._n_initiated, self._n_checked = 0, 0
        self._first_fit_s, self._next_fit_s = np.inf, -np.inf

    def update(self, time_s: float, pose: FloatArray, pulses: PulseBatch) -> tuple[Finding, ...]:
        """Add the pulses that were detected at one pose, and return all current findings; see `LocatorProtocol`."""
        self._pool.add(time_s, pose, pulses)
        if time_s >= self._next_fit_s and (pulses.n_pulses or self._tracks):
            self._first_fit_s = min(self._first_fit_s, time_s)
            since_s = time_s - self._first_fit_s
            self._next_fit_s = time_s + max(self.rules.refit_s, self.rules.refit_share * since_s)
            self._renew(time_s, rounds=1)
        return self.findings

    def refit(self, time_s: float) -> tuple[Finding, ...]:
        """Associate and fit all pulses so far until both agree, check known errors, and return all findings."""
        self._n_checked = 0
        for _ in range(3):
            for track in self._tracks:
                track.fitted = NEVER_FITTED
            self._renew(time_s, rounds=2)
        self._next_fit_s = time_s + self.rules.refit_s
        return self.findings

    def association(self) -> IntArray:
        """Return the id of the likeliest finding of each pulse so far, 0 for none; shape (n_pulses_so_far,)."""
        self._take_pulses()
        finding = np.zeros(self._pool.groups.time_s.size, dtype=np.intp)
        if self._tracks:
            self._window = self._pool.window_of(self._pool.groups.time_s)
            self._expect()
            ids = np.array([track.id for track in self._tracks])
            direct = self._association.direct
            finding = np.where(direct.max(axis=0) > 0.5, ids[direct.argmax(axis=0)], 0)
        return finding[self._pool.group].astype(np.intp)

    def array_estimate(self) -> ArrayEstimate | None:
        """Return the array as estimated together with confirmed findings; None without one."""
        confirmed = [track for track in self._tracks if track.state == "confirmed"]
        if not confirmed or self.estimate is None:
            return None
        return ArrayEstimate.of_fit(self.estimate, sum(track.n_pulses for track in confirmed))

    def _renew(self, time_s: float, rounds: int) -> None:
        """Update all tracks with the pulses so far."""
        self._take_pulses()
        if not self._pool.groups.time_s.size:
            return
        self._window = self._pool.window_of(self._pool.groups.time_s)
        self._expect()
        self._initiate(time_s)
        if any(self._has_changed(track) for track in self._tracks):
            self._maximise(rounds)
            self._expect()
        self._keep(merge(self._tracks, self.rules.merge_m))
        self._split()
        self._judge(time_s)
        self._delete()
        self.findings = tuple(track.finding() for track in self._tracks)

    def _expect(self) -> None:
        """Associate all groups with the tracks; shares of windows are estimated in two rounds."""
        groups, tracks = self._pool.groups, self._tracks
        if not tracks:
            return
        probability = np.full((len(tracks), groups.time_s.size), 0.5)
        for row, track in zip(probability, tracks, strict=True):
            known = track.direct + track.multipath
            row[: known.size] = known[: row.size]
        compared, levels = [self._compare(track) for track in tracks], [track.level for track in tracks]
        is_confirmed = np.array([track.state == "confirmed" for track in tracks])
        self._likelihood = likelihoods(groups, compared, levels, is_confirmed)
        for _ in range(2):
            share = window_shares(probability, groups.n_pulses, self._window)
            self._association = associate(self._likelihood, share)
            probability = self._association.direct + self._association.multipath
        for track, direct, multipath in zip(tracks, self._association.direct, self._association.multipath, strict=True):
            track.direct, track.multipath = direct, multipath

    def _compare(self, track: Track) -> Comparison:
        """Compare groups with a track; earlier results are kept as long as the track has hardly moved."""
        groups = self._pool.groups
        start = min(track.n_compared, groups.time_s.size)
        unexplained = float(np.hypot(self._levels.unexplained, 0.0 if track.twin else MULTIPATH))
        noise = Noise(self.pose_error.position_m, self.pose_error.heading_rad, unexplained)
        later = compare_groups(
            groups.take(slice(start, None)),
            track.position_m,
            self._array_state,
            track.uncertainty,
            self._nominal,
            noise,
            self._transmission(track)[:, groups.place[start:]],
        )
        track.compared = track.compared.take(slice(start)).followed_by(later)
        track.n_compared = self._pool.n_settled
        return track.compared

    def _transmission(self, track: Track) -> FloatArray:
        """Return the transmission from all places to a track at likely heights, shape (n_heights, n_places)."""
        if track.semi_major_m > LOCATED_M:
            return np.ones((1, len(self._pool.places_m)))
        return self._visibility.at_heights(track.position_m, track.height_std_m)

    def _basis(self, track: Track) -> tuple[float, float]:
        """Return the number of groups that a track is fitted to, and their aperture."""
        rows = np.flatnonzero(track.direct > FITTED_PROBABILITY)
        off_m = self._pool.groups.pose[rows, :2] - track.position_m[:2]
        return float(track.direct[rows].sum()), aperture(azimuth_of(off_m))

    def _has_changed(self, track: Track) -> bool:
        (n, aperture_rad), (fitted_n, fitted_rad) = self._basis(track), track.fitted
        return abs(n - fitted_n) > CHANGED_SHARE * fitted_n or abs(aperture_rad - fitted_rad) > CHANGED_RAD

    def _initiate(self, time_s: float) -> None:
        """Initiate a track from pulses that no track explains, or else from those that multipath explains."""
        groups = self._pool.groups
        direct, of_any = np.zeros((2, groups.time_s.size))
        for track in self._tracks:
            direct += track.direct
            of_any += track.direct + track.multipath
        is_unexplained = of_any < UNEXPLAINED_PROBABILITY
        is_multipath = ~is_unexplained & (direct < UNEXPLAINED_PROBABILITY)
        n_unexplained = np.stack((is_unexplained, is_multipath)) @ groups.n_pulses
        recent = groups.time_s > time_s - INITIATION_S
        n_recent = np.stack((is_unexplained & recent, is_multipath & recent)) @ groups.n_pulses
        has_changed = np.abs(n_unexplained - self._n_unexplained) >= np.maximum(LEAST_NEW, LEAST_NEW_SHARE * n_recent)
        if not has_changed.any():
            return
        self._n_unexplained = np.where(has_changed, n_unexplained, self._n_unexplained)
        may_be_multipath = is_multipath.copy()
        for track, share in zip(self._tracks, self._association.share, strict=False):
            if track.state == "confirmed":
                is_weaker = groups.level_db < track.level.limit_db(track.compared.range_m)
                may_be_multipath |= is_weaker & (share > ACTIVE_SHARE)
        occupied = Occupied(
            np.array([track.position_m for track in self._tracks]).reshape(-1, N_PLACE),
            np.array([APART_M if track.state == "confirmed" else CANDIDATE_APART_M for track in self._tracks]),
        )
        search = Search(is_unexplained, may_be_multipath, self._window, time_s, OF_UNEXPLAINED)
        crossing = find_crossing(groups, search, occupied) if has_changed[0] else None
        if crossing is None and has_changed[1]:
            search = search._replace(is_unexplained=is_multipath, significant=OF_MULTIPATH)
            crossing = find_crossing(groups, search, occupied)
        candidates = [track for track in self._tracks if track.state == "candidate"]
        stale = [
            track for track in candidates if track.last_s < time_s - STALE_S or track.evidence.pulses < LEAST_EVIDENCE
        ]
        is_full = len(candidates) >= MAX_CANDIDATES
        if crossing is None or (is_full and not stale):
            return
        is_tried = self._tried()[crossing.rows]
        if groups.n_pulses[crossing.rows] @ ~is_tried < LEAST_UNTRIED * groups.n_pulses[crossing.rows].sum():
            return
        if is_full:
            dropped = min(stale, key=lambda track: track.log_odds)
            self._keep([track for track in self._tracks if track is not dropped])
        uncertainty = np.zeros((N_PLACE + self._array_state.size,) * 2)
        uncertainty[:N_PLACE, :N_PLACE] = crossing.covariance_m2
        uncertainty[N_PLACE:, N_PLACE:] = self._array_covariance
        self._n_initiated += 1
        track = Track(
            id=self._n_initiated,
            position_m=crossing.position_m,
            covariance_m2=crossing.covariance_m2,
            uncertainty=uncertainty,
            initiated_s=time_s,
            first_s=float(groups.time_s[crossing.rows[0]]),
            last_s=float(groups.time_s[crossing.rows[-1]]),
            direct=np.zeros(groups.time_s.size),
            multipath=np.zeros(groups.time_s.size),
        )
        track.direct[crossing.rows] = 1.0
        self._compare(track)
        self._estimate_level(track)
        track.direct[:] = 0.5
        self._tracks.append(track)
        self._expect()
        track.direct[crossing.rows] = 1.0

    def _tried(self) -> BoolArray:
        """Return true for groups that a deleted track had, shape (n,)."""
        n = self._pool.groups.time_s.size
        self._is_tried = np.pad(self._is_tried[:n], (0, max(n - self._is_tried.size, 0)))
        return self._is_tried

    def _take_pulses(self) -> None:
        """Pool the latest pulses; if channels were left out of earlier ones, forget estimates that used these."""
        if self._pool.pool():
            self._restart_array()
            self._is_tried[:] = False
            for track in self._tracks:
                track.n_compared, track.fitted = 0, NEVER_FITTED

    def _restart_array(self) -> None:
        """Forget the estimate of the array."""
        self._levels, prior = INITIAL_LEVELS, array_prior(self.array, INITIAL_LEVELS)
        self._array_state, self._array_covariance = prior.mean, np.linalg.inv(prior.information)
        self._array_tracks: set[int] = set()

    def _maximise(self, rounds: int) -> None:
        """Fit the array together with the best tracks, then each of the others that has changed."""
        tracks = [track for track in self._tracks if self._basis(track)[0] >= LEAST_GROUPS]
        best = [track for track in tracks if track.state == "confirmed"]
        if not best:
            best = sorted((t for t in tracks if t.state == "candidate"), key=lambda t: -t.log_odds)[:1]
        is_new = self.estimate is None or not self._array_tracks & {track.id for track in best}
        if any(is_new or self._has_changed(track) for track in best):
            self._array_tracks = {track.id for track in best}
            self.estimate = self._fit(best, rounds=4 if is_new else rounds, is_new=is_new)
            self.estimate = self._check_known_errors(best, self.estimate)
            n = N_PLACE * len(best)
            self._levels, self._array_state = self.estimate.levels, self.estimate.state[n:]
            self._array_covariance = self.estimate.cautious_covariance[n:, n:]
            self._check_comparisons()
        for track in tracks:
            if track not in best and self._has_changed(track):
                self._fit([track], rounds=0, is_new=False)
        for track in self._tracks:
            self._compare(track)
            self._estimate_level(track)
            track.fitted = self._basis(track)

    def _fit(self, tracks: list[Track], *, rounds: int, is_new: bool) -> JointEstimate:
        """Fit some tracks jointly with the array, from the prior of the array if it is new."""
        rows = [self._choose(track, track.direct, self.rules.max_pulses) for track in tracks]
        groups = self._pool.groups.take(np.concatenate(rows))
        probability = np.concatenate([track.direct[own] for track, own in zip(tracks, rows, strict=True)])
        number = np.repeat(np.arange(len(tracks)), [own.size for own in rows])
        weakening = np.concatenate([self._weakening(track, own) for track, own in zip(tracks, rows, strict=True)])
        fit = JointFit(
            pooled(groups, weakening), groups.level_db, groups.time_s, number, probability, self.array, self.pose_error
        )
        estimate = fit.solve(
            np.array([track.position_m for track in tracks]),
            None if is_new else self._array_state,
            INITIAL_LEVELS if is_new else self._levels,
            rounds,
        )
        n = N_PLACE * len(tracks)
        for k, track in enumerate(tracks):
            states = np.r_[N_PLACE * k : N_PLACE * (k + 1), n : estimate.state.size]
            uncertainty = estimate.cautious_covariance[np.ix_(states, states)]
            position_m, covariance_m2 = estimate.positions_m[k], estimate.covariances_m2[k]
            covariance_m2 = covariance_m2 + self._edge_error(position_m, track.direct, rows[k])
            track.move(position_m, covariance_m2, uncertainty, self.pose_error.position_m)
        return estimate

    def _edge_error(self, position_m: FloatArray, probability: FloatArray, rows: IntArray) -> FloatArray:
        """Return the covariance of an apparent position by waves that are diffracted at edges, shape (3, 3)."""
        is_close = self._visibility.is_close_to_edge(position_m)[self._pool.groups.place[rows]]
        return np.average(is_close, weights=probability[rows]) * EDGE_M**2 * np.eye(N_PLACE)

    def _choose(self, track: Track, probability: FloatArray, n: int) -> IntArray:
        """Choose at most n rows of groups with a sufficient probability (n_groups,); near ones tell more."""
        rows = np.flatnonzero(probability > FITTED_PROBABILITY)
        square_m2 = np.square(self._pool.groups.pose[rows, :2] - track.position_m[:2]).sum(axis=-1)
        return choose_evenly(rows, n, 1.0 / (NEAR_M**2 + square_m2))

    def _weakening(self, track: Track, rows: IntArray) -> FloatArray:
        """Return the factor by which the direct wave of a track is weaker than in free sight, by the level of groups.

        Args:
            track: The track.
            rows: Rows of its groups, shape (n,).

        Returns:
            Factor of 1 or more, shape (n,).
        """
        groups, height_m = self._pool.groups, track.position_m[2] - self._nominal.positions_m[:, 2].mean()
        plan_m = np.linalg.norm(groups.pose[rows, :2] - track.position_m[:2], axis=-1)
        level_db = groups.level_db[rows] + 20.0 * np.log10(np.maximum(np.hypot(plan_m, height_m), LEAST_RANGE_M))
        weaker_db = np.quantile(level_db, FREE_QUANTILE) - level_db
        return 10.0 ** (np.clip(weaker_db, 0.0, MOST_WEAKENED_DB) / 20.0)

    def _check_known_errors(self, tracks: list[Track], estimate: JointEstimate) -> JointEstimate:
        """Stop using known errors of the array if confirmed tracks contradict them; return the estimate to use.

        They are compared with an estimate that does not use them, each time when the number of groups has doubled.
        """
        known, n = self.array.errors, self._pool.groups.time_s.size
        if known is None or n < 2 * self._n_checked or any(track.state != "confirmed" for track in tracks):
            return estimate
        self._n_checked = n
        self.array = replace(self.array, errors=None)
        without = self._fit(tracks, rounds=4, is_new=True)
        self.contradicts_errors = without.errors.contradicts(known)
        if self.contradicts_errors:
            return without
        self.array = replace(self.array, errors=known)
        return self._fit(tracks, rounds=1, is_new=False)

    def _check_comparisons(self) -> None:
        """Compare all groups anew if the array as estimated has changed considerably since they were compared."""
        moved = self._array_state - self._compared_state
        growth = self._levels.unexplained / self._compared_levels.unexplained
        if moved @ np.linalg.solve(self._array_covariance, moved) > 0.05 * moved.size or not 0.8 < growth < 1.25:
            self._compared_state, self._compared_levels = self._array_state, self._levels
            for track in self._tracks:
                track.n_compared = 0

    def _estimate_level(self, track: Track) -> None:
        """Estimate the level of a track by medians, weighted by the precision of level and direction.

        Weak waves that reach the array around equipment come from near the source, but not from one point.
        """
        rows = np.flatnonzero(track.direct > FITTED_PROBABILITY)
        if not rows.size:
            return
        own, groups = track.compared.take(rows), self._pool.groups
        std_rad = np.hypot(groups.std_rad[rows], EXTRA_STD_RAD)
        weight = track.direct[rows] * np.minimum(groups.n_pulses[rows], 5) / np.square(own.level_error_db * std_rad)
        mean_db = weighted_median(own.level_db, weight)
        spread_db = 1.4826 * weighted_median(np.abs(own.level_db - mean_db), weight)
        track.level = Level(mean_db, float(np.clip(spread_db, *SPREAD_DB)))

    def _split(self) -> None:
        """Compare likely tracks with two sources, and split those that certainly are two."""
        sight = unit_vector(self._pool.groups.azimuth_rad + self._pool.groups.pose[:, 2])
        for track in list(self._tracks):
            if track.log_odds <= 0.0 or track.semi_major_m >= LOCATED_M or track.state == "outside":
                continue
            near = self._near(track, sight)
            n_groups = float(track.direct.sum()), float(near.sum())
            change = np.add(n_groups, LEAST_TESTED) / np.add(track.n_tested, LEAST_TESTED)
            if sum(n_groups) < LEAST_TESTED or ((change > 1.0 / TESTED_CHANGE) & (change < TESTED_CHANGE)).all():
                continue
            track.n_tested = n_groups
            place, earlier = (track.position_m, self._array_state, self._nominal), track.two
            by_residuals = self._compare_with_two(track, track.direct, earlier)
            track.two = compare_pairs(self._pool.pairs, self._pool.groups, track.direct, *place, by_residuals)
            if not track.two.is_possible:
                of_both = self._compare_with_two(track, track.direct + near, earlier)
                in_sight = float(near @ track.compared.direct) / max(n_groups[1], 1e-9)
                track.two = of_both._replace(may_be_reflection=in_sight > MOST_IN_SIGHT)
            is_certain = track.two.is_certain if self._is_established(track) else track.two.is_certain_of_candidate
            if is_certain and not track.twin:
                self._split_in_two(track)

    def _compare_with_two(self, track: Track, probability: FloatArray, earlier: TwoSources) -> TwoSources:
        """Compare groups near a track with two sources, if they are enough.

        Args:
            track: The track.
            probability: Probability that each group belongs to it, or to a source near it, shape (n,).
            earlier: Earlier result for it.
        """
        if probability.sum() < LEAST_TESTED:
            return ONE_SOURCE
        rows = self._choose(track, probability, MOST_TESTED)
        groups, place = self._pool.groups.take(rows), (track.position_m, self._array_state, self._nominal)
        return compare_with_two(groups, probability[rows], self._window[rows], *place, self.pose_error, earlier)

    def _near(self, track: Track, sight: FloatArray) -> FloatArray:
        """Return the probability that each group came from no track, but from a source near a track, shape (n,).

        Args:
            track: The track; the source is within `APART_M`.
            sight: Unit vectors from the array along the direction of each group, world frame, shape (n, 2).
        """
        groups, of_tracks = self._pool.groups, track.direct.copy()
        for other in self._tracks:
            if other is not track and self._is_established(other):
                of_tracks += other.direct
        off_m = track.position_m[:2] - groups.pose[:, :2]
        past_m = off_m[:, 0] * sight[:, 1] - off_m[:, 1] * sight[:, 0]
        is_near = (np.abs(past_m) < APART_M) & ((off_m * sight).sum(axis=-1) > 0.0)
        in_sight = in_sight_probability(track.compared, track.level, groups.n_pulses, is_near)
        return np.maximum(in_sight - of_tracks, 0.0)

    def _split_in_two(self, track: Track) -> None:
        """Replace a track by two at its both likely positions."""
        self._n_initiated += 1
        stronger, weaker = np.argsort(-track.two.shares)
        offsets_m = track.two.offsets_m
        twin = replace(
            track,
            id=self._n_initiated,
            twin=track.id,
            position_m=track.position_m + offsets_m[weaker],
            state="candidate",
            confirmed_s=None,
            n_compared=0,
            two=ONE_SOURCE,
            direct=np.full(track.direct.size, 0.5),
            multipath=np.zeros(track.direct.size),
        )
        track.position_m = track.position_m + offsets_m[stronger]
        track.twin, track.n_compared = twin.id, 0
        track.direct = twin.direct.copy()
        self._tracks.append(twin)
        self._restart_array()
        for _ in range(2):
            self._expect()
            self._maximise(rounds=2)
        self._expect()

    def _delete(self) -> None:
        """Delete tracks that are refuted, or that have lost their pulses to others."""
        kept: list[Track] = []
        for track in self._tracks:
            pulses, rate, image = track.evidence
            n_windows = np.unique(self._window[track.direct > 0.5]).size
            is_tested = min(rate, image) < REFUTED_LOG_ODDS or (
                n_windows >= REFUTED_WINDOWS and pulses < REFUTED_EVIDENCE
            )
            is_placed = track.semi_major_m < LOCATED_M or rate < -OCCAM
            is_refuted = track.log_odds < REFUTED_LOG_ODDS and is_tested and is_placed
            n_pulses = float(track.direct @ self._pool.groups.n_pulses)
            if not is_refuted and (n_pulses >= LEAST_PULSES or track.state == "confirmed"):
                kept.append(track)
        self._keep(kept)

    def _keep(self, tracks: list[Track]) -> None:
        """Keep some of the tracks, and associate all groups with them if there were others."""
        if len(tracks) < len(self._tracks):
            for gone in [track for track in self._tracks if track not in tracks]:
                self._tried()[gone.direct > 0.5] = True
                for track in tracks:
                    track.twin = 0 if track.twin == gone.id else track.twin
            self._tracks = sorted(tracks, key=lambda track: track.id)
            self._expect()

    def _judge(self, time_s: float) -> None:
        """Update the odds and the state of each track."""
        groups, window = self._pool.groups, self._pool.window_of(self._pool.listened_s)
        tracks = self._tracks
        for track in tracks:
            self._estimate_level(track)
        if not tracks:
            return
        is_confirmed = np.array([track.state == "confirmed" for track in tracks])
        by_pulses, against_diffuse = self._pulse_evidence(WANDERING), [np.inf] * len(tracks)
        if len(tracks) > 1 and is_confirmed.any():
            against_diffuse = self._pulse_evidence(DIFFUSE)
        possible = possible_origin(self._likelihood, self._association, is_confirmed)
        second = np.searchsorted(self._pool.listened_s, groups.time_s + ROUNDING, side="right") - 1
        listening = Listening(window, np.clip(second, 0, None), float(np.quantile(groups.level_db, THRESHOLD_QUANTILE)))
        observed = {track.id: self._observe(track, own, listening) for track, own in zip(tracks, possible, strict=True)}
        own_odds, by_tries = dict[int, float](), float(np.log(self._n_initiated))  # look-elsewhere effect
        for track, pulses in zip(tracks, by_pulses, strict=True):
            own = observed[track.id]
            is_visible = own.expected > 0.0
            counts = own.expected, own.detected * is_visible, own.possible * is_visible
            rate = rate_evidence(*(np.bincount(window, n).astype(np.float64) for n in counts))
            rate *= not track.twin
            own_odds[track.id] = pulses + rate + level_evidence(track.level) - OCCAM - by_tries
            track.evidence = Evidence(pulses, rate)
        for track, sharp in zip(tracks, against_diffuse, strict=True):
            own, least = observed[track.id], np.inf
            for senior in tracks:
                is_senior = senior.state == "confirmed" and own_odds[senior.id] > own_odds[track.id]
                if is_senior and senior.id != track.twin:
                    other = observed[senior.id]
                    n_pulses = np.maximum(own.detected, 1.0)
                    is_strong = own.strongest_db > senior.level.limit_db(other.range_m, n_pulses)
                    image = image_evidence(
                        window, own.detected, other.detected, other.expected, other.rate_hz, is_strong
                    )
                    least = min(least, track.evidence.rate + level_evidence(track.level) + min(image, sharp))
            track.evidence = track.evidence._replace(image=least)
            track.log_odds = float(-np.logaddexp(-own_odds[track.id], -least))
            self._describe(track, time_s)

    def _pulse_evidence(self, wander: Wander) -> list[float]:
        """Return the log odds of each track by its pulses, against waves that wander."""
        n_pulses = self._pool.groups.n_pulses
        ratios = np.array([log_ratios(track.compared, track.level, n_pulses, wander) for track in self._tracks])
        return pulse_evidence(ratios, self._association, self._window).tolist()

    def _observe(self, track: Track, is_possible: FloatArray, listening: Listening) -> Detections:
        """Count the detections of a track, those that are possible, and those that were to be expected."""
        groups, pool = self._pool.groups, self._pool
        transmission = self._transmission(track)[:, pool.listened].min(axis=0)
        range_m = np.maximum(np.linalg.norm(pool.places_m[pool.listened] - track.position_m, axis=-1), 0.3)
        free_db = track.level.mean_db - 20.0 * np.log10(range_m)
        is_strong = free_db > listening.threshold_db + THRESHOLD_MARGIN_DB
        is_visible = (transmission >= 10.0 ** (-2.0 * EQUAL_LOSS_DB / 20.0)) & is_strong
        is_visible &= track.semi_major_m <= LOCATED_M
        window, second, n_seconds = listening.window, listening.second, pool.listened_s.size
        detected = np.bincount(second, track.direct * groups.n_pulses, n_seconds).astype(np.float64)
        possible = np.bincount(second, is_possible * groups.n_pulses, n_seconds).astype(np.float64)
        n_detected, n_visible = np.bincount(window, detected * is_visible), np.bincount(window, is_visible)
        is_active = n_detected > 0.5
        rate = float(np.median(n_detected[is_active] / n_visible[is_active])) if is_active.any() else 0.0
        strongest_db = np.full(pool.listened_s.size, -np.inf)
        np.maximum.at(strongest_db, second, np.where(track.direct > 0.5, groups.level_db, -np.inf))
        return Detections(detected, possible, np.where(is_visible, rate, 0.0), strongest_db, range_m, rate)

    def _describe(self, track: Track, time_s: float) -> None:
        """Update number, times and aperture of the pulses of a track, and its state."""
        groups, rows = self._pool.groups, np.flatnonzero(track.direct > 0.5)
        if rows.size:
            off_m = groups.pose[rows, :2] - track.position_m[:2]
            track.last_s, track.aperture_rad = float(groups.time_s[rows[-1]]), aperture(azimuth_of(off_m))
            track.nearest_m = float(np.linalg.norm(off_m, axis=-1).min())
            track.n_pulses = int((groups.n_pulses[rows] * track.direct[rows]).sum())
        track.state = self._state(track)
        if track.state == "confirmed" and track.confirmed_s is None:
            track.confirmed_s = time_s
            self._is_tried[:] = False
            for other in self._tracks:
                if other is not track:
                    other.n_tested = NEVER_TESTED

    def _state(self, track: Track) -> State:
        """Return the state of a track; one that is confirmed or beyond the fence has more lenient limits."""
        size = KEPT_OUTSIDE if track.state == "outside" else 1.0
        is_sure = track.evidence.pulses > size * OCCAM or track.evidence.rate < -size * OCCAM
        place = track.position_m[:2], size**2 * track.covariance_m2[:2, :2]
        if is_sure and self.fence_m is not None and not reaches95(*place, np.asarray(self.fence_m)):
            return "outside"
        was_confirmed = track.confirmed_s is not None
        is_one_place = was_confirmed or not track.is_possibly_two or track.two.apart_m <= ONE_FINDING_M
        return "confirmed" if self._is_established(track) and is_one_place else "candidate"

    def _is_established(self, track: Track) -> bool:
        """Return whether a track is probable and located enough to become confirmed, or to stay so."""
        least_odds, longest_m = float(logit(self.rules.confirm_probability)), self.rules.confirm_semi_major_m
        if track.state == "confirmed":
            least_odds, longest_m = DOUBT_LOG_ODDS, DOUBT_FACTOR * longest_m
        is_located = track.semi_major_m <= longest_m and track.aperture_rad >= self.rules.confirm_aperture_rad
        return track.log_odds >= least_odds and is_located


def weighted_median(values: FloatArray, weight: FloatArray) -> float:
    """Return the weighted median of values (n,)."""
    order = np.argsort(values)
    total = np.cumsum(weight[order])
    middle = int(np.count_nonzero(total < 0.5 * total[-1]))
    return float(values[order[min(middle, values.size - 1)]])
