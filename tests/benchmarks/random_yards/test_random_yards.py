"""Results of missions in random yards; `uv run pytest -m slow -n 0 -s tests/benchmarks/random_yards` prints them.

Shares pass when their 95 % Wilson intervals reach the required value. No other test uses these seeds.
"""

from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from itertools import count, islice
from multiprocessing import get_context

import numpy as np
import pytest

from pdpatrol.envs import Scenario
from pdpatrol.missions.sweep.analysis import Estimate, wilson
from tests.benchmarks.random_yards.cases import (
    BUSHING_M,
    DETECTED_PULSES,
    Outcome,
    hidden,
    narrow,
    planned,
    run_case,
    several,
)

FIRST = 400_000

Case = tuple[Scenario, str, int]


def few_or_many(many: int, few: int = 3) -> pytest.MarkDecorator:
    """Parametrize with a few cases for CI and many slow ones."""
    return pytest.mark.parametrize(
        "n_cases", [pytest.param(few, marks=pytest.mark.whole), pytest.param(many, marks=pytest.mark.slow)]
    )


def outcomes(cases: Iterable[Case]) -> list[Outcome]:
    """Return the results of all cases in order, computed by two processes if there are many."""
    cases = list(cases)
    if len(cases) <= 3:
        return [run_case(*case) for case in cases]
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        return list(pool.map(run_case, *zip(*cases, strict=True)))


def share(what: str, count: int, total: int) -> Estimate:
    """Print and return a share with its interval; 0 to 1 without cases."""
    interval = wilson(count, total) if total else Estimate(np.nan, 0.0, 1.0)
    print(
        f"  {what}: {count} of {total}, {100 * interval.value:.1f} % "
        f"({100 * interval.low:.1f} to {100 * interval.high:.1f})"
    )
    return interval


@few_or_many(300)
@pytest.mark.parametrize("policy", ["seek", "active"])
def test_planned_routes_find_sources_of_random_yards(policy: str, n_cases: int) -> None:
    done = outcomes((planned(seed), policy, seed) for seed in range(FIRST, FIRST + n_cases))
    sources = [outcome.sources[0] for outcome in done]
    found = [source.match for source in sources if source.match is not None]
    miss_m = np.array([match.error_m for match in found])
    rise_m = np.abs([match.height_error_m for match in found])
    low = [s.match for s in sources if s.match is not None and s.true_position_m[2] < BUSHING_M]
    high = [source for source in sources if source.true_position_m[2] >= BUSHING_M]
    print(
        f"\n{policy}: median {np.median(miss_m):.3f} m, mean {miss_m.mean():.3f} m, "
        f"height {np.median(rise_m):.3f} m, {sum(outcome.contacts for outcome in done)} contacts"
    )
    assert share("found", int((miss_m < 1.0).sum()), n_cases).high >= 0.985
    assert share("found above 3 m", sum(source.found for source in high), len(high)).high >= 0.97
    assert share("right site", sum(match.right_site for match in found), len(found)).high >= 0.95
    inside = share("in ellipse, low ones", sum(match.inside_ellipse95 for match in low), len(low))
    assert inside.high >= 0.92
    assert inside.low <= 0.98
    assert share("false findings", sum(outcome.false_findings > 0 for outcome in done), n_cases).low <= 0.01
    assert not any(outcome.contacts for outcome in done)
    assert np.median(rise_m) <= 0.15
    if n_cases > 100:
        assert np.median(miss_m) <= 0.07
        assert miss_m.mean() <= 0.15


@few_or_many(100)
def test_several_sources_are_all_found(n_cases: int) -> None:
    done = outcomes((several(seed), "seek", seed) for seed in range(FIRST, FIRST + n_cases))
    print(f"\nOSPA {np.median([outcome.ospa_m for outcome in done]):.3f} m (median)")
    assert share("all found", sum(outcome.is_all_found for outcome in done), n_cases).high >= 0.90
    assert np.median([outcome.ospa_m for outcome in done]) <= (0.10 if n_cases > 3 else 0.15)


@few_or_many(100, few=12)  # of twelve, two may be missed if 95 % must be found; three would decide nothing
def test_source_with_narrow_line_of_sight_is_found(n_cases: int) -> None:
    drawn = ((seed, narrow(seed)) for seed in count(FIRST))
    done = outcomes(islice(((scenario, "seek", seed) for seed, scenario in drawn if scenario is not None), n_cases))
    print(f"\n{sum(outcome.false_findings > 0 for outcome in done)} with a false finding")
    assert share("found", sum(outcome.is_all_found for outcome in done), n_cases).high >= 0.95


@few_or_many(100)
def test_source_out_of_sight_of_route_is_found(n_cases: int) -> None:
    drawn = ((seed, hidden(seed)) for seed in count(FIRST))
    cases = islice(((scenario, "seek", seed) for seed, scenario in drawn if scenario is not None), n_cases)
    done = [outcome for outcome in outcomes(cases) if outcome.n_pulses >= DETECTED_PULSES]
    print(f"\n{len(done)} of {n_cases} routes detect the source")
    assert share("found", sum(outcome.is_all_found for outcome in done), len(done)).high >= 0.80
