"""Association of each pulse with one finding, or with the reason why it belongs to no finding."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from dirmusic.arrays import BoolArray, FloatArray, IntArray
from dirmusic.locating.finding import Finding
from dirmusic.locating.gating import JudgedPulses, judge_pulses
from dirmusic.locating.pulse_record import PulseRecord, Rows
from dirmusic.locating.rules import AssignmentRules

SAME_M, SAME_DB, SAME_RAD = 0.05, 0.5, np.radians(0.2)
"""Changes of a finding's position, level and bearings up to which its pulses are not compared with it again. Assumed:
less than the errors of poses, the margins of the rules and the standard deviations of bearings."""

LIKELIHOOD_RATIO = 3.0
"""Likelihood ratio of a bearing above which another finding takes a pulse. Assumed: a higher ratio leaves more pulses
unassociated, a lower one gives more of them to the wrong finding."""

MULTIPATH_WINDOW_S = 5.0
"""Length of the windows in which pulses are counted. Assumed: long enough for significant counts, short enough that the
robot does not drive far."""

MULTIPATH_SECTOR_RAD = np.radians(30.0)
"""Width of the sectors in which the multipath of a window is counted (assumed)."""

RATE_QUANTILE = 0.9
"""Quantile of the number of pulses per window that is taken as the rate of a source, over the windows in which it was
detected. Assumed: in most windows, distance or an obstacle hides some of its pulses."""

EXCESS_SIGMAS = 3.0
"""Number of Poisson standard deviations above the expected number of multipath pulses that is too many (assumed)."""

N_PHASE_BINS = 24
"""Bins of a mains period (assumed): 15 degrees, half the width of most clusters of
`dirmusic.pulses.phase_resolved`."""

MIN_PHASE_RATIO = 0.1
"""Ratio of the rate in a phase bin to the mean rate below which a finding does not discharge in that bin. Assumed: at
least 200 pulses are needed to exclude a bin, 9 per bin on average, so a finding that discharges at all phases leaves no
bin this empty."""


class Unassociated(IntEnum):
    """Reason why a pulse belongs to no finding; negative, unlike positions and ids of findings."""

    UNASSIGNED = -1
    """The pulse points to no finding."""
    AMBIGUOUS = -2
    """The pulse points to several findings."""
    BIASED = -3
    """The pulse has the level of a finding in sight but points past it: a reflection in its gate biased the bearing."""
    DIFFRACTED = -4
    """The pulse points to a finding but is too weak for the range: it was diffracted at an edge."""
    ECHO = -5
    """The pulse is multipath: it came, reflected or diffracted, while a finding was obstructed on the map, and was no
    stronger than that finding."""


class Assignment(NamedTuple):
    """The finding that each pulse belongs to; every array has shape (n,), or (n_findings, n) where it says so.

    Attributes:
        finding: Position of the finding in the sequence of findings, or a code of `Unassociated`.
        in_sight: True if the finding nearest to the pulse's bearing was in sight from the place of detection.
        level_db: Level 1 m from each finding that the pulses of this time and direction imply, dB relative to 1 V,
            shape (n_findings, n).
        may_be: True where direction and level are consistent with the finding, shape (n_findings, n).
        is_too_weak: True where the pulse points to a finding that is in sight on the map but is too weak for that
            finding's level: either the pulse was diffracted, or the level is wrong; shape (n_findings, n).
        is_echo: True if the pulse may be multipath of a finding other than its own.
    """

    finding: IntArray
    in_sight: BoolArray
    level_db: FloatArray
    may_be: BoolArray
    is_too_weak: BoolArray
    is_echo: BoolArray


class Judgement(NamedTuple):
    """Comparison of all pulses with one finding, kept while the finding and the known array errors hardly change.

    Attributes:
        finding: The finding at the time of the comparison.
        error_rad: Table of known bearing errors at that time.
        n_settled: Number of leading pulses whose comparison is final.
        pulses: The comparison of all pulses.
    """

    finding: Finding
    error_rad: FloatArray
    n_settled: int
    pulses: JudgedPulses

    def holds_for(self, finding: Finding, error_rad: FloatArray) -> bool:
        """Return whether the comparison is still valid for the current finding and table of bearing errors."""
        then = self.finding
        return (
            then.state == finding.state
            and bool(np.linalg.norm(then.position_m - finding.position_m) <= SAME_M)
            and abs(then.semi_major_m - finding.semi_major_m) <= SAME_M
            and abs(then.height_std_m - finding.height_std_m) <= SAME_M
            and np.isfinite(then.level_db) == np.isfinite(finding.level_db)
            and not abs(then.level_db - finding.level_db) > SAME_DB
            and float(np.abs(self.error_rad - error_rad).max()) <= SAME_RAD
        )


class Assigner:
    """Assigns the pulses of a record to findings.

    Comparisons are kept: new pulses are compared with every finding, earlier pulses only with findings that changed.

    Args:
        record: The pulses.
        rules: Conditions under which a pulse belongs to a finding.
    """

    def __init__(self, record: PulseRecord, rules: AssignmentRules) -> None:
        self._record = record
        self._rules = rules
        self._judged: dict[int, Judgement] = {}
        self._assigned = self._combined(())

    def assign(self, findings: Sequence[Finding], error_rad: FloatArray) -> Assignment:
        """Assign all pulses so far.

        Args:
            findings: Current findings.
            error_rad: Table of known bearing errors, see `PulseRecord.error_table`.
        """
        has_changed = [finding.id for finding in findings] != list(self._judged)
        has_changed |= self._assigned.finding.size != self._record.n_pulses
        judged: dict[int, Judgement] = {}
        for finding in findings:
            known = self._judged.get(finding.id)
            if known is None or not known.holds_for(finding, error_rad):
                has_changed = True
                pulses = judge_pulses(self._record, slice(0, None), finding, error_rad, self._rules)
                known = Judgement(finding, error_rad, self._record.n_settled, pulses)
            elif known.pulses.level_db.size != self._record.n_pulses:
                rows = slice(known.n_settled, None)
                latest = judge_pulses(self._record, rows, known.finding, known.error_rad, self._rules)
                pulses = known.pulses.continued(known.n_settled, latest)
                known = known._replace(n_settled=self._record.n_settled, pulses=pulses)
            judged[finding.id] = known
        self._judged = judged
        if has_changed:
            self._assigned = self._combined(findings)
        return self._assigned

    def _combined(self, findings: Sequence[Finding]) -> Assignment:
        """Combine the comparisons with all findings into one assignment.

        The order of the steps matters. First, a pulse that is in the gate of exactly one finding belongs to it. Then
        pulses that may be multipath of a confirmed finding are taken out, biased ones first. If there are more of them
        than there are missing direct pulses of confirmed findings, another source must be among them, and they keep the
        finding that their direction gives.
        """
        n = self._record.n_pulses
        if not findings or n == 0:
            return Assignment(
                finding=np.full(n, Unassociated.UNASSIGNED, dtype=np.intp),
                in_sight=np.ones(n, dtype=np.bool_),
                level_db=np.full((len(findings), n), np.nan),
                may_be=np.empty((len(findings), n), dtype=np.bool_),
                is_too_weak=np.empty((len(findings), n), dtype=np.bool_),
                is_echo=np.zeros(n, dtype=np.bool_),
            )
        confirmed = np.array([finding.state == "confirmed" for finding in findings])
        judged = JudgedPulses.stacked([judgement.pulses for judgement in self._judged.values()])
        judged = self._judged_by_phase(judged, confirmed)
        judged = self._judged_by_likelihood(judged, confirmed)
        nearest, each = judged.offset_sigmas.argmin(axis=0), np.arange(n)
        in_gate = judged.offset_sigmas <= self._rules.gate_sigmas
        n_gates = in_gate.sum(axis=0)
        in_sight = judged.is_direct[nearest, each]
        is_confirmed = confirmed[nearest]
        one_gate = np.where(n_gates == 1, nearest, Unassociated.UNASSIGNED)
        in_one_gate = np.where(n_gates > 1, Unassociated.AMBIGUOUS, one_gate)

        is_of_another = ~is_confirmed & (judged.is_biased.sum(axis=0) > judged.is_biased[nearest, each])
        is_biased = judged.is_biased.any(axis=0) & ((n_gates == 0) | ((n_gates == 1) & is_of_another))
        without_biased = np.where(is_biased, Unassociated.BIASED, in_one_gate)
        is_biased &= ~self._outnumber_multipath(is_biased, without_biased, confirmed)
        by_direction = np.where(is_biased, Unassociated.BIASED, in_one_gate)

        is_ghost = judged.is_ghost.any(axis=0) & ~(is_confirmed & in_sight & (n_gates > 0))
        by_path = np.where(judged.is_diffracted.any(axis=0), Unassociated.DIFFRACTED, Unassociated.ECHO)
        without_ghosts = np.where(is_ghost, by_path, by_direction)
        is_of_others = judged.is_ghost.sum(axis=0) > judged.is_ghost[nearest, each]
        is_source = self._outnumber_multipath(is_of_others | (is_ghost & is_confirmed), without_ghosts, confirmed)
        is_source &= ~judged.is_ghost[~confirmed].any(axis=0)
        return Assignment(
            finding=np.where(is_source, by_direction, without_ghosts),
            in_sight=in_sight,
            level_db=judged.level_db,
            may_be=in_gate & judged.is_direct,
            is_too_weak=judged.is_diffracted & judged.is_direct,
            is_echo=is_of_others & ~is_source,
        )

    def _judged_by_likelihood(self, judged: JudgedPulses, confirmed: BoolArray) -> JudgedPulses:
        """Take pulses out of the gate of a finding if another finding makes their bearing much likelier.

        The gate of a poorly located candidate contains every direction, which would make the pulses of all other
        findings ambiguous. Confirmed findings are compared only with confirmed findings, and candidates only with
        candidates: a confirmed finding is located best, and would take all pulses of a new source next to it.

        Args:
            judged: Pulses judged by direction, level and phase.
            confirmed: True for confirmed findings, shape (n_findings,).
        """
        in_gate = judged.offset_sigmas <= self._rules.gate_sigmas
        offset_sigmas, log_likelihood = judged.offset_sigmas.copy(), np.where(in_gate, judged.log_likelihood, -np.inf)
        for among in (np.flatnonzero(confirmed), np.flatnonzero(~confirmed)):
            if among.size > 1:
                least = log_likelihood[among].max(axis=0) - np.log(LIKELIHOOD_RATIO)
                offset_sigmas[among] = np.where(log_likelihood[among] < least, np.inf, offset_sigmas[among])
        return judged._replace(offset_sigmas=offset_sigmas)

    def _judged_by_phase(self, judged: JudgedPulses, confirmed: BoolArray) -> JudgedPulses:
        """Rule out findings that do not discharge at the mains phase of a pulse.

        If several findings lie in one direction, those that do not discharge at the phase of a pulse are not its
        source. Nor is a pulse multipath of a confirmed finding that does not discharge at its phase. If a pulse points
        to one finding only, that finding keeps it at any phase: some kinds of discharge are weaker in one half cycle,
        and the pulses of that half cycle are detected at short range only.

        Args:
            judged: Pulses judged by direction and level.
            confirmed: True for confirmed findings, shape (n_findings,).
        """
        in_gate = judged.offset_sigmas <= self._rules.gate_sigmas
        n_gates, is_ghost = in_gate.sum(axis=0), judged.is_ghost.any(axis=0)
        if not (is_ghost | (n_gates > 1)).any():
            return judged
        is_sure = (n_gates == 1) & ~is_ghost
        surely = np.where(is_sure, in_gate.argmax(axis=0), Unassociated.UNASSIGNED)
        may_be = may_share_phase(self._record.pulses.mains_phase_rad, surely, confirmed.size)
        leaves_one = (in_gate & may_be).any(axis=0)
        return judged._replace(
            offset_sigmas=np.where(in_gate & ~may_be & leaves_one, np.inf, judged.offset_sigmas),
            is_ghost=judged.is_ghost & (may_be | ~confirmed[:, np.newaxis] | judged.is_diffracted),
        )

    def _outnumber_multipath(self, is_suspect: BoolArray, finding: Rows, confirmed: BoolArray) -> BoolArray:
        """Return which suspected multipath pulses are too many to come from confirmed findings, shape (n,)."""
        number = np.append(np.where(confirmed, np.cumsum(confirmed) - 1, -1), -1)  # among the confirmed ones
        return too_many_for_multipath(
            self._record.elapsed_s,
            self._record.pulses.azimuth_rad + self._record.pose[:, 2],
            is_suspect & ~self._record.is_from_above,
            number[np.maximum(finding, -1)],
            int(confirmed.sum()),
        )


def too_many_for_multipath(
    time_s: FloatArray, bearing_rad: FloatArray, is_suspect: BoolArray, source: IntArray, n_sources: int
) -> BoolArray:
    r"""Return which pulses came from one direction in greater number than the multipath of known sources can explain.

    Each discharge is detected once, either on its direct path or as multipath. If :math:`\lambda_k` pulses of source k
    are expected in a window and :math:`n_k` of them came on the direct path, all sources together leave at most
    :math:`b = \sum_k \max(\lambda_k - n_k, 0)` multipath pulses. If a sector has :math:`n > b + 3 \sqrt{b + 1}`
    suspected multipath pulses, another source is among them.

    The number of multipath pulses has a Poisson distribution with a mean of at most b. The 1 keeps its tail below 0.4 %
    for small b. With :math:`\sqrt{b}` instead, a single stray pulse would count as another source at b = 0, and so
    would one window in 100 at b = 0.1.

    Args:
        time_s: Time of each pulse, shape (n,).
        bearing_rad: Bearing of each pulse, world frame, shape (n,).
        is_suspect: True if a pulse may be multipath of one of these sources, shape (n,).
        source: Source of each direct pulse, in [0, n_sources); any negative number for other pulses; shape (n,).
        n_sources: Number of sources.

    Returns:
        Shape (n,); False for pulses that are not suspects.
    """
    if n_sources == 0 or not is_suspect.any():
        return np.zeros(time_s.size, dtype=np.bool_)
    window = np.unique(time_s // MULTIPATH_WINDOW_S, return_inverse=True)[1]  # empty windows do not count
    n_windows, n_sectors = int(window.max()) + 1, round(2 * np.pi / MULTIPATH_SECTOR_RAD)
    rows = np.flatnonzero(is_suspect)
    cell = window[rows] * n_sectors
    cell += (np.mod(bearing_rad[rows], 2 * np.pi) // MULTIPATH_SECTOR_RAD).astype(np.intp) % n_sectors
    n_alike = np.bincount(cell)[cell]
    too_many = np.zeros(time_s.size, dtype=np.bool_)
    if n_alike.max() <= EXCESS_SIGMAS:  # too few for any b
        return too_many
    has_source = source >= 0
    direct = np.bincount(source[has_source] * n_windows + window[has_source], minlength=n_sources * n_windows)
    direct = direct.reshape(n_sources, n_windows)
    rising, n_empty = np.sort(direct, axis=1), (direct == 0).sum(axis=1)
    at = n_empty + (RATE_QUANTILE * (n_windows - 1 - n_empty)).astype(np.intp)
    expected = np.where(n_empty < n_windows, rising[np.arange(n_sources), np.minimum(at, n_windows - 1)], np.inf)
    most = np.maximum(expected[:, np.newaxis] - direct, 0.0).sum(axis=0)
    too_many[rows] = n_alike > (most + EXCESS_SIGMAS * np.sqrt(most + 1.0))[window[rows]]
    return too_many


def may_share_phase(phase_rad: FloatArray, source: IntArray, n_findings: int) -> BoolArray:
    r"""Return whether each pulse may have come from each finding, given the mains phases of the finding's sure pulses.

    If :math:`c_b` of the n sure pulses of a finding are in bin b, smoothed over the adjacent bins, pulses of that phase
    are excluded if :math:`c_b + 1 < 0.1 (n / 24 + 1)`. The 1 is assumed: it allows for stray pulses, and a small number
    of pulses excludes nothing.

    Args:
        phase_rad: Phase of the mains at each pulse, in [0, 2 pi), shape (n,); NaN where it was not recorded. Pulses
            without a phase are never excluded.
        source: Finding that each pulse surely came from, in [0, n_findings); any negative number if unsure; shape (n,).
        n_findings: Number of findings.

    Returns:
        Shape (n_findings, n).
    """
    is_known = np.isfinite(phase_rad)
    slot = (np.where(is_known, phase_rad, 0.0) * (N_PHASE_BINS / (2 * np.pi))).astype(np.intp) % N_PHASE_BINS
    sure = is_known & (source >= 0)
    counts = np.bincount(source[sure] * N_PHASE_BINS + slot[sure], minlength=n_findings * N_PHASE_BINS)
    counts = counts.reshape(n_findings, N_PHASE_BINS).astype(np.float64)
    smooth = 0.5 * counts + 0.25 * (np.roll(counts, 1, axis=1) + np.roll(counts, -1, axis=1))
    ratio = (smooth + 1.0) / (counts.mean(axis=1, keepdims=True) + 1.0)
    return (ratio >= MIN_PHASE_RATIO)[:, slot] | ~is_known
