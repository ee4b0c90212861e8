"""Set cover: few stops from which every target is detectable over enough aperture, as an integer programme."""

from __future__ import annotations

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, linprog, milp
from scipy.sparse import csr_array

from dirmusic.angles import aperture, difference, wrap
from dirmusic.arrays import BoolArray, FloatArray, IntArray
from dirmusic.compiled import compiled, compiled_inner
from pdpatrol.missions.planning.detectability import Detectability

GAP = 0.25
"""Relative optimality gap at which the search for the fewest stops ends. Assumed; stops that the path makes unnecessary
are removed afterwards, so one more stop costs little."""

TINY_RAD = 1e-9
"""Tolerance in comparisons of angles."""

CROSSING_RAD = np.radians(45.0)
"""Angle at which lines of sight should cross. Assumed; lines of sight from two opposite sides are parallel, whatever
the aperture, and do not determine the position along them."""

MIN_CELLS = 12
"""Number of cells of the path from which a target should be detectable. Assumed; these 3 m give, at 20 pulses per
second, nearly four times the pulses needed to confirm a finding."""


def coverage(detectability: Detectability, cells: IntArray) -> FloatArray:
    """Return how well some reachable cells of the map cover all targets, shape (n_targets, 3); see `coverage_of`."""
    is_seen = np.zeros(detectability.cells.size, dtype=np.bool_)
    is_seen[detectability.columns(cells)] = True
    return coverage_of(detectability, is_seen, np.arange(len(detectability.names)))


def coverage_of(detectability: Detectability, is_seen: BoolArray, targets: IntArray) -> FloatArray:
    """Return how well some columns cover targets, shape (n_targets, 3).

    Args:
        detectability: Places from which targets are detectable.
        is_seen: Mask of the columns, shape (n_cells,).
        targets: Indices of the targets, shape (n_targets,).

    Returns:
        Aperture in radians: the narrowest arc that contains the aspects of all cells that detect the target; the same
        for lines of sight, whose two directions are equivalent, so at most 90 degrees; number of cells that detect the
        target.
    """
    return _coverage(detectability.first, detectability.column, detectability.aspect_rad, is_seen, targets)


@compiled
def _coverage(
    first: IntArray, column: IntArray, aspect_rad: FloatArray, is_seen: BoolArray, targets: IntArray
) -> FloatArray:
    """Return the coverage of targets from their pairs, which are sorted by aspect."""
    covered = np.zeros((targets.size, 3))
    for row, target in enumerate(targets):
        covered[row] = coverage_of_one(first, column, aspect_rad, is_seen, target)
    return covered


@compiled_inner
def coverage_of_one(
    first: IntArray, column: IntArray, aspect_rad: FloatArray, is_seen: BoolArray, target: int
) -> FloatArray:
    """Return the coverage of one target, shape (3,), in compiled functions; see `coverage_of`."""
    pairs = np.arange(first[target], first[target + 1])
    seen_rad = aspect_rad[pairs[is_seen[column[pairs]]]]
    crossing_rad = 0.5 * _spread(np.sort(np.mod(2.0 * seen_rad, 2.0 * np.pi)))
    return np.array([_spread(seen_rad), min(crossing_rad, 0.5 * np.pi), float(seen_rad.size)])


@compiled_inner
def _spread(ascending_rad: FloatArray) -> float:
    """Return the aperture of ascending angles, 0 for less than two; see `angles.aperture`."""
    n = ascending_rad.size
    widest_rad = 2.0 * np.pi - (ascending_rad[n - 1] - ascending_rad[0]) if n > 0 else 2.0 * np.pi
    for k in range(n - 1):
        widest_rad = max(widest_rad, ascending_rad[k + 1] - ascending_rad[k])
    return 2.0 * np.pi - widest_rad


def candidates(detectability: Detectability, clearance_m: FloatArray, required_rad: FloatArray) -> IntArray:
    """Return columns to choose stops from: the one with most clearance in each square, and more if targets need them.

    Squares have sides of 2 m (assumed): stops move to other cells afterwards, and a yard of 44 m by 33 m has about 400
    squares.

    Args:
        detectability: Places from which targets are detectable.
        clearance_m: Clearance of the cells, shape (n_cells,).
        required_rad: Aperture of each target that the candidates must offer, shape (n_targets,).

    Returns:
        Columns, ascending.
    """
    square = np.floor(detectability.places_m / 2.0).astype(np.intp) @ np.array([1_000_000, 1])
    useful = np.unique(detectability.column)
    useful = useful[np.lexsort((-clearance_m[useful], square[useful]))]
    chosen = np.zeros(square.size, dtype=np.bool_)
    chosen[useful[np.unique(square[useful], return_index=True)[1]]] = True
    for k in np.flatnonzero(~detectability.is_blind).tolist():
        pairs, required = detectability.pairs(k), required_rad[k] - TINY_RAD
        own, aspect_rad = detectability.column[pairs], detectability.aspect_rad[pairs]
        if aperture(aspect_rad[chosen[own]]) < required:
            chosen[own[_ends(aspect_rad)]] = True
        while aperture(aspect_rad[chosen[own]]) < required:
            off_rad = np.abs(difference(aspect_rad[:, np.newaxis], aspect_rad[chosen[own]])).min(axis=1)
            chosen[own[off_rad.argmax()]] = True
        if not chosen[own].any():
            chosen[own[clearance_m[own].argmax()]] = True
    return np.flatnonzero(chosen)


def _ends(aspect_rad: FloatArray) -> IntArray:
    """Return the indices of the two angles that bound the narrowest arc that contains all angles (n,)."""
    angle = wrap(aspect_rad)
    order = np.argsort(angle, kind="stable")
    gaps = np.diff(angle[order], append=angle[order[0]] + 2 * np.pi)
    widest = int(gaps.argmax())
    return order[[widest, (widest + 1) % order.size]]


def cover(detectability: Detectability, columns: IntArray, required_rad: FloatArray) -> IntArray:
    r"""Choose few columns that offer each detectable target the aperture that it requires.

    The aspects of the chosen columns have an aperture of at least :math:`w` if and only if no narrower arc contains
    them all. It is enough to require this of arcs that start at the aspect :math:`\theta_j` of a column that detects
    the target:

    .. math:: \min \sum_k x_k, \quad \sum_{k: \, (\theta_k - \theta_j) \bmod 2 \pi \, \geq w} x_k \geq 1

    for all targets and all their columns j. The programme is first solved with fractions, and then in whole numbers
    with the columns that this solution uses.

    Args:
        detectability: Places from which targets are detectable.
        columns: Columns to choose from.
        required_rad: Aperture that each target requires, at most that of all these columns, shape (n_targets,).

    Returns:
        Some of the columns, ascending.
    """
    is_candidate = np.zeros(detectability.cells.size, dtype=np.bool_)
    is_candidate[columns] = True
    conditions = [np.empty(0, dtype=np.intp)]
    for k in np.flatnonzero(~detectability.is_blind).tolist():
        pairs = detectability.pairs(k)
        own, aspect_rad = detectability.column[pairs], detectability.aspect_rad[pairs]
        own, aspect_rad = own[is_candidate[own]], aspect_rad[is_candidate[own]]
        along = np.mod(aspect_rad - aspect_rad[:, np.newaxis] + 0.5 * TINY_RAD, 2 * np.pi)
        outside = along >= required_rad[k] - 0.5 * TINY_RAD
        rows = _strictest(outside) if required_rad[k] > 0.0 else np.ones((1, own.size), dtype=np.bool_)
        conditions += [own[row] for row in rows]
    n_terms = [len(own) for own in conditions]
    term = np.searchsorted(columns, np.concatenate(conditions))
    matrix = csr_array((np.ones(term.size), term, np.cumsum(n_terms)), shape=(len(conditions) - 1, columns.size))
    if matrix.shape[0] == 0:
        return np.empty(0, dtype=np.intp)
    relaxed = linprog(np.ones(columns.size), A_ub=-matrix, b_ub=-np.ones(matrix.shape[0]), bounds=(0.0, 1.0))
    if relaxed.x is None:
        raise RuntimeError(f"no cover of the yard was found: {relaxed.message}")
    used = np.flatnonzero(relaxed.x > 1e-7)  # tolerance of the solver
    solution = milp(
        np.ones(used.size),
        integrality=1,
        bounds=Bounds(0.0, 1.0),
        constraints=LinearConstraint(matrix[:, used], 1.0),
        options={"mip_rel_gap": GAP, "node_limit": 500},
    )
    if solution.x is None:
        raise RuntimeError(f"no cover of the yard was found: {solution.message}")
    return columns[used[solution.x > 0.5]]


def _strictest(conditions: BoolArray) -> BoolArray:
    """Return the conditions (n, n_columns), each met by at least one of its columns, that no other one implies."""
    conditions = np.unique(conditions, axis=0)
    columns = conditions.astype(np.float64)
    implies = columns @ (1.0 - columns).T == 0.0  # all columns of one are columns of the other
    np.fill_diagonal(implies, val=False)
    return conditions[~implies.any(axis=0)]
