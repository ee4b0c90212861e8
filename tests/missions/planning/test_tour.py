"""Shortest tours."""

from collections.abc import Sequence
from itertools import pairwise, permutations

import numpy as np
import pytest

from pdpatrol.missions.planning.shortest_order import shortest_order, tour_bound
from pdpatrol.missions.planning.tour import ShortestTours
from tests.missions.planning.one_plan import FloatArray, plan_of


def length(order: Sequence[int], lengths_m: FloatArray) -> float:
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
        near = np.argsort(lengths_m, axis=1)[:, 1:]
        order = shortest_order(np.arange(n_stops + 1), lengths_m, near).tolist()
        assert sorted(order) == list(range(n_stops + 1))
        shortest_m = brute_force(lengths_m)
        assert length(order, lengths_m) == pytest.approx(shortest_m, abs=1e-6)
        assert tour_bound(lengths_m, length(order, lengths_m)) <= shortest_m + 1e-6


@pytest.mark.parametrize(("n_stops", "seed"), [(60, 1), (150, 2), (300, 3)])
def test_long_tour_is_near_its_bound(n_stops: int, seed: int) -> None:
    """The tour improves on the one given, and no tour found by other means is shorter than the bound."""
    rng = np.random.default_rng(seed)
    places_m = np.round(rng.uniform(0.0, 200.0, (n_stops, 2)) / 6.0) * 6.0 + rng.normal(0.0, 0.3, (n_stops, 2))
    direct_m = np.linalg.norm(places_m[:, np.newaxis] - places_m, axis=-1)
    detour = rng.uniform(1.0, 1.1, direct_m.shape)
    lengths_m = direct_m * np.maximum(detour, detour.T)
    near = np.argsort(lengths_m, axis=1)[:, 1:11]
    order = shortest_order(np.arange(n_stops), lengths_m, near).tolist()
    bound_m = tour_bound(lengths_m, length(order, lengths_m))
    assert sorted(order) == list(range(n_stops))
    assert bound_m <= length(order, lengths_m) <= 1.03 * bound_m
    for start in range(n_stops):
        assert length(nearest_first(start, lengths_m), lengths_m) >= bound_m
    again = shortest_order(np.array(order), lengths_m, near).tolist()
    assert length(again, lengths_m) <= length(order, lengths_m) + 1e-6


def nearest_first(start: int, lengths_m: FloatArray) -> list[int]:
    """Return the tour on to the nearest place that is left."""
    order, left = [start], set(range(len(lengths_m))) - {start}
    while left:
        order.append(min(left, key=lambda k: lengths_m[order[-1], k]))
        left.remove(order[-1])
    return order


@pytest.mark.parametrize("name", ["one_source", "5007", "5009"])
def test_planned_tour_is_the_shortest(name: str) -> None:
    plan = plan_of(name)
    tours = ShortestTours(plan.site_map)
    cells = [tours.dock, *plan.tour.stops.tolist()]
    assert 2 <= len(cells) <= 9
    lengths_m = np.array([[tours.paths.length_m(i, j) for j in cells] for i in cells])
    assert plan.bound_m <= brute_force(lengths_m) + 1e-6
    assert plan.tour.length_m == pytest.approx(brute_force(lengths_m), abs=1e-6)
    assert plan.tour.length_m == pytest.approx(np.linalg.norm(np.diff(plan.path_m, axis=0), axis=-1).sum())


def test_paths_are_symmetric_and_tour_order_is_unique() -> None:
    tours, stops = ShortestTours(plan_of("one_source").site_map), plan_of("one_source").tour.stops.tolist()
    for i, j in pairwise(stops):
        np.testing.assert_array_equal(tours.paths.path(i, j), tours.paths.path(j, i)[::-1])
        assert tours.paths.length_m(i, j) == tours.paths.length_m(j, i)
    first, *others = [tours.shortest(order) for order in (stops, stops[::-1], sorted(stops))]
    assert all(other == first for other in others)
    tour, turned = tours.in_order(first), tours.in_order(first[::-1])
    np.testing.assert_array_equal(turned.cells, tour.cells[::-1])
    assert tour.cells[0] == tour.cells[-1] == tours.dock
