"""Where a number that the paper prints would lie if its trials were made again, by its method as measured here."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import betabinom, kurtosis, norm, t

FloatArray = NDArray[np.float64]

PAPER_TRIALS = 3600
"""Of each cell of the paper."""

COVERAGE = 0.95

ROUNDING = 0.005
"""Of the paper's numbers: two decimals."""

_TAILS = np.array([0.5 - COVERAGE / 2, 0.5 + COVERAGE / 2])


class Prediction(NamedTuple):
    """An interval that holds the figure of `PAPER_TRIALS` new trials in 95 of 100 cases.

    What was measured is not taken for the truth: the fewer trials it comes from, the wider the interval.

    Attributes:
        low: Its lower end.
        high: Its upper end.
    """

    low: float
    high: float

    def holds(self, printed: float) -> bool:
        """Whether a number lies in it, as far as it is printed."""
        return self.low - ROUNDING <= printed <= self.high + ROUNDING

    @classmethod
    def of_share(cls, is_hit: NDArray[np.bool_]) -> Prediction:
        """Of the per cent of hits; beta-binomial, from Jeffreys' prior."""
        hits = int(is_hit.sum())
        ends = betabinom.ppf(_TAILS, PAPER_TRIALS, hits + 0.5, is_hit.size - hits + 0.5)
        return cls(*(100.0 * ends / PAPER_TRIALS).tolist())

    @classmethod
    def of_spread(cls, errors: FloatArray) -> Prediction:
        """Of the root mean square about the mean; its normal limit, for errors of any kurtosis."""
        relative = 0.5 * np.sqrt((kurtosis(errors, fisher=False) - 1.0) * (1.0 / PAPER_TRIALS + 1.0 / errors.size))
        return cls(*(errors.std(ddof=1) * (1.0 + relative * norm.ppf(_TAILS))).tolist())

    @classmethod
    def of_mean(cls, errors: FloatArray) -> Prediction:
        """Of the mean; Student's t distribution."""
        deviation = errors.std(ddof=1) * np.sqrt(1.0 / PAPER_TRIALS + 1.0 / errors.size)
        return cls(*(errors.mean() + deviation * t.ppf(_TAILS, errors.size - 1)).tolist())

    @classmethod
    def of_least(cls, errors: FloatArray) -> Prediction:
        """Of the least one; as the errors themselves are distributed."""
        return cls(*np.quantile(errors, 1.0 - (1.0 - _TAILS) ** (1.0 / PAPER_TRIALS)).tolist())

    @classmethod
    def of_largest(cls, errors: FloatArray) -> Prediction:
        """Of the largest one; as the errors themselves are distributed."""
        return cls(*np.quantile(errors, _TAILS ** (1.0 / PAPER_TRIALS)).tolist())

    @classmethod
    def of_one(cls, draws: FloatArray) -> Prediction:
        """Of one more draw, whatever the paper's trials."""
        return cls(*np.quantile(draws, _TAILS).tolist())
