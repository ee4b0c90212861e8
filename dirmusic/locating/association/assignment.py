"""Decision: the one finding that each pulse belongs to, or why it belongs to none."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.element_errors import ElementErrors
from dirmusic.locating.association.echo_budget import too_many_for_echoes
from dirmusic.locating.association.gating import gate_pulses
from dirmusic.locating.association.ghost_test import judge_paths
from dirmusic.locating.association.mains_phase import may_share_phase
from dirmusic.locating.association.pulse_record import PulseRecord
from dirmusic.locating.finding import Finding
from dirmusic.locating.rules import AssignmentRules

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

ALIKE_M, ALIKE_DB = 0.05, 0.5
"""A finding that moved no further, and is known and loud as before to so much, has the same pulses (assumed): that is
less than the errors of the poses, and than the margins of the rules."""


MUCH_LIKELIER = 3.0
"""So many times as likely a bearing must be by another finding for the pulse to be no longer a finding's own (assumed):
more leaves more pulses to nobody, less gives more of them to the wrong one."""


class NoOwner(IntEnum):
    """Why a pulse belongs to no finding; negative, so that no code is the position or the id of a finding."""

    UNASSIGNED = -1
    """It points to no finding."""
    AMBIGUOUS = -2
    """It points to several findings."""
    BIASED = -3
    """It is as loud as a finding in sight and points past it: a reflection within the gate has biased its bearing."""
    DIFFRACTED = -4
    """It points to a finding and is too weak for the range: it came round an edge."""
    ECHO = -5
    """It came while the map obstructs a finding, no louder than that: from a reflector, or round an edge."""


class Assignment(NamedTuple):
    """The finding that each pulse belongs to; every array has shape (n,), or (n_findings, n) where it says so.

    Attributes:
        owner: Position of the finding in the sequence of findings, or a code of `NoOwner`.
        in_sight: Whether the finding that the pulse points to best was in sight from where it was detected.
        level_db: Level 1 m from each finding that pulses of this time and direction mean, dB over 1 V, shape
            (n_findings, n).
        may_be: Whether the pulse may be each finding's own as far as direction and level tell, of several it may be,
            shape (n_findings, n).
        is_too_weak: Whether the pulse points to each finding that the map has in sight, and is too weak for its level:
            it came round an edge, or the level is not the finding's, shape (n_findings, n).
        is_echo: Whether the pulse may be an echo of another finding than its owner.
    """

    owner: NDArray[np.intp]
    in_sight: BoolArray
    level_db: FloatArray
    may_be: BoolArray
    is_too_weak: BoolArray
    is_echo: BoolArray


class JudgedPulses(NamedTuple):
    """Pulses as seen by one finding; every array has shape (n,).

    Attributes:
        offset_sigmas: As of `Gate`; infinite for what was diffracted.
        log_likelihood: As of `Gate`.
        level_db: As of `Gate`.
        is_direct: As of `Paths`.
        is_ghost: As of `Paths`.
        is_diffracted: As of `Paths`.
        is_biased: As of `Paths`.
    """

    offset_sigmas: FloatArray
    log_likelihood: FloatArray
    level_db: FloatArray
    is_direct: BoolArray
    is_ghost: BoolArray
    is_diffracted: BoolArray
    is_biased: BoolArray

    @classmethod
    def stacked(cls, judged: Sequence[Self]) -> Self:
        """Those of several findings, every array of shape (n_findings, n)."""
        columns: list[Any] = [np.array(column) for column in zip(*judged, strict=True)]
        return cls(*columns)

    def continued(self, n: int, later: JudgedPulses) -> JudgedPulses:
        """The first n of these, and after them later ones."""
        columns: list[Any] = [np.concatenate([column[:n], more]) for column, more in zip(self, later, strict=True)]
        return JudgedPulses(*columns)


class Judgement(NamedTuple):
    """What a finding's judgement of all pulses was made of.

    Attributes:
        finding: As it stood then.
        errors: Of the array's elements, as known then.
        n_settled: So many of the first pulses would be judged alike again.
        pulses: All there were.
    """

    finding: Finding
    errors: ElementErrors
    n_settled: int
    pulses: JudgedPulses


class Assigner:
    """Assigns the pulses of a record to findings.

    What was judged is kept: the pulses so far are judged anew by a finding that is not what it was, the latest by all.

    Args:
        record: The pulses.
        rules: When a pulse belongs to a finding.
    """

    def __init__(self, record: PulseRecord, rules: AssignmentRules) -> None:
        self._record = record
        self._rules = rules
        self._judged: dict[int, Judgement] = {}
        self._assigned = self._assigned_anew(())
        self._made_of: list[object] = []

    def assign(self, findings: Sequence[Finding], errors: ElementErrors) -> Assignment:
        """Assign all pulses so far.

        Args:
            findings: The findings as they stand.
            errors: Errors of the array's elements as known by now.
        """
        self._judged = {finding.id: self._judge(finding, errors) for finding in findings}
        made_of: list[object] = [self._record.pulses, *self._judged.values()]
        if len(made_of) != len(self._made_of) or any(a is not b for a, b in zip(made_of, self._made_of, strict=True)):
            self._assigned, self._made_of = self._assigned_anew(findings), made_of
        return self._assigned

    def _assigned_anew(self, findings: Sequence[Finding]) -> Assignment:
        """All pulses by what was judged of them."""
        n = self._record.pulses.n_pulses
        if not findings or n == 0:
            return Assignment(
                owner=np.full(n, NoOwner.UNASSIGNED, dtype=np.intp),
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
        is_of_another = ~is_confirmed & (judged.is_biased.sum(axis=0) > judged.is_biased[nearest, each])
        is_biased = judged.is_biased.any(axis=0) & ((n_gates == 0) | ((n_gates == 1) & is_of_another))
        in_one_gate = np.where(n_gates > 1, NoOwner.AMBIGUOUS, np.where(n_gates == 1, nearest, NoOwner.UNASSIGNED))
        is_biased &= ~self._outnumber_other_paths(
            is_biased, np.where(is_biased, NoOwner.BIASED, in_one_gate), confirmed
        )
        by_direction = np.where(is_biased, NoOwner.BIASED, in_one_gate)
        is_ghost = judged.is_ghost.any(axis=0) & ~(is_confirmed & in_sight & (n_gates > 0))
        by_path = np.where(judged.is_diffracted.any(axis=0), NoOwner.DIFFRACTED, NoOwner.ECHO)
        owner = np.where(is_ghost, by_path, by_direction)
        is_of_others = judged.is_ghost.sum(axis=0) > judged.is_ghost[nearest, each]
        is_source = self._outnumber_other_paths(is_of_others | (is_ghost & is_confirmed), owner, confirmed)
        is_source &= ~judged.is_ghost[~confirmed].any(axis=0)
        return Assignment(
            owner=np.where(is_source, by_direction, owner),
            in_sight=in_sight,
            level_db=judged.level_db,
            may_be=in_gate & judged.is_direct,
            is_too_weak=judged.is_diffracted & judged.is_direct,
            is_echo=is_of_others & ~is_source,
        )

    def _judged_by_likelihood(self, judged: JudgedPulses, confirmed: BoolArray) -> JudgedPulses:
        """What was judged, with no pulse pointing to a finding while another makes its bearing much likelier.

        A candidate whose position is hardly known has every direction in its gate, and would leave nothing to those
        known better. Confirmed findings and candidates are compared among themselves alone: a confirmed one is known
        best, and would take all pulses of a new source beside it.

        Args:
            judged: By direction, level and phase.
            confirmed: Which findings are, shape (n_findings,).
        """
        in_gate = judged.offset_sigmas <= self._rules.gate_sigmas
        offset_sigmas, log_likelihood = judged.offset_sigmas.copy(), np.where(in_gate, judged.log_likelihood, -np.inf)
        for among in (np.flatnonzero(confirmed), np.flatnonzero(~confirmed)):
            if among.size > 1:
                least = log_likelihood[among].max(axis=0) - np.log(MUCH_LIKELIER)
                offset_sigmas[among] = np.where(log_likelihood[among] < least, np.inf, offset_sigmas[among])
        return judged._replace(offset_sigmas=offset_sigmas)

    def _judged_by_phase(self, judged: JudgedPulses, confirmed: BoolArray) -> JudgedPulses:
        """What was judged, without what the phase of the mains rules out.

        Of several findings in one direction, those are no owners that do not discharge at the phase of the pulse; of
        confirmed ones that do not, it is no echo. By phase alone a pulse is never taken from the one finding that it
        points to: a kind may be weaker in one half cycle, and heard in it from near by alone.

        Args:
            judged: By direction and level.
            confirmed: Which findings are, shape (n_findings,).
        """
        in_gate = judged.offset_sigmas <= self._rules.gate_sigmas
        n_gates, is_ghost = in_gate.sum(axis=0), judged.is_ghost.any(axis=0)
        if not (is_ghost | (n_gates > 1)).any():
            return judged
        is_sure = (n_gates == 1) & ~is_ghost
        surely = np.where(is_sure, in_gate.argmax(axis=0), NoOwner.UNASSIGNED)
        may_be = may_share_phase(self._record.pulses.mains_phase_rad, surely, confirmed.size)
        leaves_one = (in_gate & may_be).any(axis=0)
        return judged._replace(
            offset_sigmas=np.where(in_gate & ~may_be & leaves_one, np.inf, judged.offset_sigmas),
            is_ghost=judged.is_ghost & (may_be | ~confirmed[:, np.newaxis] | judged.is_diffracted),
        )

    def _outnumber_other_paths(self, is_echo: BoolArray, owner: NDArray[np.intp], confirmed: BoolArray) -> BoolArray:
        """Which of the pulses that may be other paths of confirmed findings are too many for that, shape (n,)."""
        number = np.append(np.where(confirmed, np.cumsum(confirmed) - 1, -1), -1)  # of confirmed ones alone
        return too_many_for_echoes(
            self._record.elapsed_s,
            self._record.pulses.azimuth_rad + self._record.pose[:, 2],
            is_echo & ~self._record.is_from_above,
            number[np.maximum(owner, -1)],
            int(confirmed.sum()),
        )

    def _judge(self, finding: Finding, errors: ElementErrors) -> Judgement:
        """All pulses by one finding: the settled ones as before, while it and the array are what they were."""
        known = self._judged.get(finding.id)
        if known is None or not (_is_alike(known.finding, finding) and self._record.reads_alike(known.errors, errors)):
            pulses = self._judged_from(0, finding, errors)
            return Judgement(finding, errors, self._record.n_settled, pulses)
        if known.pulses.level_db.size == self._record.pulses.n_pulses:
            return known
        latest = self._judged_from(known.n_settled, known.finding, known.errors)
        pulses = known.pulses.continued(known.n_settled, latest)
        return known._replace(n_settled=self._record.n_settled, pulses=pulses)

    def _judged_from(self, first: int, finding: Finding, errors: ElementErrors) -> JudgedPulses:
        """The pulses from one row on."""
        rows = slice(first, None)
        gate = gate_pulses(self._record, rows, self._record.measurements(rows, errors), finding, self._rules)
        paths = judge_paths(self._record, rows, gate, finding, self._rules)
        return JudgedPulses(
            offset_sigmas=np.where(paths.is_diffracted, np.inf, gate.offset_sigmas),
            log_likelihood=gate.log_likelihood,
            level_db=gate.level_db,
            is_direct=paths.is_direct,
            is_ghost=paths.is_ghost,
            is_diffracted=paths.is_diffracted,
            is_biased=paths.is_biased,
        )


def _is_alike(then: Finding, now: Finding) -> bool:
    """Whether a finding is near enough to what it was for the same pulses to be its own."""
    has_level = np.isfinite(then.level_db) == np.isfinite(now.level_db)
    return (
        then.state == now.state
        and bool(np.linalg.norm(then.position_m - now.position_m) <= ALIKE_M)
        and abs(then.semi_major_m - now.semi_major_m) <= ALIKE_M
        and abs(then.height_std_m - now.height_std_m) <= ALIKE_M
        and has_level
        and not abs(then.level_db - now.level_db) > ALIKE_DB
    )
