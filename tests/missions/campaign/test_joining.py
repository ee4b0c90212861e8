"""Findings of several dates are joined if they are the same discharge."""

import numpy as np
import pytest

from pdpatrol.missions.campaign.inspection import LocatedFinding, join_findings, mean_position

WEST, EAST = (10.0, 10.0, 1.6), (12.0, 10.0, 1.6)


def located(place_m: tuple[float, ...], std_m: float = 0.1, state: str = "confirmed") -> LocatedFinding:
    return LocatedFinding(1, state, np.array(place_m), std_m**2 * np.eye(3))


def test_discharges_two_metres_apart_stay_separate_over_six_dates() -> None:
    rng, places = np.random.default_rng(0), np.array([WEST, EAST])
    dates = [[located(tuple(place)) for place in rng.permutation(rng.normal(places, 0.1))] for _ in range(6)]
    joined = join_findings(dates)
    assert [len(found) for found in joined] == [6, 6]
    means = sorted(mean_position(found.values())[0].tolist() for found in joined)
    np.testing.assert_allclose(means, places, atol=0.15)


@pytest.mark.parametrize(
    ("dates", "joined"),
    [
        ([[], []], []),
        ([[located(WEST)], [located((10.2, 10.0, 1.6)), located(WEST)]], [[0, 1], [1]]),
        ([[located(WEST)], [located(EAST)]], [[0], [1]]),
        ([[located(WEST)], [located(EAST, 1.0)]], [[0, 1]]),
        ([[located(WEST, state="candidate")], [located(WEST)], [located(EAST, 0.2, "candidate")]], [[0, 1]]),
        ([[located(WEST)], [located(WEST, 5.0, "candidate")]], [[0]]),  # compatible with any discharge nearby
    ],
    ids=["none", "one of each date", "distant", "uncertain", "candidate", "uncertain candidate"],
)
def test_findings_of_one_discharge_are_joined(dates: list[list[LocatedFinding]], joined: list[list[int]]) -> None:
    found = join_findings(dates)
    assert [sorted(each) for each in found] == joined
    assert all(each[1].position_m[0] == 10.0 for each in found[:1] if len(each) == 2 and len(dates[1]) == 2)
