"""Predictions hold what they claim, and the verdict names the printed numbers that do not agree."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from pdpatrol.missions.reproduction.exhibit import PAPER_TRIALS, Exhibit, Prediction, accuracy_row, verdict
from tests.missions.reproduction.test_exhibits import exhibits

FloatArray = NDArray[np.float64]
Draw = Callable[[np.random.Generator, int], FloatArray]


def hits(share: float) -> Draw:
    return lambda rng, n: (rng.random(n) < share).astype(float)


def normal(rng: np.random.Generator, n: int) -> FloatArray:
    return 0.3 + 2.3 * rng.standard_normal(n)


def heavy_tailed(rng: np.random.Generator, n: int) -> FloatArray:
    return rng.standard_t(7.0, n)


def uniform(rng: np.random.Generator, n: int) -> FloatArray:
    return rng.uniform(-3.0, 3.0, n)


@pytest.mark.parametrize("n_measured", [3600, 36_000])
@pytest.mark.parametrize(
    ("predict", "figure", "draw", "most"),
    [
        (lambda x: Prediction.of_share(x > 0.5), lambda x: 100.0 * x.mean(), hits(0.73), 0.99),
        (lambda x: Prediction.of_share(x > 0.5), lambda x: 100.0 * x.mean(), hits(0.9987), 1.0),  # counts are coarse
        (Prediction.of_mean, np.mean, normal, 0.99),
        (Prediction.of_spread, np.std, normal, 0.99),
        (Prediction.of_spread, np.std, heavy_tailed, 0.99),
        (Prediction.of_spread, np.std, uniform, 0.99),
    ],
)
def test_prediction_holds_new_trials_in_95_of_100_cases(
    predict: Callable[[FloatArray], Prediction],
    figure: Callable[[FloatArray], float],
    draw: Draw,
    most: float,
    n_measured: int,
) -> None:
    rng, n_cases = np.random.default_rng([5, n_measured]), 600
    held = 0
    for _ in range(n_cases):
        low, high = predict(draw(rng, n_measured))
        held += low <= figure(draw(rng, PAPER_TRIALS)) <= high
    assert 0.95 - 4 * np.sqrt(0.95 * 0.05 / n_cases) < held / n_cases <= most


@pytest.mark.parametrize(("predict", "figure"), [(Prediction.of_least, np.min), (Prediction.of_largest, np.max)])
def test_prediction_holds_the_extremes_of_new_trials(
    predict: Callable[[FloatArray], Prediction], figure: Callable[[FloatArray], float]
) -> None:
    rng, n_cases = np.random.default_rng(6), 300
    drawn = [(np.round(normal(rng, 40 * PAPER_TRIALS)), np.round(normal(rng, PAPER_TRIALS))) for _ in range(n_cases)]
    held = sum(predict(measured).holds(figure(new)) for measured, new in drawn)
    assert held / n_cases > 0.93


@pytest.mark.whole
def test_verdict_counts_every_printed_number() -> None:
    done = exhibits(200, 3)
    found = verdict(tuple(done.values()))
    compared = [row for exhibit in done.values() for row in exhibit.rows if row.is_met is not None]
    assert found.n_compared == len(compared) == 47
    assert found.n_met + len(found.misses) == found.n_compared
    assert found.n_met >= 34
    (slip,) = [miss for miss in found.misses if (miss.exhibit, miss.label) == ("Sample rate", "0.5 GS/s")]
    assert "half the samples" in (slip.why or "")
    assert str(slip).startswith("Sample rate, 0.5 GS/s: 91.64 printed, ")


@pytest.mark.parametrize(("paper", "is_met"), [(73.0, True), (79.0, False)])
def test_verdict_names_a_number_that_does_not_agree(paper: float, is_met: bool) -> None:
    errors_deg = np.where(np.arange(8000) % 100 < 73, 0.0, 5.0)
    exhibit = Exhibit(name="table", title="Table: accuracy", rows=(accuracy_row("10 dB", paper, errors_deg),))
    found = verdict([exhibit])
    assert (found.n_met == 1) is is_met
    assert [miss.label for miss in found.misses] == ([] if is_met else ["10 dB"])
