"""The shortest closed tour past some stops, as an integer programme."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdpatrol.missions.planning.ways import Ways

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

NODE_LIMIT = 10_000
"""Nodes of a search after which the best tour so far counts (assumed): some twenty stops take a few."""


class Tour(NamedTuple):
    """A closed way from the dock past stops and back.

    Attributes:
        stops: Cells of the stops in order, without the dock, shape (n_stops,).
        cells: All cells on the way, shape (n,); the dock's is the first and the last.
        length_m: Its length.
    """

    stops: IntArray
    cells: IntArray
    length_m: float


def tour_in_order(ways: Ways, dock: int, stops: Sequence[int]) -> Tour:
    """The tour that takes the stops in the order given."""
    legs = list(pairwise((dock, *stops, dock)))
    cells = np.concatenate([[dock], *(ways.between(*leg).cells[1:] for leg in legs)]).astype(np.intp)
    return Tour(np.array(stops, dtype=np.intp), cells, sum(ways.length_m(*leg) for leg in legs))


def shortest_tour_of(ways: Ways, dock: int, stops: Sequence[int]) -> Tour:
    """The shortest tour past all stops; of its two directions that whose first stop has the smaller number."""
    cells = [dock, *stops]
    order = [cells[k] for k in shortest_order(ways.lengths_m(cells))[1:]]
    return tour_in_order(ways, dock, order if order[:1] <= order[-1:] else order[::-1])


def shortest_order(lengths_m: FloatArray) -> tuple[int, ...]:
    r"""The shortest closed tour past all of n places, from the first on; its direction has no meaning.

    .. math:: \min \sum_{i < j} d_{ij} x_{ij}, \quad \sum_j x_{ij} = 2, \quad \sum_{i \in S, j \notin S} x_{ij} \geq 2

    for all sets S of places that a solution without that condition has joined to a tour of their own: such conditions
    are added until there is one tour.

    Args:
        lengths_m: Of the ways between them, symmetric, shape (n, n).

    References:
        Dantzig, Fulkerson and Johnson 1954.
    """
    from scipy.optimize import Bounds, LinearConstraint, milp  # here, so that a command line help need not wait for it
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    n = len(lengths_m)
    if n <= 3:
        return tuple(range(n))
    first, second = np.triu_indices(n, 1)
    place = np.arange(n)[:, np.newaxis]
    rows = [csr_array(((first == place) | (second == place)).astype(np.float64))]
    constraints = [LinearConstraint(rows[0], 2.0, 2.0)]
    while True:
        found = milp(
            lengths_m[first, second],
            integrality=np.ones(first.size, dtype=np.intp),
            bounds=Bounds(0.0, 1.0),
            constraints=constraints,
            options={"mip_rel_gap": 0.0, "node_limit": NODE_LIMIT},
        )
        chosen = np.flatnonzero(np.asarray(found.x) > 0.5)
        joined = csr_array((np.ones(chosen.size), (first[chosen], second[chosen])), shape=(n, n))
        n_tours, tour = connected_components(joined, directed=False)
        if n_tours == 1:
            return _walk(first[chosen], second[chosen])
        for k in range(n_tours):
            leaves = (tour[first] == k) != (tour[second] == k)
            constraints.append(LinearConstraint(csr_array(leaves[np.newaxis].astype(np.float64)), 2.0, np.inf))


def _walk(first: IntArray, second: IntArray) -> tuple[int, ...]:
    """Places in the order in which the edges of one tour join them, from place 0 on."""
    neighbours: dict[int, list[int]] = {}
    for a, b in zip(first.tolist(), second.tolist(), strict=True):
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    order = [0, min(neighbours[0])]
    while len(order) < len(neighbours):
        before, here = order[-2:]
        order.append(next(place for place in neighbours[here] if place != before))
    return tuple(order)
