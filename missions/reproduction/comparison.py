"""Comparison of the paper's numbers with ours: statistics of errors, their predictions, and the verdict."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike
from scipy.stats import betabinom, binomtest, chi2, kurtosis, norm, t

from dirmusic.arrays import FloatArray

SUCCESS_DEG = 2
"""Largest error that counts as a success. The paper writes "less than"; its numbers mean "at most"."""

PAPER_TRIALS = 3600
"""Trials of each cell of the paper."""

TAILS = np.array([0.025, 0.975])
"""Quantiles at the ends of all intervals."""


@cache
def published() -> dict[str, Any]:
    """Load titles, numbers and misprints of the paper's tables and figures; the numbers are already corrected."""
    return json.loads(Path(__file__).with_name("published.json").read_text(encoding="utf-8"))


@dataclass(frozen=True)
class Measured:
    """Statistic of the errors of many trials.

    Attributes:
        value: The statistic.
        interval: Its 95 % interval, or empty.
        predicted: 95 % prediction interval for the statistic of `PAPER_TRIALS` new trials. Fewer measured trials make
            it wider, because it includes the uncertainty of the measured value.
    """

    value: float
    interval: list[float]
    predicted: list[float]


Statistic = Callable[[FloatArray], Measured]


def _measured(value: float, interval: ArrayLike, predicted: ArrayLike) -> Measured:
    """Make a record with plain Python numbers, which JSON can represent."""
    return Measured(float(value), np.asarray(interval).tolist(), np.asarray(predicted).tolist())


def accuracy(errors_deg: FloatArray) -> Measured:
    """Return the percentage of successes, with an exact binomial interval and a beta-binomial prediction (Jeffreys)."""
    hits, n = int((np.abs(errors_deg) <= SUCCESS_DEG + 1e-9).sum()), errors_deg.size
    interval = binomtest(hits, n).proportion_ci()
    predicted = betabinom.ppf(TAILS, PAPER_TRIALS, hits + 0.5, n - hits + 0.5) / PAPER_TRIALS
    return _measured(100.0 * hits / n, 100.0 * np.array(interval), 100.0 * predicted)


def mean(errors: FloatArray) -> Measured:
    """Return the mean, with a normal interval and a prediction from Student's t distribution."""
    value, n = errors.mean(), errors.size
    interval = value + norm.ppf(TAILS) * errors.std() / np.sqrt(n)
    predicted = value + errors.std(ddof=1) * np.sqrt(1.0 / PAPER_TRIALS + 1.0 / n) * t.ppf(TAILS, n - 1)
    return _measured(value, interval, predicted)


def spread(errors: FloatArray) -> Measured:
    """Return the standard deviation, with the interval of a normal sample and an asymptotic prediction.

    The prediction holds for any kurtosis; it takes the sample standard deviation as normal, the limit for many trials.
    """
    n = errors.size
    interval = errors.std() * np.sqrt((n - 1) / chi2.ppf(TAILS[::-1], n - 1))
    relative_std = 0.5 * np.sqrt((kurtosis(errors, fisher=False) - 1.0) * (1.0 / PAPER_TRIALS + 1.0 / n))
    return _measured(errors.std(), interval, errors.std(ddof=1) * (1.0 + relative_std * norm.ppf(TAILS)))


def least(errors: FloatArray) -> Measured:
    """Return the least error and predict that of new trials from the distribution of the errors."""
    return _measured(errors.min(), [], np.quantile(errors, 1.0 - (1.0 - TAILS) ** (1.0 / PAPER_TRIALS)))


def largest(errors: FloatArray) -> Measured:
    """Return the largest error and predict that of new trials from the distribution of the errors."""
    return _measured(errors.max(), [], np.quantile(errors, TAILS ** (1.0 / PAPER_TRIALS)))


def one_draw(draws: FloatArray) -> Measured:
    """Return the median of draws with their central 90 %, and predict one more draw."""
    return _measured(np.median(draws), np.quantile(draws, [0.05, 0.95]), np.quantile(draws, TAILS))


@dataclass(frozen=True)
class Row:
    """One number of the paper, compared with our results.

    Attributes:
        label: Name of the number.
        unit: Unit of all numbers.
        paper: Number as printed; None if the paper has none.
        paper_method: Our number by the paper's method.
        best_method: Our number by the best method, scored in the same way.
        unrounded: Our number by the best method without rounding to the grid.
    """

    label: str
    unit: str
    paper: float | None
    paper_method: Measured
    best_method: Measured | None = None
    unrounded: Measured | None = None

    @property
    def is_met(self) -> bool | None:
        """True if the number, printed with two decimals, lies in its predicted interval; None if none is printed."""
        low, high = self.paper_method.predicted
        return None if self.paper is None else low - 0.005 <= self.paper <= high + 0.005


def compare(printed: Mapping[str, Any], *errors_deg: FloatArray, statistic: Statistic = accuracy) -> Row:
    """Make a row.

    Args:
        printed: Label and number of the paper.
        errors_deg: Errors by the paper's method, by the best method rounded to the grid, and by the best method
            unrounded; those of the paper's method are already on the grid.
        statistic: Statistic of the errors that the paper prints.
    """
    unit = "%" if statistic is accuracy else "deg"
    return Row(printed["label"], unit, printed["paper"], *map(statistic, errors_deg))


@dataclass(frozen=True)
class Exhibit:
    """Table or figure of the paper.

    Attributes:
        name: Key in the JSON files, and name of the picture.
        rows: The numbers; empty for a figure without any.
        draw: Function that draws the figure; None to draw the rows as bars.
        more_notes: Notes on our numbers.
    """

    name: str
    rows: list[Row]
    draw: Callable[[], Figure] | None = None
    more_notes: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        """Name in words, a colon, and a description."""
        return published()[self.name]["title"]

    @property
    def notes(self) -> list[str]:
        """Methods, errors of the paper, and numbers that cannot be matched."""
        return [*published()[self.name]["notes"], *self.more_notes]


def verdict(exhibits: Sequence[Exhibit]) -> tuple[str, list[str]]:
    """Compare all printed numbers with their predictions.

    Returns:
        A summary, and a line for each number that lies outside its predicted interval.
    """
    compared = [(exhibit, row) for exhibit in exhibits for row in exhibit.rows if row.paper is not None]
    misses = [
        f"{exhibit.title.partition(':')[0]}, {row.label}: {row.paper:g} printed, "
        f"{' to '.join(f'{end:.2f}' for end in row.paper_method.predicted)} {row.unit} predicted; "
        f"{published()[exhibit.name].get('explanation', 'it may be chance')}"
        for exhibit, row in compared
        if not row.is_met
    ]
    n = len(compared)
    summary = (
        f"{n - len(misses)} of the {n} numbers that the paper prints lie where {PAPER_TRIALS} trials by its method put "
        f"them in 95 of 100 cases; by chance alone about {0.05 * n:.0f} of them would not."
    )
    return summary, misses
