"""Numbers of the paper against what its method gives: predictions hold what they claim, misses are told."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pdpatrol.missions.reproduction.exhibit import Exhibit
from pdpatrol.missions.reproduction.output.write import write_reproduction
from pdpatrol.missions.reproduction.prediction import PAPER_TRIALS, Prediction
from pdpatrol.missions.reproduction.reproduce import reproduce
from pdpatrol.missions.reproduction.verdict import verdict

FloatArray = NDArray[np.float64]
Draw = Callable[[np.random.Generator, int], FloatArray]

TRIALS = 200


@cache
def exhibits() -> tuple[Exhibit, ...]:
    return reproduce(TRIALS, 3, lambda share: None)


def hits(rng: np.random.Generator, n: int) -> FloatArray:
    return (rng.random(n) < 0.73).astype(float)


def rare_misses(rng: np.random.Generator, n: int) -> FloatArray:
    return (rng.random(n) < 0.9987).astype(float)


def normal(rng: np.random.Generator, n: int) -> FloatArray:
    return 0.3 + 2.3 * rng.standard_normal(n)


def heavy(rng: np.random.Generator, n: int) -> FloatArray:
    return rng.standard_t(7.0, n)


def flat(rng: np.random.Generator, n: int) -> FloatArray:
    return rng.uniform(-3.0, 3.0, n)


@pytest.mark.parametrize("n_measured", [3600, 36_000])
@pytest.mark.parametrize(
    ("predict", "figure", "draw"),
    [
        (lambda x: Prediction.of_share(x > 0.5), lambda x: 100.0 * x.mean(), hits),
        (lambda x: Prediction.of_share(x > 0.5), lambda x: 100.0 * x.mean(), rare_misses),
        (Prediction.of_mean, np.mean, normal),
        (Prediction.of_spread, np.std, normal),
        (Prediction.of_spread, np.std, heavy),
        (Prediction.of_spread, np.std, flat),
    ],
)
def test_a_prediction_holds_the_figure_of_new_trials_in_95_of_100_cases(
    predict: Callable[[FloatArray], Prediction], figure: Callable[[FloatArray], float], draw: Draw, n_measured: int
) -> None:
    rng, n_cases = np.random.default_rng([5, n_measured]), 600
    held = 0
    for _ in range(n_cases):
        low, high = predict(draw(rng, n_measured))
        held += low <= figure(draw(rng, PAPER_TRIALS)) <= high
    assert 0.95 - 4 * np.sqrt(0.95 * 0.05 / n_cases) < held / n_cases
    assert held / n_cases < (0.99 if draw is not rare_misses else 1.0)  # counts of few are coarse


@pytest.mark.parametrize(("predict", "figure"), [(Prediction.of_least, np.min), (Prediction.of_largest, np.max)])
def test_the_extremes_of_new_trials_lie_where_predicted(
    predict: Callable[[FloatArray], Prediction], figure: Callable[[FloatArray], float]
) -> None:
    rng, n_cases = np.random.default_rng(6), 300
    drawn = [(np.round(normal(rng, 40 * PAPER_TRIALS)), np.round(normal(rng, PAPER_TRIALS))) for _ in range(n_cases)]
    held = sum(predict(measured).holds(figure(new)) for measured, new in drawn)
    assert held / n_cases > 0.93


def test_the_verdict_counts_every_number_and_names_those_that_are_not_met() -> None:
    found = verdict(exhibits())
    compared = [row for exhibit in exhibits() for row in exhibit.rows if row.is_compared]
    assert found.n_compared == len(compared) == 47
    assert found.n_met + len(found.misses) == found.n_compared
    assert found.n_met >= 34
    told = {(miss.exhibit, miss.label): miss for miss in found.misses}
    slip = told["Sample rate", "0.5 GS/s"]
    assert "half the samples" in (slip.why or "")
    assert str(slip).startswith("Sample rate, 0.5 GS/s: 91.64 printed, ")


def test_a_number_that_no_trials_give_is_a_miss_and_one_that_they_give_is_none() -> None:
    first = exhibits()[0]
    row = first.rows[-1]
    assert row.paper_method is not None
    for paper, is_met in ((row.paper_method.value, True), (row.paper_method.value + 6.0, False)):
        changed = replace(first, rows=(replace(row, paper=paper),))
        found = verdict([changed])
        assert (found.n_met == 1) is is_met
        assert [miss.label for miss in found.misses] == ([] if is_met else [row.label])
        assert all(miss.why is None for miss in found.misses)


@pytest.mark.whole
def test_page_and_json_tell_the_verdict_and_hold_all_exhibits(tmp_path: Path) -> None:
    shares: list[float] = []
    data = write_reproduction(exhibits(), TRIALS, 3, tmp_path, shares.append)
    assert sum(shares) == pytest.approx(1.0)
    assert json.loads((tmp_path / "reproduction.json").read_text()) == data
    found, page = verdict(exhibits()), (tmp_path / "reproduction.html").read_text()
    assert data["verdict"]["n_met"] == found.n_met
    assert [miss["label"] for miss in data["verdict"]["misses"]] == [miss.label for miss in found.misses]
    assert str(found) in page
    assert all(f'<section id="{exhibit.name}">' in page for exhibit in exhibits())
    assert page.count("<svg role") == len(list(tmp_path.glob("*.png"))) == 12
    assert page.count("http") == page.count("http://www.w3.org/")  # nothing is loaded
