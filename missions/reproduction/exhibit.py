"""Exhibits: numbers of the paper next to ours, with intervals, and the verdict on all of them."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import betabinom, binomtest, chi2, kurtosis, norm, t

from pdpatrol.missions.reproduction.simulation import SUCCESS_DEG, is_success

FloatArray = NDArray[np.float64]

CHUNK = 200
"""Trials drawn at once. It bounds the memory, and results of a seed depend on it."""

PAPER_TRIALS = 3600
"""Trials of each cell of the paper."""

COVERAGE = 0.95
TAILS = np.array([0.5 - COVERAGE / 2, 0.5 + COVERAGE / 2])


@cache
def published() -> dict[str, Any]:
    """Load every number that the paper prints."""
    return json.loads(Path(__file__).with_name("published.json").read_text(encoding="utf-8"))


class Measured(NamedTuple):
    """Measured number with its 95 % interval, if it has one.

    Attributes:
        value: The number.
        n: Trials that it comes from.
        low: Lower end of the interval.
        high: Upper end.
    """

    value: float
    n: int
    low: float | None = None
    high: float | None = None

    @classmethod
    def share(cls, is_hit: NDArray[np.bool_]) -> Measured:
        """Return the percentage of hits with the exact binomial interval."""
        hits, n = int(is_hit.sum()), is_hit.size
        interval = binomtest(hits, n).proportion_ci(COVERAGE, method="exact")
        return cls(100.0 * hits / n, n, 100.0 * interval.low, 100.0 * interval.high)

    @classmethod
    def mean(cls, errors: FloatArray) -> Measured:
        """Return the mean of errors with its normal interval."""
        value, margin = float(errors.mean()), float(norm.ppf(TAILS[1]) * errors.std()) / np.sqrt(errors.size)
        return cls(value, errors.size, value - margin, value + margin)

    @classmethod
    def spread(cls, errors: FloatArray) -> Measured:
        """Return the root mean square of errors about their mean, with the interval of a normal sample."""
        return cls._deviation(float(errors.std()), errors.size, errors.size - 1)

    @classmethod
    def rms(cls, errors: FloatArray, scale: float) -> Measured:
        """Return the root mean square of errors over `scale`, with the interval of a normal sample."""
        return cls._deviation(float(np.sqrt(np.square(errors).mean())) / scale, errors.size, errors.size)

    @classmethod
    def _deviation(cls, value: float, n: int, degrees: int) -> Measured:
        low, high = (value * float(np.sqrt(degrees / chi2.ppf(q, degrees))) for q in TAILS[::-1])
        return cls(value, n, low, high)


class Prediction(NamedTuple):
    """Interval that holds the number of `PAPER_TRIALS` new trials in 95 of 100 cases.

    The measured number is not taken for the truth: the fewer trials it comes from, the wider the interval.

    Attributes:
        low: Lower end.
        high: Upper end.
    """

    low: float
    high: float

    def holds(self, printed: float) -> bool:
        """Return True if a number printed with two decimals lies in the interval."""
        return self.low - 0.005 <= printed <= self.high + 0.005

    @classmethod
    def of_share(cls, is_hit: NDArray[np.bool_]) -> Prediction:
        """Predict the percentage of hits; beta-binomial, from Jeffreys' prior."""
        hits = int(is_hit.sum())
        ends = betabinom.ppf(TAILS, PAPER_TRIALS, hits + 0.5, is_hit.size - hits + 0.5)
        return cls(*(100.0 * ends / PAPER_TRIALS).tolist())

    @classmethod
    def of_spread(cls, errors: FloatArray) -> Prediction:
        """Predict the root mean square about the mean; its normal limit, for errors of any kurtosis."""
        relative = 0.5 * np.sqrt((kurtosis(errors, fisher=False) - 1.0) * (1.0 / PAPER_TRIALS + 1.0 / errors.size))
        return cls(*(errors.std(ddof=1) * (1.0 + relative * norm.ppf(TAILS))).tolist())

    @classmethod
    def of_mean(cls, errors: FloatArray) -> Prediction:
        """Predict the mean; Student's t distribution."""
        deviation = errors.std(ddof=1) * np.sqrt(1.0 / PAPER_TRIALS + 1.0 / errors.size)
        return cls(*(errors.mean() + deviation * t.ppf(TAILS, errors.size - 1)).tolist())

    @classmethod
    def of_least(cls, errors: FloatArray) -> Prediction:
        """Predict the least error from the distribution of the errors."""
        return cls(*np.quantile(errors, 1.0 - (1.0 - TAILS) ** (1.0 / PAPER_TRIALS)).tolist())

    @classmethod
    def of_largest(cls, errors: FloatArray) -> Prediction:
        """Predict the largest error from the distribution of the errors."""
        return cls(*np.quantile(errors, TAILS ** (1.0 / PAPER_TRIALS)).tolist())

    @classmethod
    def of_one(cls, draws: FloatArray) -> Prediction:
        """Predict one more draw, for any number of trials."""
        return cls(*np.quantile(draws, TAILS).tolist())


@dataclass(frozen=True, kw_only=True)
class Row:
    """One number of the paper next to ours.

    Attributes:
        label: Name of the number.
        paper: Number as printed; None if the paper has none.
        paper_method: Our number by the paper's method.
        best_method: Our number by the best method, scored in the same way.
        unrounded: Share of |error| <= 2 degrees of the best method without rounding to the grid.
        predicted: Where `paper` should lie according to our trials; None if nothing can be predicted.
        unit: Unit of all of them.
        explanation: Likely reason why a printed number does not lie there.
    """

    label: str
    paper: float | None = None
    paper_method: Measured | None = None
    best_method: Measured | None = None
    unrounded: Measured | None = None
    predicted: Prediction | None = None
    unit: str = "%"
    explanation: str | None = None

    @property
    def is_met(self) -> bool | None:
        """True if the printed number lies where predicted; None if they cannot be compared."""
        return None if self.paper is None or self.predicted is None else self.predicted.holds(self.paper)


@dataclass(frozen=True, kw_only=True)
class Exhibit:
    """Table or figure of the paper, or an addition to it.

    Attributes:
        name: Key in the JSON file.
        title: Name in words, a colon, and a description.
        rows: The numbers.
        notes: Methods, errors of the paper, and numbers that cannot be matched.
        results: Further numbers by name.
        data: Arrays by name that its figure needs besides.
    """

    name: str
    title: str
    rows: tuple[Row, ...]
    notes: tuple[str, ...] = ()
    results: dict[str, float] = field(default_factory=dict[str, float])
    data: dict[str, FloatArray] = field(default_factory=dict[str, FloatArray])


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """Number of trials, seed and progress of all exhibits.

    Attributes:
        trials: Trials of each cell.
        seed: Seed; each cell has a separate random generator, so that no cell depends on another.
        tick: Called with the number of trials done since the last call.
    """

    trials: int
    seed: int
    tick: Callable[[int], None]

    def rng(self, exhibit: int, cell: int) -> np.random.Generator:
        """Return the random generator of one cell."""
        return np.random.default_rng([self.seed, exhibit, cell])

    def collect(
        self, exhibit: int, cell: int, draw: Callable[[int, np.random.Generator], tuple[FloatArray, ...]]
    ) -> tuple[FloatArray, ...]:
        """Call `draw` with numbers of trials and the generator of a cell, and join each of the arrays it returns."""
        rng, parts = self.rng(exhibit, cell), list[tuple[FloatArray, ...]]()
        for first in range(0, self.trials, CHUNK):
            n = min(CHUNK, self.trials - first)
            parts.append(draw(n, rng))
            self.tick(n)
        return tuple(np.concatenate(arrays) for arrays in zip(*parts, strict=True))


def accuracy_row(
    label: str,
    paper: float | None,
    paper_deg: FloatArray,
    best_deg: FloatArray | None = None,
    *,
    explanation: str | None = None,
) -> Row:
    """Make a row of shares of success from errors in degrees; those of the paper's method are on the grid already."""
    return Row(
        label=label,
        paper=paper,
        paper_method=Measured.share(is_success(paper_deg)),
        best_method=None if best_deg is None else Measured.share(is_success(best_deg)),
        unrounded=None if best_deg is None else Measured.share(np.abs(best_deg) <= SUCCESS_DEG),
        predicted=Prediction.of_share(is_success(paper_deg)),
        explanation=explanation,
    )


class Miss(NamedTuple):
    """Number of the paper that does not lie where predicted."""

    exhibit: str
    label: str
    unit: str
    printed: float
    predicted: Prediction
    why: str | None

    def __str__(self) -> str:
        """Describe it in a line."""
        low, high = (f"{end:.2f}" for end in self.predicted)
        return f"{self.exhibit}, {self.label}: {self.printed:g} printed, {low} to {high} {self.unit} predicted"


class Verdict(NamedTuple):
    """Number of the paper's numbers that lie where predicted.

    Attributes:
        n_compared: Numbers that can be compared with a prediction.
        n_met: Numbers that lie in it.
        misses: The others, in the order of the exhibits.
    """

    n_compared: int
    n_met: int
    misses: tuple[Miss, ...]

    def __str__(self) -> str:
        """Describe it in a sentence or two."""
        text = (
            f"{self.n_met} of the {self.n_compared} numbers that the paper prints lie where {PAPER_TRIALS} trials by "
            f"its method put them in {100 * COVERAGE:.0f} of 100 cases"
        )
        if not self.misses:
            return f"{text}."
        return f"{text}; by chance alone about {(1.0 - COVERAGE) * self.n_compared:.0f} of them would not. The others:"


def verdict(exhibits: Sequence[Exhibit]) -> Verdict:
    """Compare all printed numbers with their predictions."""
    compared = [(exhibit, row) for exhibit in exhibits for row in exhibit.rows if row.is_met is not None]
    misses = tuple(
        Miss(exhibit.title.partition(":")[0], row.label, row.unit, row.paper, row.predicted, row.explanation)
        for exhibit, row in compared
        if row.paper is not None and row.predicted is not None and not row.is_met
    )
    return Verdict(len(compared), len(compared) - len(misses), misses)
