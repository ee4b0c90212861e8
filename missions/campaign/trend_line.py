"""A line through levels over weeks, with an interval that is honest for few inspections."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

LEAST_DATES = 3
"""Of a line with an interval: two points lie on a line whatever they are."""

CONFIDENCE = 0.99
"""Of intervals: a yard has many sites and many campaigns, and one wrong alarm in twenty would be too many."""


class TrendLine(NamedTuple):
    """A weighted line.

    Attributes:
        slope: Per week.
        half_width: Of its interval of `CONFIDENCE`.
        at_start: Value at week 0.
        scatter: Standard deviation between inspections, beyond what each one states.
    """

    slope: float
    half_width: float
    at_start: float
    scatter: float

    @property
    def lower(self) -> float:
        """End of the interval of the slope."""
        return self.slope - self.half_width

    @property
    def upper(self) -> float:
        """End of the interval of the slope."""
        return self.slope + self.half_width

    def at(self, week: FloatArray) -> FloatArray:
        """Values of the line, any shape."""
        return self.at_start + self.slope * week


def fit_line(week: FloatArray, value: FloatArray, std: FloatArray) -> TrendLine | None:
    r"""A line through values of which each has a deviation of its own, and all one more in common.

    No two inspections see a source alike: beyond what each one states, :math:`s_i`, values scatter by
    :math:`\tau`, as large as makes the residuals as wide as they are told to be,

    .. math:: \sum_i \frac{(y_i - a - b t_i)^2}{s_i^2 + \tau^2} = n - 2,

    or 0 where they are narrower than that. So few residuals tell :math:`\tau` poorly: the interval takes the quantile
    of Student's t with n - 2 degrees of freedom.

    Args:
        week: When, shape (n,).
        value: What was measured then, shape (n,).
        std: Its standard deviation, > 0, shape (n,).

    Returns:
        None for values of fewer than `LEAST_DATES` times.

    References:
        Paule and Mandel (1982), Consensus values and weighting factors, J. Res. NBS 87.
    """
    if np.unique(week).size < LEAST_DATES:
        return None
    from scipy.optimize import brentq
    from scipy.stats import t

    n_free = week.size - 2

    def excess(scatter2: float) -> float:
        line = _weighted(week, value, std**2 + scatter2)
        return float((np.square(value - line.at_start - line.slope * week) / (std**2 + scatter2)).sum() - n_free)

    most = max(float(np.ptp(value)) ** 2, 1e-12) * week.size
    scatter2 = float(brentq(excess, 0.0, most)) if excess(0.0) > 0.0 else 0.0  # pyright: ignore[reportArgumentType]
    line = _weighted(week, value, std**2 + scatter2)
    half_width = float(t.ppf(0.5 + 0.5 * CONFIDENCE, n_free)) * line.slope_std
    return TrendLine(line.slope, half_width, line.at_start, float(np.sqrt(scatter2)))


class _Weighted(NamedTuple):
    slope: float
    at_start: float
    slope_std: float


def _weighted(week: FloatArray, value: FloatArray, variance: FloatArray) -> _Weighted:
    """Least squares with known variances."""
    weight = 1.0 / variance
    middle, mean = float(weight @ week / weight.sum()), float(weight @ value / weight.sum())
    spread = float(weight @ np.square(week - middle))
    slope = float(weight @ ((week - middle) * (value - mean))) / spread
    return _Weighted(slope, mean - slope * middle, float(spread**-0.5))
