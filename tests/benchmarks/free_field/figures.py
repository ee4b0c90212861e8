"""Results of the Locator in the free field, compared with the truth and the Cramer-Rao bound."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dirmusic import Finding, Locator
from dirmusic.arrays import BoolArray, FloatArray, IntArray
from dirmusic.locating.finding import is_inside95
from dirmusic.locating.joint_fit import HEIGHT_PRIOR_M
from dirmusic.locating.rules import LocatingRules
from pdpatrol.envs.scenario.base import STEP_S
from pdpatrol.missions.report.scoring import pair_findings
from tests.benchmarks.free_field.cases import FENCE_M, Case
from tests.dirmusic.scenes import sights

NUDGE_M = 1e-4
"""Step of the finite differences in the bound."""


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


def position_bound(case: Case) -> FloatArray:
    r"""Compute the Cramer-Rao bound of the position of one source from all pulses, for a known array.

    The information from pulses k with strengths :math:`\alpha_k h_k(p)` of unknown amplitude, in noise of covariance
    :math:`\Sigma_k`, and from the prior of the height:

    .. math:: F = \sum_k D_k^T (I - u_k u_k^T) D_k + \mathrm{diag}(0, 0, \sigma_z^{-2}),
        \quad D_k = \Sigma_k^{-1/2} \alpha_k \partial h_k / \partial p, \quad u_k \propto \Sigma_k^{-1/2} h_k

    Returns:
        Covariance of the horizontal position, shape (2, 2), square metres.
    """
    weight = 1.0 / np.sqrt(case.pulses.variance_v2)
    towards = weight * _gains(case, case.sources_m[0])
    amplitude = (case.pulses.strengths_v * weight * towards).sum(axis=-1) / np.square(towards).sum(axis=-1)
    slopes = [
        weight * (_gains(case, case.sources_m[0] + nudge) - _gains(case, case.sources_m[0] - nudge)) / (2.0 * NUDGE_M)
        for nudge in NUDGE_M * np.eye(3)
    ]
    slope = amplitude[:, np.newaxis, np.newaxis] * np.stack(slopes, axis=-1)
    unit = towards / np.linalg.norm(towards, axis=-1, keepdims=True)
    slope -= unit[:, :, np.newaxis] * np.einsum("ne,nei->ni", unit, slope)[:, np.newaxis]
    information = np.einsum("nei,nej->ij", slope, slope) + np.diag([0.0, 0.0, HEIGHT_PRIOR_M[1] ** -2])
    return np.linalg.inv(information)[:2, :2].astype(np.float64)


def _gains(case: Case, source_m: FloatArray) -> FloatArray:
    """Return the gain over the range in each element at the true pose of each pulse, shape (n_pulses, n_elements)."""
    azimuth_rad, elevation_rad, range_m = sights(case.true_pose[case.step], source_m, case.real.positions_m)
    return case.real.gain(azimuth_rad, elevation_rad) / range_m
