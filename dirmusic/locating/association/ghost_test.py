"""Ghost test: which pulses of a finding did not come on the direct path.

Behind equipment every pulse comes round a corner or from a mirror: a perfectly consistent, wrong point source. Two
things tell: the map, if there is one, since what mirrors stands between the robot and the mirror image; and the
strength, since strength times range is the same for all that comes on the direct path.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.locating.association.gating import Gate
from dirmusic.locating.association.pulse_record import PulseRecord
from dirmusic.locating.finding import Finding
from dirmusic.locating.rules import AssignmentRules

BoolArray = NDArray[np.bool_]

SIDES = np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])


class Paths(NamedTuple):
    """On what paths pulses may have come from one finding; every array has shape (n,).

    Attributes:
        is_direct: On the direct path, if the pulse is the finding's at all: in sight by the map or by the level.
        is_diffracted: Pointing to the finding, but too weak for the range: round an obstacle.
        is_ghost: Round an obstacle or from a reflector while the finding is obstructed.
        is_biased: On the direct path, the bearing biased by a reflection within the gate.
    """

    is_direct: BoolArray
    is_diffracted: BoolArray
    is_ghost: BoolArray
    is_biased: BoolArray


def judge_paths(record: PulseRecord, rows: slice, gate: Gate, finding: Finding, rules: AssignmentRules) -> Paths:
    """Judge some pulses by level and map; before a finding has a level of its own, nothing but the map tells."""
    excess_db = gate.level_db - finding.level_db
    is_diffracted = gate.in_gate & (excess_db < -rules.obstruction_db)
    if finding.state != "confirmed":
        nowhere = np.zeros(excess_db.size, dtype=np.bool_)
        return Paths(gate.in_sight, is_diffracted, is_ghost=is_diffracted, is_biased=nowhere)
    is_direct = gate.in_sight | (gate.in_gate & (excess_db > -rules.direct_path_db))
    is_clear = is_direct & _is_clear_of_edges(record, finding, rules)[record.place[rows]]
    return Paths(
        is_direct=is_direct,
        is_diffracted=is_diffracted,
        is_ghost=is_diffracted | (~is_clear & (excess_db < rules.ghost_db)),
        is_biased=is_direct & (gate.offset_rad < rules.bias_arc_rad) & (np.abs(excess_db) < rules.bias_db),
    )


def _is_clear_of_edges(record: PulseRecord, finding: Finding, rules: AssignmentRules) -> BoolArray:
    """Whether nothing weakens the finding at each place, nor would a little to either side, shape (n_places,)."""
    clear, least = np.ones(len(record.places_m), dtype=np.bool_), 10 ** (-rules.clear_loss_db / 20)
    for aside in SIDES:
        target_m = finding.position_m + rules.edge_margin_m * aside
        within_m = rules.surface_depth_m + rules.edge_margin_m
        clear &= record.sight.shares(record.places_m, target_m, within_m) >= least
    return clear
