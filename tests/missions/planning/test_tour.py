"""Shortest tours."""

from itertools import pairwise, permutations

import numpy as np
import pytest

from pdpatrol.missions.planning.tour import ShortestTours, shortest_order
from tests.missions.planning.one_plan import FloatArray, plan_of


def length(order: tuple[int, ...], lengths_m: FloatArray) -> float:
    return float(sum(lengths_m[a, b] for a, b in pairwise((*order, order[0]))))


def brute_force(lengths_m: FloatArray) -> float:
    return min(length((0, *rest), lengths_m) for rest in permutations(range(1, len(lengths_m))))


@pytest.mark.parametrize("n_stops", range(1, 9))
def test_shortest_order_equals_brute_force(n_stops: int) -> None:
    rng = np.random.default_rng(n_stops)
    for clusters in (1, 3):  # distant clusters first give separate tours
        middle_m = rng.uniform(0.0, 100.0 * (clusters - 1), (clusters, 2))
        places_m = middle_m[rng.integers(clusters, size=n_stops + 1)] + rng.uniform(0.0, 10.0, (n_stops + 1, 2))
        lengths_m = np.linalg.norm(places_m[:, np.newaxis] - places_m, axis=-1)
        order = shortest_order(lengths_m)
        assert order[0] == 0
        assert sorted(order) == list(range(n_stops + 1))
        assert length(order, lengths_m) == pytest.approx(brute_force(lengths_m), abs=1e-6)


@pytest.mark.parametrize("name", ["one_source", "5007", "5009"])
def test_planned_tour_is_the_shortest(name: str) -> None:
    plan = plan_of(name)
    tours = ShortestTours(plan.site_map)
    cells = [tours.dock, *plan.tour.stops.tolist()]
    assert 2 <= len(cells) <= 9
    assert plan.tour.length_m == pytest.approx(brute_force(tours.lengths_m(cells)), abs=1e-6)
    assert plan.tour.length_m == pytest.approx(np.linalg.norm(np.diff(plan.path_m, axis=0), axis=-1).sum())


def test_paths_are_symmetric_and_tour_order_is_unique() -> None:
    tours, stops = ShortestTours(plan_of("one_source").site_map), plan_of("one_source").tour.stops.tolist()
    np.testing.assert_array_equal(tours.lengths_m(stops), tours.lengths_m(stops).T)
    first, *others = [tours.shortest(order) for order in (stops, stops[::-1], sorted(stops))]
    assert all(np.array_equal(other.cells, first.cells) for other in others)
    assert first.cells[0] == first.cells[-1] == tours.dock
