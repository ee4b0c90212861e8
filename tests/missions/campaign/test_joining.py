"""Findings of several dates are joined if they are the same discharge."""

import numpy as np

from pdpatrol.missions.campaign.inspection import join_findings, mean_position
from tests.missions.campaign.surveys import located

WEST, EAST = (10.0, 10.0, 1.6), (12.0, 10.0, 1.6)


def test_discharges_two_metres_apart_stay_separate_over_six_dates() -> None:
    rng, places = np.random.default_rng(0), np.array([WEST, EAST])
    dates = [[located(tuple(place)) for place in rng.permutation(rng.normal(places, 0.1))] for _ in range(6)]
    joined = join_findings(dates)
    assert len(joined) == 2
    for found in joined:
        assert len(found) == 6
        assert np.ptp([finding.position_m[0] for finding in found.values()]) < 1.0
        assert min(np.linalg.norm(mean_position(found)[0] - place) for place in places) < 0.15


def test_discharge_has_one_finding_in_each_inspection() -> None:
    first, second = join_findings([[located(WEST)], [located(WEST), located((10.2, 10.0, 1.6))]])
    assert sorted((len(first), len(second))) == [1, 2]
    np.testing.assert_array_equal(first[1].position_m, WEST)


def test_distant_finding_is_another_discharge_unless_it_is_uncertain() -> None:
    assert len(join_findings([[located(WEST, 0.1)], [located(EAST, 0.1)]])) == 2
    assert len(join_findings([[located(WEST, 0.1)], [located(EAST, 1.0)]])) == 1
    assert join_findings([[], []]) == []


def test_candidate_joins_a_discharge_and_makes_none() -> None:
    candidates = located(WEST, is_confirmed=False), located(EAST, 0.2, is_confirmed=False)
    (joined,) = join_findings([[candidates[0]], [located(WEST)], [candidates[1]]])
    assert sorted(joined) == [0, 1]
    (alone,) = join_findings([[located(WEST)], [located(WEST, 5.0, is_confirmed=False)]])
    assert sorted(alone) == [0]  # compatible with any discharge nearby
