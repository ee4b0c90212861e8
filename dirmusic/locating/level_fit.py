"""Position of one emitter from received levels: posterior on a grid that is refined, and whether it is located."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp
from scipy.stats import chi2

from dirmusic.arrays import FloatArray
from dirmusic.locating.level_model import LevelLikelihood, LevelModel, LevelRows

N_COARSE = 1600
"""Number of cells of the first grid (assumed). Errors of a decibel and more make the likelihood smooth over a cell."""

NEGLECTED = 1e-3
"""Part of the posterior in cells that are not refined (assumed)."""

MAX_REFINED = 1000
"""Number of cells beyond which the posterior is wide enough for the cells that it has (assumed)."""

CELLS_PER_STD = 3.0
"""Number of cells per standard deviation at which the refinement ends (assumed)."""

LARGEST_PART = 0.5
"""Longest semi-axis of the 95 % ellipse of a located emitter, relative to the median range (assumed): beyond, levels
state a direction at most."""

MAX_AT_BORDER = 0.01
"""Probability in the outermost cells of the box beyond which the emitter may as well be outside (assumed)."""


class LevelEstimate(NamedTuple):
    """Posterior of the position of one emitter.

    Attributes:
        position_m: Most likely position, shape (2,) or (3,).
        covariance_m2: Second moment about it, enlarged so that the normal 95 % ellipse contains 95 % of the posterior.
        is_located: True where the ellipse is small compared with the range, and the posterior is inside the region.
        turn_rad: Most likely turn of the boresights.
        cell_m: Cells of the posterior: their centres, shape (n, 2) or (n, 3).
        probability: Probability of each cell, shape (n,).
    """

    position_m: FloatArray
    covariance_m2: FloatArray
    is_located: bool
    turn_rad: float
    cell_m: FloatArray
    probability: FloatArray

    def holds(self, position_m: FloatArray) -> bool:
        """Return whether a position lies in the 95 % ellipse."""
        off_m = position_m - self.position_m
        return bool(off_m @ np.linalg.solve(self.covariance_m2, off_m) <= chi2.ppf(0.95, off_m.size))

    @property
    def semi_major_m(self) -> float:
        """Longest semi-axis of the 95 % ellipse."""
        n = self.position_m.size
        return float(np.sqrt(chi2.ppf(0.95, n) * np.linalg.eigvalsh(self.covariance_m2)[-1]))


def locate_level(
    rows: LevelRows, model: LevelModel, low_m: FloatArray, high_m: FloatArray, turn_rad: FloatArray | None = None
) -> LevelEstimate:
    """Locate one emitter in a box from received levels.

    The posterior is computed on a grid over the box. Cells that hold all but a negligible part of it are halved until
    they are small compared with its spread. Several separate maxima thus make one wide ellipse.

    Args:
        rows: The levels.
        model: Their model.
        low_m: Lowest coordinates of the box, as in the rows, shape (2,) or (3,).
        high_m: Highest coordinates, of the same shape.
        turn_rad: Equally likely turns of all boresights, shape (k,); none by default.
    """
    turns = np.zeros(1) if turn_rad is None else turn_rad
    cell_m, side_m, joint = _posterior(LevelLikelihood(rows, model), turns, low_m, high_m)
    probability = joint.sum(axis=0)
    position_m = cell_m[np.argmax(probability / side_m.prod(axis=1))]
    covariance_m2 = _second_moment(cell_m - position_m, side_m, probability)
    off_m = cell_m - position_m
    square = np.einsum("ni,ij,nj->n", off_m, np.linalg.inv(covariance_m2), off_m)
    order = np.argsort(square)
    within = square[order][min(np.searchsorted(np.cumsum(probability[order]), 0.95), square.size - 1)]
    turn = float(turns[np.argmax(joint.sum(axis=1))])
    covariance_m2 *= max(within / chi2.ppf(0.95, low_m.size), 1.0)
    estimate = LevelEstimate(position_m, covariance_m2, False, turn, cell_m, probability)
    at_border = np.any((cell_m - side_m < low_m) | (cell_m + side_m > high_m), axis=1)
    range_m = np.median(np.linalg.norm(rows.position_m - position_m, axis=1))
    is_small = estimate.semi_major_m <= LARGEST_PART * range_m
    return estimate._replace(is_located=bool(is_small and probability[at_border].sum() <= MAX_AT_BORDER))


def _posterior(
    likelihood: LevelLikelihood, turn_rad: FloatArray, low_m: FloatArray, high_m: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Compute the posterior on a grid, and halve the cells that matter until they are small.

    Returns:
        Centres of the cells, shape (n, 2 or 3); their sides, of the same shape; and the probability of each turn and
        cell, shape (k, n).
    """
    n_axes, size_m = low_m.size, high_m - low_m
    counts = np.maximum(np.ceil(size_m / (np.prod(size_m) / N_COARSE) ** (1 / n_axes)), 2).astype(np.intp)
    number = np.array(list(np.ndindex(*counts.tolist())), dtype=np.float64)
    cell_m = low_m + size_m / counts * (number + 0.5)
    side_m = np.tile(size_m / counts, (len(cell_m), 1))
    corners = np.array(list(np.ndindex((2,) * n_axes)), dtype=np.float64) - 0.5
    log_likelihood = likelihood(cell_m, turn_rad)
    while True:
        log_mass = log_likelihood + np.log(side_m).sum(axis=1)
        joint = np.exp(log_mass - logsumexp(log_mass))
        probability = joint.sum(axis=0)
        spread_m2 = _second_moment(cell_m - probability @ cell_m, side_m, probability)
        spread_m = np.sqrt(np.linalg.eigvalsh(spread_m2)[0])
        order = np.argsort(probability)
        matters = np.zeros(order.size, dtype=np.bool_)
        matters[order[np.cumsum(probability[order]) > NEGLECTED]] = True
        matters &= side_m.max(axis=1) > spread_m / CELLS_PER_STD
        if not matters.any() or matters.sum() > MAX_REFINED:
            return cell_m, side_m, joint
        parts_m = (cell_m[matters, np.newaxis] + 0.5 * side_m[matters, np.newaxis] * corners).reshape(-1, n_axes)
        log_likelihood = np.hstack([log_likelihood[:, ~matters], likelihood(parts_m, turn_rad)])
        cell_m = np.vstack([cell_m[~matters], parts_m])
        side_m = np.vstack([side_m[~matters], np.repeat(0.5 * side_m[matters], len(corners), axis=0)])


def _second_moment(off_m: FloatArray, side_m: FloatArray, probability: FloatArray) -> FloatArray:
    """Compute the second moment of an offset that is uniform within each cell, shape (2 or 3, 2 or 3)."""
    return (off_m.T * probability) @ off_m + np.diag(probability @ np.square(side_m)) / 12.0
