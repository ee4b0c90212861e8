"""Accuracy in an empty yard; `uv run pytest -m slow tests/benchmarks/free_field -s` prints it.

A share passes when its 95 % Wilson interval reaches the required value.
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from dirmusic.locating.joint_fit import HEIGHT_PRIOR_M, nominal_array
from dirmusic.locating.measurement import N_PLACE, Noise, PooledPulses, errors_at, expand
from dirmusic.locating.rules import LocatingRules
from tests.benchmarks.free_field.assumed import as_assumed, expected_v, position_bound, prior_of
from tests.benchmarks.free_field.cases import draw_case, with_wild_bearings
from tests.benchmarks.free_field.figures import (
    ScoredCases,
    compare_with_truth,
    confirmed,
    locate,
    ospa_m,
)
from tests.benchmarks.shares import few_or_many, share
from tests.dirmusic.locating.forward_model import GRAVEL, Nature, modelled

FEW, FEW_WILD, FEW_STRENGTHS = 4, 16, 50
"""Numbers of cases in the short run. Wild bearings affect only some cases, and interference differs from case to case:
these need more."""

MANY, MANY_DRAWN, MANY_HIGH = 2000, 300, 100
"""Numbers of cases in the long run: by the shipped models, drawn from the model of the Locator, and high sources."""

WILD_SHARE = 0.3
NOISE = 30.0
"""Factor of the noise at which the least unexplained error does not matter."""

ALL_PULSES = LocatingRules(max_pulses=2000)
"""Rules for cases without errors of array and poses, so that every pulse contributes."""


@lru_cache
def shipped(n_cases: int) -> ScoredCases:
    """Locate the sources of cases with the shipped errors of array and pose."""
    return compare_with_truth([(case, locate(case)) for case in map(draw_case, range(n_cases))])


@few_or_many(FEW, MANY)
def test_source_in_the_free_field_lies_in_its_ellipse(n_cases: int) -> None:
    found = shipped(n_cases)
    print(f"\nmedian {np.median(found.miss_m):.3f} m, 95 % below {np.quantile(found.miss_m, 0.95):.3f} m")
    near = share("within 0.30 m", int((found.miss_m <= 0.30).sum()), n_cases)
    inside = share("in the ellipse", int(found.is_inside.sum()), n_cases)
    assert np.median(found.miss_m) <= 0.10
    assert near.high >= 0.95
    assert inside.high >= 0.92
    assert inside.low <= 0.98


@few_or_many(FEW, MANY_HIGH)
def test_heights_of_high_sources_are_unbiased(n_cases: int) -> None:
    """Sources are as high as the bushings of a large transformer; their ground wave arrives after the gate."""
    sigmas = list[float]()
    for seed in range(n_cases):
        case = draw_case(seed, heights_m=(4.0, 8.0))
        best = max(locate(case), key=lambda finding: finding.n_bearings)
        sigmas.append((best.position_m[2] - case.sources_m[0, 2]) / best.height_std_m)
    print(f"\n{n_cases} heights: mean error {np.mean(sigmas):.2f} and root mean square {np.std(sigmas):.2f} deviations")
    assert abs(np.mean(sigmas)) < 0.5
    assert np.mean(np.abs(sigmas) < 1.96) >= 0.9


@few_or_many(FEW_STRENGTHS, MANY)
def test_front_and_back_of_the_array_have_the_modelled_strengths(n_cases: int) -> None:
    """The wave from the ground reaches the back of the array later, where the gate cuts off more of it."""
    front, back = list[float](), list[float]()
    for seed in range(n_cases):
        case = draw_case(seed, heights_m=(4.0, 8.0))
        array = replace(case.array, manifold=case.real.manifold(), positions_m=case.real.positions_m)
        pose = case.true_pose[case.step]
        clean = modelled(pose, np.repeat(case.sources_m, len(pose), axis=0), array, Nature(permittivity=GRAVEL))
        is_back = clean < 0.5 * clean.max(axis=-1, keepdims=True)
        for part, ratios in ((~is_back, front), (is_back, back)):
            ratios.append(float(np.sum(case.pulses.strengths_v * clean * part) / np.sum(np.square(clean) * part)))
    ratio = np.array(back) / front
    print(f"\n{n_cases} sources: strengths at the back are {100 * (ratio.mean() - 1):.2f} % above the modelled ones")
    assert ratio.mean() == pytest.approx(1.0, abs=0.005)


@few_or_many(FEW_WILD, MANY)
def test_wild_bearings_raise_the_median_by_half_at_most(n_cases: int) -> None:
    cases = (with_wild_bearings(draw_case(seed), WILD_SHARE, seed) for seed in range(n_cases))
    wild, clean = compare_with_truth([(case, locate(case)) for case in cases]), shipped(n_cases)
    ratio = float(np.median(np.nan_to_num(wild.miss_m, nan=np.inf)) / np.median(clean.miss_m))
    print(f"\n30 % wild: median {np.median(wild.miss_m):.3f} m, {ratio:.2f} times that of clean ones")
    share("in the ellipse", int(wild.is_inside.sum()), n_cases)
    share("with a false finding", int((wild.n_false > 0).sum()), n_cases)
    assert ratio <= 1.5


@pytest.mark.xfail(
    strict=True, reason="the fit assumes unexplained errors of 1 % at least, none of which is here: 1.5 times"
)
@few_or_many(FEW, MANY_DRAWN)
def test_error_is_near_the_bound(n_cases: int) -> None:
    """States are drawn from the priors of the Locator; the bound follows from the same model."""
    square_m2, bound_m2 = np.empty(n_cases), np.empty(n_cases)
    for seed in range(n_cases):
        assumed = as_assumed(draw_case(seed, is_exact=True), seed)
        square_m2[seed] = compare_with_truth([(assumed.case, locate(assumed.case, ALL_PULSES))]).miss_m[0] ** 2
        bound_m2[seed] = np.trace(position_bound(assumed))
    over_bound = np.sqrt(np.mean(square_m2 / bound_m2))
    print(
        f"\n{n_cases} cases as the Locator assumes: RMSE {1e3 * np.sqrt(square_m2.mean()):.2f} mm, "
        f"{over_bound:.3f} times the root of the bound"
    )
    assert over_bound <= (1.10 if n_cases == MANY_DRAWN else 1.35)  # with so few cases, more by chance


@pytest.mark.whole
def test_bound_is_that_of_the_derivatives_of_the_fit() -> None:
    """With so much noise that the least unexplained error does not matter, both have the same information."""
    drawn = as_assumed(draw_case(0, is_exact=True), 0)
    n, pulses = drawn.group.size, drawn.case.pulses._replace(variance_v2=NOISE**2 * drawn.case.pulses.variance_v2)
    noisy = drawn._replace(case=drawn.case._replace(pulses=pulses), group=np.arange(n))
    case, usable = noisy.case, np.ones(pulses.strengths_v.shape, dtype=np.bool_)
    pooled = PooledPulses(case.pose[case.step], expected_v(noisy), pulses.variance_v2, usable, np.ones(n))
    data = pooled, nominal_array(case.array), Noise(0.0, 0.0, 0.0)
    source, once = np.zeros(n, dtype=np.intp), np.ones(n)
    state = np.concatenate([case.sources_m[0], noisy.array_state])
    errors = errors_at(state, source, once, once, *data)
    information = expand(state, errors, source, *data, t_freedom=1e6).hessian
    information[2, 2] += HEIGHT_PRIOR_M[1] ** -2
    information[N_PLACE:, N_PLACE:] += prior_of(case).information
    np.testing.assert_allclose(position_bound(noisy), np.linalg.inv(information)[:2, :2], rtol=0.02, atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(("n_sources", "least"), [(1, 0.97), (2, 0.97), (3, 0.97), (5, 0.85)])
def test_number_of_sources_is_right(n_sources: int, least: float) -> None:
    n_cases, n_right, apart_m = 400, 0, list[float]()
    for seed in range(n_cases):
        case = draw_case(seed, n_sources)
        findings = locate(case)
        n_right += len(confirmed(findings)) == n_sources
        apart_m.append(ospa_m(case, findings))
    print(f"\n{n_sources} sources: median OSPA {np.median(apart_m):.3f} m")
    right = share("number right", n_right, n_cases)
    assert right.high >= least
    assert np.median(apart_m) <= 0.10
