"""Prediction intervals have their stated coverage, and the verdict names the printed numbers that do not agree."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from dirmusic.arrays import FloatArray
from pdpatrol.missions.reproduction.comparison import (
    PAPER_TRIALS,
    Exhibit,
    Statistic,
    accuracy,
    compare,
    largest,
    least,
    mean,
    spread,
    verdict,
)
from tests.missions.reproduction.test_exhibits import exhibits

Draw = Callable[[np.random.Generator, int], FloatArray]


def successes(share: float) -> Draw:
    """Return a function that draws errors of 0 and 10 degrees."""
    return lambda rng, n: np.where(rng.random(n) < share, 0.0, 10.0)


def normal(rng: np.random.Generator, n: int) -> FloatArray:
    return 0.3 + 2.3 * rng.standard_normal(n)


@pytest.mark.parametrize("n_measured", [3600, pytest.param(36_000, marks=pytest.mark.whole)])
@pytest.mark.parametrize(
    ("statistic", "figure", "draw", "most"),
    [
        (accuracy, lambda errors: 100.0 * np.mean(errors == 0.0), successes(0.73), 0.99),
        (accuracy, lambda errors: 100.0 * np.mean(errors == 0.0), successes(0.9987), 1.0),  # counts are discrete
        (mean, np.mean, normal, 0.99),
        (spread, np.std, normal, 0.99),
        (spread, np.std, lambda rng, n: rng.standard_t(7.0, n), 0.99),
        (spread, np.std, lambda rng, n: rng.uniform(-3.0, 3.0, n), 0.99),
    ],
)
def test_prediction_holds_new_trials_in_95_of_100_cases(
    statistic: Statistic, figure: Callable[[FloatArray], float], draw: Draw, most: float, n_measured: int
) -> None:
    rng, n_cases = np.random.default_rng([5, n_measured]), 200
    held = 0
    for _ in range(n_cases):
        low, high = statistic(draw(rng, n_measured)).predicted
        held += low <= figure(draw(rng, PAPER_TRIALS)) <= high
    assert 0.914 < held / n_cases <= most


@pytest.mark.parametrize("statistic", [least, largest])
def test_prediction_holds_the_extremes_of_new_trials(statistic: Statistic) -> None:
    rng, n_cases = np.random.default_rng(6), 100
    held = 0
    for _ in range(n_cases):
        low, high = statistic(np.round(normal(rng, 40 * PAPER_TRIALS))).predicted
        held += low <= statistic(np.round(normal(rng, PAPER_TRIALS))).value <= high
    assert held / n_cases > 0.93


@pytest.mark.whole
def test_verdict_counts_every_printed_number() -> None:
    done = exhibits(200, 3)
    summary, misses = verdict(list(done.values()))
    compared = [row for exhibit in done.values() for row in exhibit.rows if row.is_met is not None]
    n_met = sum(row.is_met is True for row in compared)
    assert summary.startswith(f"{n_met} of the {len(compared)} numbers")
    assert len(compared) == 47
    assert n_met + len(misses) == 47
    assert n_met >= 34


@pytest.mark.parametrize(("paper", "is_met"), [(73.0, True), (79.0, False)])
def test_verdict_names_a_number_that_does_not_agree(paper: float, is_met: bool) -> None:
    errors_deg = np.where(np.arange(8000) % 100 < 73, 2.0, 3.0)  # success is an error of at most two degrees
    row = compare({"label": "10 dB", "paper": paper}, errors_deg)
    assert row.is_met is is_met
    summary, misses = verdict([Exhibit("table1", [row])])
    assert summary.startswith(f"{is_met:d} of the 1 numbers")
    assert [miss.partition(":")[0] for miss in misses] == ([] if is_met else ["Table 1, 10 dB"])
