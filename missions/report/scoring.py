"""Comparison of findings with the truth: pairing, errors, OSPA."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linear_sum_assignment

from dirmusic import Finding
from dirmusic.locating.finding import is_inside95
from pdpatrol.missions.report.records import FindingRecord, ScoredSource, Scores, SourceMatch

CUT_OFF_M = 2.0
"""Findings farther than this from every source are false; also the cut-off of OSPA."""


def evaluate(
    findings: Sequence[Finding | FindingRecord],
    sources: Mapping[str, ArrayLike],
    sites_m: Sequence[ArrayLike] = (),
) -> Scores:
    """Score findings against the truth.

    Findings and sources are paired one to one by smallest total horizontal distance, with a cut-off of 2 m. A source
    has the right site if no known site is nearer to the finding than the source itself. OSPA has c = 2 m, p = 1: the
    mean over the larger set of the paired distances, where each unpaired member counts 2 m.

    Args:
        findings: Confirmed findings.
        sources: Positions of all sources inside the fence by name, each of shape (3,).
        sites_m: Possible sites of discharges in the yard, each of shape (3,); empty if they are not known.

    References:
        Schuhmacher, Vo and Vo, "A consistent metric for performance evaluation of multi-object filters", 2008.
    """
    found_m = np.array([finding.position_m for finding in findings]).reshape(-1, 3)
    true_m, known_m = np.array(list(sources.values())).reshape(-1, 3), np.array(sites_m).reshape(-1, 3)
    distance_m = np.linalg.norm((true_m[:, np.newaxis] - found_m)[..., :2], axis=-1)
    cost_m = np.minimum(distance_m, CUT_OFF_M)
    pairs = linear_sum_assignment(cost_m)
    partner = {i: j for i, j in np.transpose(pairs).tolist() if distance_m[i, j] < CUT_OFF_M}
    scored: list[ScoredSource] = []
    for i, name in enumerate(sources):
        match = None
        if i in partner:
            finding, offset_m = findings[partner[i]], found_m[partner[i]] - true_m[i]
            to_sites_m = np.linalg.norm(known_m - found_m[partner[i]], axis=-1)
            match = SourceMatch(
                finding_id=finding.id,
                error_m=float(distance_m[i, partner[i]]),
                height_error_m=float(offset_m[2]),
                inside_ellipse95=is_inside95(offset_m[:2], np.asarray(finding.covariance_m2)[:2, :2]),
                right_site=bool((to_sites_m > np.linalg.norm(offset_m) - 1e-6).all()),  # the source may be on a site
            )
        scored.append(
            ScoredSource(name=name, true_position_m=tuple(true_m[i].tolist()), found=match is not None, match=match)
        )
    total_m = cost_m[pairs].sum() + CUT_OFF_M * abs(len(findings) - len(sources))
    return Scores(
        sources=tuple(scored),
        false_findings=len(findings) - len(partner),
        ospa_m=float(total_m / max(len(findings), len(sources), 1)),
    )
