"""Cover: few stops from which every target is heard under enough aperture, as an integer programme."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dirmusic.angles import aperture, difference, wrap
from pdpatrol.missions.planning.hearing import Hearing
from pdpatrol.missions.planning.looks import TINY_RAD

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

SPACING_M = 2.0
"""Side of the squares of the ground of which each gives one candidate for a stop (assumed): stops are moved to any cell
afterwards, and a yard of 44 by 33 m has some four hundred."""

GAP, NODE_LIMIT = 0.25, 500
"""A cover ends within this share of the fewest stops, or after so many nodes of its search (assumed): what the way
makes needless is left out afterwards, so that a stop more costs little."""


def apertures(hearing: Hearing, columns: IntArray | slice = slice(None)) -> FloatArray:
    """Aperture under which each target is heard from some columns, shape (n_targets,)."""
    pairs = zip(hearing.aspect_rad[:, columns], hearing.is_heard[:, columns], strict=True)
    return np.array([aperture(aspect_rad[heard]) for aspect_rad, heard in pairs])


def candidates(hearing: Hearing, clearance_m: FloatArray, needed_rad: FloatArray) -> IntArray:
    """Columns among which stops are chosen: the clearest of each square of the ground, and what targets need besides.

    Args:
        hearing: Where targets are heard from.
        clearance_m: Of the cells, shape (n_cells,).
        needed_rad: Aperture of each target that has to be within reach, shape (n_targets,).

    Returns:
        Ascending.
    """
    square = np.floor(hearing.places_m / SPACING_M).astype(np.intp) @ np.array([1_000_000, 1])
    hears = np.flatnonzero(hearing.is_heard.any(axis=0))
    hears = hears[np.lexsort((-clearance_m[hears], square[hears]))]
    chosen = np.zeros(square.size, dtype=np.bool_)
    chosen[hears[np.unique(square[hears], return_index=True)[1]]] = True
    for k, needed in enumerate(needed_rad - TINY_RAD):
        own = np.flatnonzero(hearing.is_heard[k])
        aspect_rad = hearing.aspect_rad[k, own]
        if own.size and aperture(aspect_rad[chosen[own]]) < needed:
            chosen[own[_ends(aspect_rad)]] = True
        while own.size and aperture(aspect_rad[chosen[own]]) < needed:
            off_rad = np.abs(difference(aspect_rad[:, np.newaxis], aspect_rad[chosen[own]])).min(axis=1)
            chosen[own[off_rad.argmax()]] = True
        if own.size and not chosen[own].any():
            chosen[own[clearance_m[own].argmax()]] = True
    return np.flatnonzero(chosen).astype(np.intp)


def _ends(aspect_rad: FloatArray) -> IntArray:
    """The two angles, by number, between which the narrowest arc lies that holds all of them (n,)."""
    angle = wrap(aspect_rad)
    order = np.argsort(angle, kind="stable")
    gaps = np.diff(angle[order], append=angle[order[0]] + 2 * np.pi)
    widest = int(gaps.argmax())
    return order[[widest, (widest + 1) % order.size]]


def cover(hearing: Hearing, columns: IntArray, needed_rad: FloatArray) -> IntArray:
    r"""Few columns over which each target that is heard at all has the aperture that it needs.

    The aspects of the chosen columns have an aperture of at least :math:`w` if and only if no arc narrower than that
    holds them all; it is enough to ask this of arcs that start at the aspect :math:`\theta_j` of a column that hears:

    .. math:: \min \sum_k x_k, \quad \sum_{k: \, (\theta_k - \theta_j) \bmod 2 \pi \, \geq w} x_k \geq 1

    for all targets and all their columns j.

    Args:
        hearing: Where targets are heard from.
        columns: Among which to choose.
        needed_rad: Aperture that each target needs, no more than that of all these columns, shape (n_targets,).

    Returns:
        Some of the columns, ascending.
    """
    from scipy.optimize import Bounds, LinearConstraint, milp  # here, so that a command line help need not wait for it
    from scipy.sparse import csr_array

    conditions: list[BoolArray] = []
    for k in np.flatnonzero(~hearing.is_blind):
        heard = hearing.is_heard[k, columns]
        aspect_rad = hearing.aspect_rad[k, columns]
        along = np.mod(aspect_rad - aspect_rad[heard][:, np.newaxis] + 0.5 * TINY_RAD, 2 * np.pi)
        outside = heard & (along >= needed_rad[k] - 0.5 * TINY_RAD)
        conditions.append(_strictest(outside) if needed_rad[k] > 0.0 else heard[np.newaxis])
    if not conditions:
        return np.empty(0, dtype=np.intp)
    rows = csr_array(np.concatenate(conditions).astype(np.float64))
    found = milp(
        np.ones(columns.size),
        integrality=np.ones(columns.size, dtype=np.intp),
        bounds=Bounds(0.0, 1.0),
        constraints=LinearConstraint(rows, 1.0, np.inf),
        options={"mip_rel_gap": GAP, "node_limit": NODE_LIMIT},
    )
    if found.x is None:
        raise RuntimeError(f"no cover of the yard was found: {found.message}")
    return columns[np.asarray(found.x) > 0.5]


def _strictest(conditions: BoolArray) -> BoolArray:
    """Those of the conditions (n, n_columns), one column at least of each, that no other one implies."""
    conditions = np.unique(conditions, axis=0)
    columns = conditions.astype(np.float64)
    implies = columns @ (1.0 - columns).T == 0.0  # all columns of one are columns of the other
    np.fill_diagonal(implies, val=False)
    return conditions[~implies.any(axis=0)]
