"""Shortest tours."""

from itertools import pairwise, permutations

import numpy as np
import pytest

from pdpatrol.missions.planning.shortest_order import GAP, shortest_order
from pdpatrol.missions.planning.tour import ShortestTours
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
        order, bound = shortest_order(0.9 * lengths_m, lambda i, j: lengths_m[i, j])  # noqa: B023
        assert order[0] == 0
        assert sorted(order) == list(range(n_stops + 1))
        assert bound <= brute_force(lengths_m) + 1e-6
        assert length(order, lengths_m) <= bound * (1.0 + GAP) + 1e-6


@pytest.mark.parametrize(("n_stops", "seed"), [(60, 1), (150, 2)])
def test_long_tour_is_within_the_gap_of_an_honest_bound(n_stops: int, seed: int) -> None:
    """No tour found by other means is shorter than the bound, although only some of the lengths are computed."""
    rng = np.random.default_rng(seed)
    places_m = np.round(rng.uniform(0.0, 200.0, (n_stops, 2)) / 6.0) * 6.0 + rng.normal(0.0, 0.3, (n_stops, 2))
    direct_m = np.linalg.norm(places_m[:, np.newaxis] - places_m, axis=-1)
    detour = rng.uniform(1.0, 1.1, direct_m.shape)
    lengths_m, known = direct_m * np.maximum(detour, detour.T), set[tuple[int, int]]()

    def length_m(i: int, j: int) -> float:
        known.add((min(i, j), max(i, j)))
        return lengths_m[i, j]

    order, bound = shortest_order(direct_m, length_m)
    assert sorted(order) == list(range(n_stops))
    assert bound <= length(order, lengths_m) <= bound * (1.0 + GAP)
    assert len(known) < 0.35 * n_stops * (n_stops - 1) / 2
    for start in range(n_stops):
        here, left = start, set(range(n_stops)) - {start}
        nearest = [start]
        while left:
            here = min(left, key=lambda k: lengths_m[here, k])
            left.remove(here)
            nearest.append(here)
        assert length(tuple(nearest), lengths_m) >= bound


@pytest.mark.parametrize("name", ["one_source", "5007", "5009"])
def test_planned_tour_is_nearly_the_shortest(name: str) -> None:
    plan = plan_of(name)
    tours = ShortestTours(plan.site_map)
    cells = [tours.dock, *plan.tour.stops.tolist()]
    assert 2 <= len(cells) <= 9
    lengths_m = np.array([[tours.paths.length_m(i, j) for j in cells] for i in cells])
    assert plan.tour.bound_m <= brute_force(lengths_m) + 1e-6
    assert plan.tour.length_m == pytest.approx(brute_force(lengths_m), rel=0.03)
    assert plan.tour.length_m == pytest.approx(np.linalg.norm(np.diff(plan.path_m, axis=0), axis=-1).sum())


def test_paths_are_symmetric_and_tour_order_is_unique() -> None:
    tours, stops = ShortestTours(plan_of("one_source").site_map), plan_of("one_source").tour.stops.tolist()
    for i, j in pairwise(stops):
        np.testing.assert_array_equal(tours.paths.path(i, j), tours.paths.path(j, i)[::-1])
        assert tours.paths.length_m(i, j) == tours.paths.length_m(j, i)
    first, *others = [tours.shortest(order) for order in (stops, stops[::-1], sorted(stops))]
    assert all(np.array_equal(other.cells, first.cells) for other in others)
    assert first.cells[0] == first.cells[-1] == tours.dock
