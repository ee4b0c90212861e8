"""The line through levels, and its interval, which holds the truth as often as it says."""

import numpy as np
import pytest

from pdpatrol.missions.campaign.trend_line import fit_line

WEEKS = np.arange(6.0)


def test_values_on_a_line_give_that_line() -> None:
    line = fit_line(WEEKS, 2.0 + 3.0 * WEEKS, np.full(6, 0.5))
    assert line is not None
    assert (line.slope, line.at_start, line.scatter) == pytest.approx((3.0, 2.0, 0.0))
    assert line.lower < 3.0 < line.upper
    np.testing.assert_allclose(line.at(np.array([0.0, 10.0])), [2.0, 32.0])


@pytest.mark.parametrize(("scatter", "n_weeks"), [(0.0, 6), (1.0, 6), (1.0, 4), (3.0, 12)])
def test_the_interval_holds_the_slope_in_99_of_100_campaigns(scatter: float, n_weeks: int) -> None:
    rng, weeks, n = np.random.default_rng(3), np.arange(float(n_weeks)), 2000
    held = 0
    for _ in range(n):
        std = rng.uniform(0.3, 1.2, n_weeks)
        line = fit_line(weeks, 0.7 * weeks + rng.normal(0.0, np.hypot(std, scatter)), std)
        assert line is not None
        held += line.lower <= 0.7 <= line.upper
    assert held / n >= 0.98


def test_an_inspection_that_tells_less_counts_less() -> None:
    value = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 9.0])
    sure, vague = (fit_line(WEEKS, value, np.array([0.5] * 5 + [last])) for last in (0.5, 9.0))
    assert sure is not None
    assert vague is not None
    assert vague.slope < 0.1 < 1.0 < sure.slope


def test_two_dates_are_no_line() -> None:
    assert fit_line(np.array([0.0, 0.0, 1.0]), np.zeros(3), np.ones(3)) is None
    assert fit_line(np.array([0.0, 1.0, 2.0]), np.zeros(3), np.ones(3)) is not None
