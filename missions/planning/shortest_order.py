"""Travelling salesman: the shortest closed tour past places whose distances are costly to compute.

Linear programmes with cuts and columns that are generated when needed give a lower bound, and the tours near it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, linprog, milp
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from dirmusic.arrays import BoolArray, FloatArray, IntArray

GAP = 0.02
"""Relative optimality gap at which a search ends. Assumed; paths on the grid of the map are 1.4 % too long on average,
and their lengths from either end differ as much."""

N_NEAREST = 4
"""Number of nearest places to which each place is joined at first. The result does not depend on it."""

NODE_LIMIT = 1000
"""Largest number of nodes of one search. Assumed; tours past a hundred stops take a few."""

TINY = 1e-6
"""Tolerance in comparisons of lengths and of solutions of linear programmes."""


class Order(NamedTuple):
    """Order of a closed tour.

    Attributes:
        order: The places, beginning with the first one, in either direction.
        bound: Lower bound of the lengths of all tours.
    """

    order: tuple[int, ...]
    bound: float


def shortest_order(least: FloatArray, length: Callable[[int, int], float]) -> Order:
    r"""Return the shortest closed tour past n places, starting at the first.

    .. math:: \min \sum_{i < j} d_{ij} x_{ij}, \quad \sum_j x_{ij} = 2, \quad \sum_{i \in S, j \notin S} x_{ij} \geq 2

    for each set S of places that an earlier solution separates from the others: such conditions are added until a
    single tour remains, or until a tour that is made of the solution is within the optimality gap. Only pairs of places
    that could be part of a shorter tour enter, as their reduced costs state, which are computed from lower bounds of
    their lengths. The bound is that of the linear programme.

    Args:
        least: Lower bounds of the path lengths between the places, symmetric, shape (n, n).
        length: Function that returns the path length between two places.

    References:
        Dantzig, Fulkerson and Johnson 1954.
    """
    n = len(least)
    if n <= 3:
        return Order(tuple(range(n)), sum(length(i, (i + 1) % n) for i in range(n)) if n > 1 else 0.0)
    problem = _Problem(least, length)
    guess = short_order(least)
    problem.join(np.column_stack([guess, np.roll(guess, -1)]))
    nearest = np.argsort(least, axis=1, kind="stable")[:, 1 : N_NEAREST + 1]
    problem.join(np.column_stack([np.repeat(np.arange(n), nearest.shape[1]), nearest.ravel()]))
    while True:
        relaxed = problem.relax()
        if not problem.cut(relaxed.x, (0.0, 0.25, 0.5, 0.75)) and not problem.join_best(relaxed, 0.25 * GAP):
            break
    x, loss = relaxed.x, problem.loss(relaxed)
    while True:
        order = _improved(problem.rounded(x), least)
        total = sum(length(order[k - 1], order[k]) for k in range(n))
        is_done = total <= relaxed.bound * (1.0 + GAP) or (not problem.cut(x, (0.5,)) and x is not relaxed.x)
        if is_done:
            start = order.index(0)
            return Order((*order[start:], *order[:start]), min(relaxed.bound - loss, total))
        x = problem.solve()


def _improved(order: list[int], least: FloatArray) -> list[int]:
    """Shorten a tour by turning parts of it round, and by moving parts of up to three places, while either helps.

    Only changes count that join a place with one of the places nearest to it.
    """
    n, tour, position = len(order), np.array(order), np.empty(len(order), dtype=np.intp)
    nearest = np.argsort(least, axis=1, kind="stable")[:, 1 : N_NEAREST + 1]
    place = np.arange(n)
    while True:
        position[tour] = place
        after, best = np.roll(tour, -1), (-TINY, 0, 0, 0)
        step = least[tour, after]
        for size in range(min(3, n - 3) + 1):
            # The part begins behind each place; it is put, turned round, behind another one. Size 0: it ends there.
            first, last, beyond = after, np.roll(tour, -size), np.roll(tour, -size - 1)
            j = np.hstack([position[nearest[last]], (position[nearest[first]] - 1) % n])
            change = least[last[:, np.newaxis], tour[j]] + least[first[:, np.newaxis], after[j]] - step[j]
            change -= (step + least[last, beyond] - least[tour, beyond] if size else step)[:, np.newaxis]
            change[(j - place[:, np.newaxis]) % n <= size] = 0.0
            i, k = np.unravel_index(change.argmin(), change.shape)
            best = min(best, (float(change[i, k]), size, int(i), int(j[i, k])))
        _, size, i, j = best
        if i == j:
            return tour.tolist()
        turned = np.roll(tour, -i - 1)  # the part comes first
        at = (j - i - 1) % n
        part = size or at + 1
        tour = np.concatenate([turned[part : at + 1], turned[:part][::-1], turned[at + 1 :]])


def short_order(least: FloatArray) -> list[int]:
    """Return a short tour past n places with distances (n, n): on to the nearest remaining place, then improved."""
    remaining, order = np.ones(len(least), dtype=np.bool_), [0]
    for _ in range(len(least) - 1):
        remaining[order[-1]] = False
        order.append(int(np.where(remaining, least[order[-1]], np.inf).argmin()))
    return _improved(order, least) if len(order) > 3 else order


class _Relaxed(NamedTuple):
    """Solution of the linear programme.

    Attributes:
        x: Value of each pair that tours may join, shape (n_pairs,).
        bound: Length, a lower bound of the tours of these pairs.
        reduced: Reduced cost of each pair of places if it is as short as possible, shape (n, n).
    """

    x: FloatArray
    bound: float
    reduced: FloatArray


class _Problem:
    """Pairs of places that a tour may join, with their lengths, and the sets that it must not separate."""

    def __init__(self, least: FloatArray, length: Callable[[int, int], float]) -> None:
        self._least, self._length = least, length
        self._is_joined = np.eye(len(least), dtype=np.bool_)
        self.first, self.second = np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp)
        self.lengths = np.empty(0)
        self._sets = np.empty((0, len(least)), dtype=np.bool_)

    def join(self, pairs: IntArray) -> bool:
        """Let tours join pairs of places (n, 2), and return whether any of them is new."""
        pairs = np.unique(np.sort(pairs, axis=1), axis=0)
        pairs = pairs[~self._is_joined[pairs[:, 0], pairs[:, 1]]]
        self._is_joined[pairs[:, 0], pairs[:, 1]] = self._is_joined[pairs[:, 1], pairs[:, 0]] = True
        self.first, self.second = np.append(self.first, pairs[:, 0]), np.append(self.second, pairs[:, 1])
        self.lengths = np.append(self.lengths, [self._length(i, j) for i, j in pairs.tolist()])
        return len(pairs) > 0

    def _reduced(self, relaxed: _Relaxed) -> FloatArray:
        """Return the reduced costs of the pairs that tours cannot join yet, infinite for the others, shape (n, n)."""
        return np.where(self._is_joined, np.inf, relaxed.reduced)

    def loss(self, relaxed: _Relaxed) -> float:
        """Return by how much a tour of pairs that cannot be joined yet could at most be below the bound.

        A tour has two pairs at each place, and each pair counts at two places.
        """
        two = np.partition(self._reduced(relaxed), 1, axis=1)[:, :2]
        return 0.5 * float(np.maximum(-two, 0.0).sum())

    def join_best(self, relaxed: _Relaxed, share: float) -> bool:
        """Let tours join the pairs that promise most, unless `loss` is below a share of the bound; return whether."""
        if self.loss(relaxed) <= max(share * relaxed.bound, TINY):
            return False
        reduced = np.triu(self._reduced(relaxed))
        best = np.argsort(reduced, axis=None)[: len(reduced)]
        pairs = np.column_stack(np.unravel_index(best, reduced.shape))
        return self.join(pairs[reduced.ravel()[best] < -TINY])

    def cut(self, x: FloatArray, thresholds: tuple[float, ...]) -> bool:
        """Add the sets of places that a solution separates from the others, and return whether there are any.

        Sets are the components of the graph of those pairs whose value exceeds a threshold.
        """
        n, separated = len(self._least), list[BoolArray]()
        for threshold in thresholds:
            used = x > threshold + TINY
            graph = csr_array((np.ones(used.sum()), (self.first[used], self.second[used])), shape=(n, n))
            n_sets, own = connected_components(graph, directed=False)
            separated += [own == k for k in range(n_sets)] if n_sets > 1 else []
        sets = np.unique(np.array(separated, dtype=np.bool_).reshape(-1, n), axis=0)
        sets = sets[(sets[:, self.first] != sets[:, self.second]) @ x < 2.0 - 10 * TINY]
        self._sets = np.concatenate([self._sets, sets])
        return len(sets) > 0

    @property
    def _leaving(self) -> csr_array:
        """Matrix that is 1 where a pair leaves a set, shape (n_sets, n_pairs)."""
        return csr_array(self._sets[:, self.first] != self._sets[:, self.second], dtype=np.float64)

    @property
    def _degree(self) -> csr_array:
        """Matrix that is 1 where a pair contains a place, shape (n, n_pairs)."""
        pairs = np.arange(self.first.size)
        place, pair = np.append(self.first, self.second), np.append(pairs, pairs)
        return csr_array((np.ones(place.size), (place, pair)), shape=(len(self._least), pairs.size))

    def rounded(self, x: FloatArray) -> list[int]:
        """Return a tour that joins the pairs with the largest values, and then the nearest ends of the parts."""
        n, (first, second) = len(self._least), np.triu_indices(len(self._least), 1)
        value = np.zeros((n, n))
        value[self.first, self.second] = value[self.second, self.first] = x
        part, neighbours = np.arange(n), [list[int]() for _ in range(n)]
        for k in np.lexsort((self._least[first, second], -value[first, second].round(6))).tolist():
            i, j = int(first[k]), int(second[k])
            if part[i] != part[j] and len(neighbours[i]) < 2 and len(neighbours[j]) < 2:
                part[part == part[j]] = part[i]
                neighbours[i].append(j)
                neighbours[j].append(i)
        order = [next(k for k in range(n) if len(neighbours[k]) == 1)]
        while len(order) < n:
            order.append(next(k for k in neighbours[order[-1]] if k not in order[-2:]))
        return order

    def relax(self) -> _Relaxed:
        """Solve the problem with fractions of pairs."""
        n_sets = len(self._sets)
        cuts = {"A_ub": -self._leaving, "b_ub": np.full(n_sets, -2.0)} if n_sets else {}
        twice = np.full(len(self._least), 2.0)
        solution = linprog(self.lengths, A_eq=self._degree, b_eq=twice, bounds=(0.0, 1.0), **cuts)
        of_place, of_set = solution.eqlin.marginals, -solution.ineqlin.marginals
        inside = self._sets.astype(np.float64)
        price = of_place + of_set @ inside
        both = inside.T @ (of_set[:, np.newaxis] * inside)
        return _Relaxed(solution.x, solution.fun, self._least - price[:, np.newaxis] - price + 2.0 * both)

    def solve(self) -> FloatArray:
        """Solve the problem with whole pairs."""
        constraints = [LinearConstraint(self._degree, 2.0, 2.0)]
        if len(self._sets):
            constraints.append(LinearConstraint(self._leaving, 2.0))
        options = {"mip_rel_gap": GAP, "node_limit": NODE_LIMIT}
        solution = milp(self.lengths, integrality=1, bounds=Bounds(0.0, 1.0), constraints=constraints, options=options)
        if solution.x is None:
            raise RuntimeError(f"no tour was found: {solution.message}")
        return np.round(solution.x)
