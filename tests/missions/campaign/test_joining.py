"""Findings of several dates that are one discharge."""

import numpy as np

from pdpatrol.missions.campaign.joining import join
from tests.missions.campaign.surveys import located

WEST, EAST = (10.0, 10.0, 1.6), (12.0, 10.0, 1.6)


def test_two_discharges_two_metres_apart_stay_two_over_six_dates() -> None:
    rng, places = np.random.default_rng(0), np.array([WEST, EAST])
    dates = [[located(tuple(place)) for place in rng.permutation(rng.normal(places, 0.1))] for _ in range(6)]
    joined = join(dates)
    assert len(joined) == 2
    for each in joined:
        assert len(each.found) == 6
        assert np.ptp([finding.position_m[0] for finding in each.found.values()]) < 1.0
        assert min(np.linalg.norm(each.position_m - place) for place in places) < 0.15


def test_each_finding_is_of_one_discharge_and_each_discharge_has_one_at_most() -> None:
    first, second = join([[located(WEST)], [located(WEST), located((10.2, 10.0, 1.6))]])
    assert sorted((len(first.found), len(second.found))) == [1, 2]
    np.testing.assert_array_equal(first.found[1].position_m, WEST)


def test_what_is_found_elsewhere_is_another_discharge_unless_it_is_known_poorly() -> None:
    assert len(join([[located(WEST, 0.1)], [located(EAST, 0.1)]])) == 2
    assert len(join([[located(WEST, 0.1)], [located(EAST, 1.0)]])) == 1


def test_a_candidate_joins_a_discharge_and_makes_none() -> None:
    (joined,) = join([[located(WEST, is_confirmed=False)], [located(WEST)], [located(EAST, 0.2, is_confirmed=False)]])
    assert sorted(joined.found) == [0, 1]
    (alone,) = join([[located(WEST)], [located(WEST, 5.0, is_confirmed=False)]])
    assert sorted(alone.found) == [0]  # it may be anywhere


def test_nothing_found_is_nothing_joined() -> None:
    assert join([[], []]) == ()
