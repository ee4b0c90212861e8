"""Decision: the one finding that each pulse belongs to, or why it belongs to none."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.element_errors import ElementErrors
from dirmusic.locating.association.gating import gate_pulses
from dirmusic.locating.association.ghost_test import judge_paths
from dirmusic.locating.association.pulse_record import PulseRecord
from dirmusic.locating.finding import Finding
from dirmusic.locating.rules import AssignmentRules

FloatArray = NDArray[np.float64]


class NoOwner(IntEnum):
    """Why a pulse belongs to no finding; negative, so that no code is the position or the id of a finding."""

    UNASSIGNED = -1
    """It points to no finding."""
    AMBIGUOUS = -2
    """It points to several findings, or a reflection has biased its bearing."""
    GHOST = -3
    """It came round an obstacle or from a reflector."""


class Assignment(NamedTuple):
    """The finding that each pulse belongs to; every array has shape (n,).

    Attributes:
        owner: Position of the finding in the sequence of findings, or a code of `NoOwner`.
        in_sight: Whether the finding that the pulse points to best was in sight from where it was detected.
        level_db: Level 1 m from that finding that pulses of this time and direction mean, dB over 1 V.
    """

    owner: NDArray[np.intp]
    in_sight: NDArray[np.bool_]
    level_db: FloatArray


def assign(
    record: PulseRecord, findings: Sequence[Finding], errors: ElementErrors, rules: AssignmentRules
) -> Assignment:
    """Assign all pulses of a record to findings.

    Args:
        record: The pulses.
        findings: The findings as they stand.
        errors: Errors of the array's elements as known by now.
        rules: When a pulse belongs to a finding.
    """
    n = record.pulses.n_pulses
    if not findings or n == 0:
        nobody = np.full(n, NoOwner.UNASSIGNED, dtype=np.intp)
        return Assignment(nobody, np.ones(n, dtype=np.bool_), np.full(n, np.nan))
    measured = record.measurements(errors, rules)
    gates = [gate_pulses(record, measured, finding, rules) for finding in findings]
    paths = [judge_paths(record, gate, finding, rules) for gate, finding in zip(gates, findings, strict=True)]
    is_diffracted = np.array([path.is_diffracted for path in paths])
    offset_sigmas = np.where(is_diffracted, np.inf, [gate.offset_sigmas for gate in gates])
    nearest, rows = offset_sigmas.argmin(axis=0), np.arange(n)
    n_gates = (offset_sigmas <= rules.gate_sigmas).sum(axis=0)
    in_sight = np.array([path.is_direct for path in paths])[nearest, rows]
    is_confirmed = np.array([finding.state == "confirmed" for finding in findings])[nearest]
    is_ghost = np.any([path.is_ghost for path in paths], axis=0)
    is_biased = np.any([path.is_biased for path in paths], axis=0)
    owner = np.select(  # the first that holds
        [is_ghost & ~(is_confirmed & in_sight & (n_gates > 0)), n_gates > 1, n_gates == 1, is_biased],
        [NoOwner.GHOST, NoOwner.AMBIGUOUS, nearest, NoOwner.AMBIGUOUS],
        default=NoOwner.UNASSIGNED,
    )
    return Assignment(owner, in_sight, np.array([gate.level_db for gate in gates])[nearest, rows])
