"""Which findings of several inspections are one discharge."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pdpatrol.missions.campaign.inspection import Located

FloatArray = NDArray[np.float64]

GATE = 16.27
"""99.9 % quantile of chi-square with three degrees of freedom: one in a thousand is torn apart."""

REPEAT_STD_M = 0.1
"""Of each coordinate from one inspection to the next, beyond what covariances tell (assumed): how a site is mirrored,
and how the map lies."""

CANDIDATE_STD_M = 1.0
"""Candidates less well located, root of the largest eigenvalue of the covariance, join nothing (assumed): they may be
anywhere."""

FAR = 1e9
"""Stands for what must not be matched."""


@dataclass
class Joined:
    """One discharge over the inspections.

    Attributes:
        found: Its finding in each inspection that has one, by the number of the inspection.
    """

    found: dict[int, Located] = field(default_factory=dict)

    @property
    def position_m(self) -> FloatArray:
        """Mean over the inspections, weighted by their covariances, shape (3,)."""
        weights = [np.linalg.inv(_widened(finding)) for finding in self.found.values()]
        places = [w @ finding.position_m for w, finding in zip(weights, self.found.values(), strict=True)]
        return np.linalg.solve(np.sum(weights, axis=0), np.sum(places, axis=0))

    @property
    def covariance_m2(self) -> FloatArray:
        """Of that mean, shape (3, 3)."""
        weights = [np.linalg.inv(_widened(finding)) for finding in self.found.values()]
        return np.linalg.inv(np.sum(weights, axis=0))


def join(inspections: Sequence[Sequence[Located]]) -> tuple[Joined, ...]:
    """Discharges of which each has one finding in an inspection at most, and each confirmed finding one discharge.

    Confirmed findings are joined first, from inspection to inspection; a candidate then joins a discharge that has no
    finding in its inspection, and makes none of its own.

    Args:
        inspections: Findings of each, in the order of their dates.
    """
    joined = list[Joined]()
    for number, findings in enumerate(inspections):
        confirmed = [finding for finding in findings if finding.is_confirmed]
        pairs = _matched(joined, confirmed)
        for row, finding in enumerate(confirmed):
            if row in pairs:
                pairs[row].found[number] = finding
            else:
                joined.append(Joined({number: finding}))
    for number, findings in enumerate(inspections):
        candidates = [finding for finding in findings if not finding.is_confirmed and _is_located(finding)]
        for row, each in _matched([each for each in joined if number not in each.found], candidates).items():
            each.found[number] = candidates[row]
    return tuple(joined)


def _matched(joined: Sequence[Joined], findings: Sequence[Located]) -> Mapping[int, Joined]:
    """The discharge of each finding that has one, by its row: as near as can be together, each once."""
    if not joined or not findings:
        return {}
    from scipy.optimize import linear_sum_assignment

    places = [(each.position_m, each.covariance_m2) for each in joined]
    squares = np.array(
        [
            [
                _square(finding.position_m - place_m, _widened(finding) + covariance_m2)
                for place_m, covariance_m2 in places
            ]
            for finding in findings
        ]
    )
    rows, columns = linear_sum_assignment(np.where(squares <= GATE, squares, FAR))
    return {
        int(row): joined[int(column)] for row, column in zip(rows, columns, strict=True) if squares[row, column] <= GATE
    }


def _square(off_m: FloatArray, covariance_m2: FloatArray) -> float:
    """Squared Mahalanobis distance."""
    return float(off_m @ np.linalg.solve(covariance_m2, off_m))


def _widened(finding: Located) -> FloatArray:
    return finding.covariance_m2 + REPEAT_STD_M**2 * np.eye(3)


def _is_located(finding: Located) -> bool:
    return bool(np.linalg.eigvalsh(finding.covariance_m2)[-1] <= CANDIDATE_STD_M**2)
