"""Travelling salesman: a short closed tour past places, and a lower bound of the length of all such tours."""

from __future__ import annotations

import numpy as np

from dirmusic.arrays import FloatArray, IntArray
from dirmusic.compiled import compiled, compiled_inner

MOST_KICKS = 500
"""Largest number of changes at random after which a tour is improved again. Assumed; up to thirty places, more find no
shorter tour."""

KICKS_EACH = 20
"""The same for each place of the tour. Assumed; up to a dozen places, the shortest tour is found with less."""

LONGEST_PART = 3
"""Largest number of places that are moved together; see Or 1976."""

LONGEST_KICK = 30
"""Largest number of places in each of the two parts that a change at random swaps."""

N_ASCENTS = 600
"""Number of steps of the ascent to the lower bound. Assumed; more raise it by less than 0.1 %."""

TINY = 1e-9
"""Smallest reduction of a length that counts."""


def shortest_order(order: IntArray, lengths: FloatArray, near: IntArray) -> IntArray:
    """Return a short closed tour past all places, not longer than a given one.

    Parts of the tour are reversed, and parts of up to three places are moved, while either makes the tour shorter; then
    two neighbouring parts at random are swapped and the tour is improved again. Up to a dozen places, the tour is the
    shortest.

    Args:
        order: A closed tour past n places, shape (n,).
        lengths: Path lengths between the places, symmetric, shape (n, n).
        near: Places to which each place may be joined anew, the nearest first, shape (n, n_near).

    References:
        Or 1976; Bentley 1992; Martin, Otto and Felten 1991.
    """
    n = len(order)
    if n <= 3:
        return order
    rng, longest = np.random.default_rng(0), min(LONGEST_KICK, (n - 2) // 2)
    n_kicks = min(KICKS_EACH * n, MOST_KICKS)
    kicks = np.column_stack([rng.integers(n, size=n_kicks), rng.integers(1, longest + 1, (n_kicks, 2))])
    return _improve(order, lengths, near, kicks)


@compiled
def _improve(order: IntArray, lengths: FloatArray, near: IntArray, kicks: IntArray) -> IntArray:
    """Shorten a tour, also after each of some swaps of two parts: position before the first, and both sizes."""
    n = order.size
    tour, position, is_open = order.copy(), np.empty(n, np.int64), np.ones(n, np.bool_)
    for k in range(n):
        position[tour[k]] = k
    _descend(tour, position, is_open, lengths, near)
    best = tour.copy()
    for at, first, second in kicks:
        a, b = tour[at], tour[(at + 1) % n]
        c, d = tour[(at + first) % n], tour[(at + first + 1) % n]
        e, f = tour[(at + first + second) % n], tour[(at + first + second + 1) % n]
        change = lengths[a, d] + lengths[e, b] + lengths[c, f] - lengths[a, b] - lengths[c, d] - lengths[e, f]
        _move(tour, position, at + 1, first, second, False)
        for place in (a, b, c, d, e, f):
            is_open[place] = True
        change += _descend(tour, position, is_open, lengths, near)
        if change < -TINY:
            best[:] = tour
        else:
            tour[:] = best
            for k in range(n):
                position[tour[k]] = k
    return best


@compiled_inner
def _descend(tour: IntArray, position: IntArray, is_open: IntArray, lengths: FloatArray, near: IntArray) -> float:
    """Shorten a tour from its open places until none is open, and return the change of its length."""
    total, is_shorter = 0.0, True
    while is_shorter:
        is_shorter = False
        for place in range(tour.size):
            while is_open[place]:
                change = _reversal(tour, position, is_open, lengths, near, place)
                if change == 0.0:
                    change = _relocation(tour, position, is_open, lengths, near, place)
                is_open[place] = change < 0.0
                is_shorter |= change < 0.0
                total += change
    return total


@compiled_inner
def _reversal(
    tour: IntArray, position: IntArray, is_open: IntArray, lengths: FloatArray, near: IntArray, a: int
) -> float:
    """Reverse a part of the tour so that a place gets a nearer neighbour; return the change of length, 0 if none."""
    n = tour.size
    for step in (1, -1):
        b = tour[(position[a] + step) % n]
        for c in near[a]:
            if lengths[a, c] >= lengths[a, b]:
                break
            d = tour[(position[c] + step) % n]
            change = lengths[a, c] + lengths[b, d] - lengths[a, b] - lengths[c, d]
            if change < -TINY and c != b and d != a:
                begin, last = (position[b], position[c]) if step == 1 else (position[a], position[d])
                _reverse(tour, position, begin, (last - begin) % n + 1)
                is_open[a] = is_open[b] = is_open[c] = is_open[d] = True
                return change
    return 0.0


@compiled_inner
def _relocation(
    tour: IntArray, position: IntArray, is_open: IntArray, lengths: FloatArray, near: IntArray, a: int
) -> float:
    """Move a part of the tour that ends in a place next to a nearer one; return the change of length, 0 if none."""
    n = tour.size
    for size in range(1, min(LONGEST_PART, n - 3) + 1):
        for step in (1, -1):  # the part extends from the place along or against the tour
            z = tour[(position[a] + step * (size - 1)) % n]
            before, after = tour[(position[a] - step) % n], tour[(position[z] + step) % n]
            gain = lengths[before, a] + lengths[z, after] - lengths[before, after]
            for c in near[a]:
                if lengths[a, c] >= gain:
                    break
                offset = (position[c] - position[a]) * step % n
                if offset < size:
                    continue
                for side in (1, -1):  # between c and the place on either side of it
                    d = tour[(position[c] + side * step) % n]
                    change = lengths[a, c] + lengths[z, d] - lengths[c, d] - gain
                    if change < -TINY and (position[d] - position[a]) * step % n >= size:
                        first = position[a] if step == 1 else position[z]
                        is_reversed = side == -1
                        end = c if side == step else d  # the part follows this place
                        _move(tour, position, first, size, (position[end] - first - size + 1) % n, is_reversed)
                        for place in (a, z, before, after, c, d):
                            is_open[place] = True
                        return change
    return 0.0


@compiled_inner
def _reverse(tour: IntArray, position: IntArray, begin: int, size: int) -> None:
    """Reverse the part of a tour that begins at a position, or the rest of the tour if that is shorter."""
    n = tour.size
    if 2 * size > n:
        begin, size = begin + size, n - size
    for k in range(size // 2):
        i, j = (begin + k) % n, (begin + size - 1 - k) % n
        tour[i], tour[j] = tour[j], tour[i]
        position[tour[i]], position[tour[j]] = i, j


@compiled_inner
def _move(tour: IntArray, position: IntArray, begin: int, size: int, over: int, is_reversed: bool) -> None:
    """Move the part of a tour that begins at a position behind the next `over` places, reversed or not."""
    n = tour.size
    part = np.empty(size, np.int64)
    for k in range(size):
        part[size - 1 - k if is_reversed else k] = tour[(begin + k) % n]
    for k in range(over + size):
        at = (begin + k) % n
        tour[at] = tour[(begin + k + size) % n] if k < over else part[k - over]
        position[tour[at]] = at


def tour_bound(lengths: FloatArray, longest: float) -> float:
    r"""Return a lower bound of the length of all closed tours past n places.

    For any prices :math:`\pi_i`, a shortest 1-tree with lengths :math:`d_{ij} + \pi_i + \pi_j` is not longer than a
    shortest tour, less :math:`2 \sum_i \pi_i`: each tour is a 1-tree. The prices ascend along the subgradient, which is
    the degree of each place in the tree less two.

    Args:
        lengths: Lower bounds of the path lengths between the places, symmetric, shape (n, n).
        longest: Length of any tour.

    References:
        Held and Karp 1971.
    """
    n = len(lengths)
    return _ascend(lengths, longest) if n > 3 else float(sum(lengths[k, k - 1] for k in range(n)))


@compiled
def _ascend(lengths: FloatArray, longest: float) -> float:
    n = len(lengths)
    price, last, best, scale, n_worse = np.zeros(n), np.zeros(n), 0.0, 1.0, 0
    for _ in range(N_ASCENTS):
        bound, excess = _one_tree(lengths, price)
        if bound > best + 1e-4 * longest * scale:
            n_worse = 0
        else:
            n_worse += 1
        best = max(best, bound)
        squares = (excess * excess).sum()
        if squares == 0.0:
            break  # the tree is a tour
        if n_worse == 8:
            scale, n_worse = 0.7 * scale, 0
        direction = 0.7 * excess + 0.3 * last
        price += scale * max(longest - bound, 1e-3 * longest) / squares * direction
        last = direction
    return best


@compiled_inner
def _one_tree(lengths: FloatArray, price: FloatArray) -> tuple[float, FloatArray]:
    """Return the length of the shortest 1-tree less twice the prices, and the degree of each place less two.

    A 1-tree is a tree that spans all places but the first, which is joined to two of the others.
    """
    n = len(lengths)
    excess, joined, away = np.full(n, -2.0), np.zeros(n, np.int64), np.full(n, np.inf)
    is_inside = np.zeros(n, np.bool_)
    total, new = -2.0 * price.sum(), 1
    for _ in range(n - 2):
        is_inside[new] = True
        nearest = -1
        for k in range(1, n):
            if not is_inside[k]:
                length = lengths[new, k] + price[new] + price[k]
                if length < away[k]:
                    away[k], joined[k] = length, new
                if nearest < 0 or away[k] < away[nearest]:
                    nearest = k
        total += away[nearest]
        excess[nearest] += 1.0
        excess[joined[nearest]] += 1.0
        new = nearest
    two = np.argsort(lengths[0, 1:] + price[1:])[:2] + 1
    for k in two:
        total += lengths[0, k] + price[0] + price[k]
        excess[k] += 1.0
    excess[0] = 0.0
    return total, excess
