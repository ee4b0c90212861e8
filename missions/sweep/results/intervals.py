"""Figures of many missions with their 95 % intervals."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

CONFIDENCE = 0.95
RESAMPLES = 2000
"""Bootstrap resamples behind an interval."""

AT_ONCE = 100_000
"""Values that are resampled at once, so that memory does not grow with the number of missions."""


class Interval(NamedTuple):
    """A figure with its 95 % interval; NaN where there is nothing to take it from."""

    value: float
    low: float
    high: float


def share_interval(count: int, total: int) -> Interval:
    """A share with Wilson's interval."""
    from scipy.stats import binomtest

    if not total:
        return Interval(np.nan, np.nan, np.nan)
    low, high = binomtest(count, total).proportion_ci(CONFIDENCE, method="wilson")
    return Interval(count / total, float(low), float(high))


def bootstrap_interval(values: FloatArray, statistic: Callable[..., Any]) -> Interval:
    """A statistic of values, shape (n,), with its percentile bootstrap interval; none below two values."""
    from scipy.stats import bootstrap

    if values.size < 2:
        value = float(values[0]) if values.size else np.nan
        return Interval(value, np.nan, np.nan)
    batch = min(max(AT_ONCE // values.size, 1), RESAMPLES)
    resampled = bootstrap(
        (values,),
        statistic,
        n_resamples=RESAMPLES,
        batch=batch,
        confidence_level=CONFIDENCE,
        method="percentile",
        rng=0,
    )
    low, high = resampled.confidence_interval
    return Interval(float(statistic(values)), float(low), float(high))


def root_mean_square(values: FloatArray, axis: int = -1) -> FloatArray:
    """Root mean square of values along an axis."""
    return np.sqrt(np.mean(np.square(values), axis=axis))
