"""Distribution of levels of which the low ones were seen from nearby alone: what does not trigger is not there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

LEAST_AT_RISK = 0.1
"""Of all weight that has to be at risk at a level: below, the estimate starts on too little (assumed)."""

MIDDLE = (0.25, 0.75)
"""Of a distribution, the part that its level is the mean of: outliers do not count, and one of two clusters that has a
few more pulses than the other moves it little, where a median would jump."""


class Distribution(NamedTuple):
    """Levels above the lowest that can be told, each with its share; empty where nothing can be told.

    Attributes:
        level_db: Ascending, shape (n,).
        share: Of all levels from the lowest on, shape (n,); their sum is 1.
    """

    level_db: FloatArray
    share: FloatArray

    def above(self, level_db: FloatArray) -> FloatArray:
        """Share of the distribution that is at or above some levels, any shape."""
        from_here = np.append(self.share[::-1].cumsum()[::-1], 0.0)
        return from_here[np.searchsorted(self.level_db, level_db)]

    @property
    def middle_db(self) -> float:
        """Mean of the middle half."""
        upto = self.share.cumsum()
        within = np.diff(np.clip(np.append(0.0, upto), *MIDDLE))
        return float(within @ self.level_db / within.sum())


def product_limit(level_db: FloatArray, least_db: FloatArray, weight: FloatArray) -> Distribution:
    r"""Distribution of levels of which each could be seen only above a bound of its own.

    The product-limit estimator for truncated data: what was seen at a level is compared with what could have been seen
    at it, and was that high,

    .. math:: S(x) = \prod_{x_j < x} \left(1 - \frac{w_j}{\sum_i w_i [l_i \le x_j \le x_i]}\right).

    Args:
        level_db: Levels that were seen, shape (n,).
        least_db: Least level that would have been seen in the place of each, shape (n,).
        weight: How much each counts, >= 0, shape (n,); it must not depend on the level.

    References:
        Lynden-Bell (1971), A method of allowing for known observational selection in small samples applied to 3CR
        quasars, MNRAS 155.
    """
    could = level_db >= least_db
    level_db, least_db, weight = level_db[could], least_db[could], weight[could]
    if level_db.size == 0:
        return Distribution(level_db, weight)
    order = np.argsort(level_db, kind="stable")
    level_db, least_db, weight = level_db[order], least_db[order], weight[order]
    bounds = np.argsort(least_db, kind="stable")
    could_see = np.append(0.0, weight[bounds].cumsum())[np.searchsorted(least_db[bounds], level_db, side="right")]
    below = np.append(0.0, weight.cumsum()[:-1])
    at_risk = could_see - below
    few = np.flatnonzero(at_risk[below < 0.5 * weight.sum()] < LEAST_AT_RISK * weight.sum())
    first = int(few[-1]) + 1 if few.size else 0
    level_db, hazard = level_db[first:], np.minimum(weight[first:] / np.maximum(at_risk[first:], weight[first:]), 1.0)
    left = np.append(1.0, np.cumprod(1.0 - hazard))
    share = -np.diff(left)
    return Distribution(level_db, share / share.sum()) if share.sum() > 0.0 else Distribution(level_db[:0], share[:0])
