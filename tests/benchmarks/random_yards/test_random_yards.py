"""Results of missions in random yards; `uv run pytest -m slow -n 0 -s tests/benchmarks/random_yards` prints them.

Shares pass when their 95 % Wilson intervals reach the required value. No other test uses these seeds.
"""

from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from itertools import count, islice
from multiprocessing import get_context

import numpy as np
import pytest

from pdpatrol.envs import Scenario
from pdpatrol.missions.report.records import Report
from tests.benchmarks.random_yards.cases import (
    BUSHING_M,
    DETECTED_PULSES,
    hidden,
    is_all_found,
    narrow,
    planned,
    run_case,
    several,
)
from tests.benchmarks.shares import few_or_many, share

FIRST = 400_000

Case = tuple[Scenario, str, int]


def drawn_cases(draw: Callable[[int], Scenario | None], n_cases: int) -> Iterable[Case]:
    """Return the first cases that can be drawn, for the policy `seek`."""
    drawn = ((seed, draw(seed)) for seed in count(FIRST))
    return islice(((scenario, "seek", seed) for seed, scenario in drawn if scenario is not None), n_cases)


def reports(cases: Iterable[Case]) -> list[Report]:
    """Return the results of all cases in order, computed by two processes if there are many."""
    cases = list(cases)
    if len(cases) <= 3:
        return [run_case(*case) for case in cases]
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        return list(pool.map(run_case, *zip(*cases, strict=True)))


@few_or_many(3, 300)
@pytest.mark.parametrize("policy", ["seek", "active"])
def test_planned_routes_find_sources_of_random_yards(policy: str, n_cases: int) -> None:
    done = reports((planned(seed), policy, seed) for seed in range(FIRST, FIRST + n_cases))
    sources = [report.scores.sources[0] for report in done]
    found = [match for report in done for match in report.scores.matches]
    miss_m = np.array([match.error_m for match in found])
    rise_m = np.abs([match.height_error_m for match in found])
    low = [s.match for s in sources if s.match is not None and s.true_position_m[2] < BUSHING_M]
    high = [source for source in sources if source.true_position_m[2] >= BUSHING_M]
    print(
        f"\n{policy}: median {np.median(miss_m):.3f} m, mean {miss_m.mean():.3f} m, "
        f"height {np.median(rise_m):.3f} m, {sum(report.collisions for report in done)} contacts"
    )
    assert share("found", int((miss_m < 1.0).sum()), n_cases).high >= 0.985
    assert share("found above 3 m", sum(source.found for source in high), len(high)).high >= 0.97
    on_site = [source.match for source in sources if source.match is not None and "/" in source.true_site]
    assert share("right site", sum(match.right_site for match in on_site), len(on_site)).high >= 0.95
    print(f"  right place of all: {sum(match.right_site for match in found)} of {len(found)}")
    inside = share("in ellipse, low ones", sum(match.is_inside(0.95)[0] for match in low), len(low))
    assert inside.high >= 0.92
    assert inside.low <= 0.98
    assert share("false findings", sum(report.scores.false_findings > 0 for report in done), n_cases).low <= 0.01
    assert not any(report.collisions for report in done)
    assert np.median(rise_m) <= 0.15
    if n_cases > 100:
        assert np.median(miss_m) <= 0.07
        assert miss_m.mean() <= 0.15


@few_or_many(3, 100)
def test_several_sources_are_all_found(n_cases: int) -> None:
    done = reports((several(seed), "seek", seed) for seed in range(FIRST, FIRST + n_cases))
    print(f"\nOSPA {np.median([report.scores.ospa_m for report in done]):.3f} m (median)")
    assert share("all found", sum(is_all_found(report) for report in done), n_cases).high >= 0.90
    assert np.median([report.scores.ospa_m for report in done]) <= (0.10 if n_cases > 3 else 0.15)


@pytest.mark.xfail(strict=True, reason="the Locator finds only 7 of 12 sources seen through a narrow gap")
@few_or_many(12, 100)  # of twelve, two may be missed if 95 % must be found; three would decide nothing
def test_source_with_narrow_line_of_sight_is_found(n_cases: int) -> None:
    done = reports(drawn_cases(narrow, n_cases))
    print(f"\n{sum(report.scores.false_findings > 0 for report in done)} with a false finding")
    assert share("found", sum(is_all_found(report) for report in done), n_cases).high >= 0.95


@few_or_many(3, 100)
def test_source_out_of_sight_of_route_is_found(n_cases: int) -> None:
    done = [each for each in reports(drawn_cases(hidden, n_cases)) if each.pulses.detected >= DETECTED_PULSES]
    print(f"\n{len(done)} of {n_cases} routes detect the source")
    assert share("found", sum(is_all_found(report) for report in done), len(done)).high >= 0.80
