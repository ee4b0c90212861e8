"""Shares of many cases, with their intervals."""

import numpy as np
import pytest

from pdpatrol.missions.sweep.analysis import Estimate, wilson


def few_or_many(few: int, many: int) -> pytest.MarkDecorator:
    """Parametrize with a few cases for CI and many slow ones."""
    return pytest.mark.parametrize(
        "n_cases", [pytest.param(few, marks=pytest.mark.whole), pytest.param(many, marks=pytest.mark.slow)]
    )


def share(what: str, count: int, total: int) -> Estimate:
    """Print and return a share with its 95 % Wilson interval; 0 to 1 without cases."""
    interval = wilson(count, total) if total else Estimate(np.nan, 0.0, 1.0)
    value, low, high = (100 * end for end in interval)
    print(f"  {what}: {count} of {total}, {value:.1f} % ({low:.1f} to {high:.1f})")
    return interval
