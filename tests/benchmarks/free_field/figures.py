"""Results of the Locator in the free field, compared with the truth."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dirmusic import Finding, Locator
from dirmusic.arrays import BoolArray, FloatArray, IntArray
from dirmusic.locating.finding import is_inside95
from dirmusic.locating.rules import LocatingRules
from pdpatrol.envs.scenario.base import STEP_S
from pdpatrol.missions.report.scoring import pair_findings
from tests.benchmarks.free_field.cases import FENCE_M, Case


class ScoredCases(NamedTuple):
    """Errors of the finding with the most pulses in each case, NaN without a finding.

    Attributes:
        miss_m: Horizontal distance from the truth, shape (n_cases,).
        is_inside: Whether the truth lies within its 95 % ellipse, shape (n_cases,).
        n_false: Number of confirmed findings beyond the first, shape (n_cases,).
    """

    miss_m: FloatArray
    is_inside: BoolArray
    n_false: IntArray


def usable(case: Case, rules: LocatingRules) -> BoolArray:
    """Return True for each pulse that the Locator is given, shape (n_pulses,)."""
    return ~case.pulses.is_overdriven & (case.pulses.std_rad < rules.max_std_rad)


def locate(case: Case, rules: LocatingRules | None = None) -> tuple[Finding, ...]:
    """Run the Locator over the drive, one control step at a time, and return all findings."""
    rules = rules or LocatingRules()
    locator = Locator(case.array, case.pose_error, fence_m=FENCE_M, rules=rules)
    chosen = np.flatnonzero(usable(case, rules))
    ends = np.searchsorted(case.step[chosen], np.arange(len(case.pose)), side="right")
    for k, own in enumerate(np.split(chosen, ends[:-1])):
        locator.update(STEP_S * (k + 1), case.pose[k], case.pulses.take(own))
    return locator.refit(STEP_S * len(case.pose))


def compare_with_truth(cases: list[tuple[Case, tuple[Finding, ...]]]) -> ScoredCases:
    """Compare the findings of cases of one source with the truth."""
    miss_m, is_inside, n_false = [], [], []
    for case, findings in cases:
        best = max(findings, key=lambda finding: finding.n_bearings, default=None)
        miss = np.full(2, np.nan) if best is None else best.position_m[:2] - case.sources_m[0, :2]
        miss_m.append(np.linalg.norm(miss))
        is_inside.append(best is not None and is_inside95(miss, best.covariance_m2[:2, :2]))
        n_false.append(max(len(confirmed(findings)) - 1, 0))
    return ScoredCases(np.array(miss_m), np.array(is_inside), np.array(n_false))


def confirmed(findings: tuple[Finding, ...]) -> list[Finding]:
    """Select the confirmed findings."""
    return [finding for finding in findings if finding.state == "confirmed"]


def ospa_m(case: Case, findings: tuple[Finding, ...]) -> float:
    """Compute the OSPA distance between confirmed findings and sources, with a cut-off of 2 m."""
    found_m = np.array([finding.position_m for finding in confirmed(findings)]).reshape(-1, 3)
    return pair_findings(found_m, case.sources_m)[1]
