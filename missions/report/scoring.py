"""Findings against the truth: pairing, errors, OSPA."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment

from dirmusic.locating.finding import is_inside95
from pdpatrol.missions.report.records import Evaluation, Match, ScoredSource

FloatArray = NDArray[np.float64]

CUT_OFF_M = 2.0
"""A finding further than this from every source is a false one; also the cut-off of OSPA."""

SAME_PLACE_M = 1e-6
"""A site and the source on it are apart by rounding."""


class Located(Protocol):
    """What is scored: a finding, of the Locator or of a report."""

    @property
    def id(self) -> int:
        """Its number."""
        ...

    @property
    def position_m(self) -> ArrayLike:
        """Shape (3,), world frame."""
        ...

    @property
    def covariance_m2(self) -> ArrayLike:
        """Shape (3, 3)."""
        ...


class Found(NamedTuple):
    """A finding as far as it is scored; see `Located`."""

    id: int
    position_m: ArrayLike
    covariance_m2: ArrayLike


class TrueSource(NamedTuple):
    """A source as it is.

    Attributes:
        name: As of the scenario.
        position_m: x, y, z, world frame.
    """

    name: str
    position_m: tuple[float, float, float]


def true_sources(truth: Mapping[str, Any]) -> list[TrueSource]:
    """The sources of the truth of a log."""
    return [TrueSource(source["name"], tuple(source["position_m"])) for source in truth["sources"]]


def evaluate(
    findings: Sequence[Located], sources: Sequence[TrueSource], sites_m: FloatArray | None = None
) -> Evaluation:
    """Score findings against the truth.

    Each source gets the id of the finding that it is paired with. It has the right site if none of the known sites is
    nearer to the finding than the source itself: so an operator who looks at the nearest site looks there.
    Findings and sources are paired one to one by least total distance on plan, with a cut-off of 2 m. OSPA has c = 2 m,
    p = 1: the mean over the larger set of the paired distances, each unpaired member counting 2 m.

    Args:
        findings: Those confirmed.
        sources: All that are inside the fence.
        sites_m: Where discharges may sit in the yard, shape (n_sites, 3); None if that is not known.

    References:
        Schuhmacher, Vo and Vo, "A consistent metric for performance evaluation of multi-object filters", 2008.
    """
    found_m = np.array([f.position_m for f in findings]).reshape(-1, 3)
    true_m = np.array([s.position_m for s in sources]).reshape(-1, 3)
    distance = np.linalg.norm((true_m[:, np.newaxis] - found_m)[..., :2], axis=-1)
    pairs = zip(*linear_sum_assignment(np.minimum(distance, CUT_OFF_M)), strict=True)
    partner = {int(i): int(j) for i, j in pairs if distance[i, j] < CUT_OFF_M}
    known_m = np.empty((0, 3)) if sites_m is None else sites_m
    scored: list[ScoredSource] = []
    for i, source in enumerate(sources):
        j, match = partner.get(i), None
        if j is not None:
            other_m = np.linalg.norm(known_m - found_m[j], axis=-1)
            off_m, covariance_m2 = found_m[j] - true_m[i], np.asarray(findings[j].covariance_m2)
            match = Match(
                finding_id=findings[j].id,
                error_m=float(distance[i, j]),
                height_error_m=float(off_m[2]),
                inside_ellipse95=is_inside95(off_m[:2], covariance_m2[:2, :2]),
                right_site=bool((other_m > np.linalg.norm(off_m) - SAME_PLACE_M).all()),
            )
        position_m = source.position_m
        scored.append(ScoredSource(name=source.name, true_position_m=position_m, found=match is not None, match=match))
    most = max(len(findings), len(sources))
    missed = most - len(partner)
    ospa = (sum(float(distance[i, j]) for i, j in partner.items()) + CUT_OFF_M * missed) / most if most else 0.0
    return Evaluation(sources=tuple(scored), false_findings=len(findings) - len(partner), ospa_m=ospa)
