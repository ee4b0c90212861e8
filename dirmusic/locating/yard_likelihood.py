"""Likelihood over the yard: every pulse heard so far, on one grid of places (direct position determination)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.bounds import manifold_error_std, perpendicular_slope
from dirmusic.array.manifold import TABLE_SIZE
from dirmusic.array.model import ArrayModel
from dirmusic.locating.association.pooling import pooled
from dirmusic.locating.fitting.joint_fix import PoseError
from dirmusic.pulses.batch import PulseBatch

FloatArray = NDArray[np.float64]

CELL_M = 0.75
"""Side of the cells of a grid that is not too large (assumed)."""

MOST_CELLS = 10_000
"""Larger yards get larger cells (assumed)."""

PLACE_M, HEADING_RAD, DIRECTION_RAD = 0.5, np.radians(10.0), np.radians(10.0)
"""Pulses are pooled that differ by no more (assumed): less than a cell, and gains are nearly straight lines."""

BLUR_RANGE_M = 4.0
"""From here on a line of bearing is at least as wide as a cell (assumed): so that none falls between the cells."""

N_FINE = 720
FINE_STEP_RAD = 2 * np.pi / N_FINE
"""Azimuths between which nothing changes: half a degree."""

OUTLIER_SIGMAS = 3.0
"""A place that a pulse points past by more is as good as any other (assumed): with several sources, and reflections,
each place is told of by a part of the pulses only."""


class Grid(NamedTuple):
    """Places on the ground, cell by cell.

    Attributes:
        corner_m: Of the first cell, world frame, shape (2,).
        cell_m: Side of a cell.
        shape: Number of cells along x and y.
    """

    corner_m: FloatArray
    cell_m: float
    shape: tuple[int, int]

    @classmethod
    def over(cls, low_m: FloatArray, high_m: FloatArray) -> Grid:
        """Over a rectangle between two corners (2,), world frame."""
        size_m = high_m - low_m
        cell_m = max(CELL_M, float(np.sqrt(np.prod(size_m) / MOST_CELLS)))
        nx, ny = np.maximum(np.ceil(size_m / cell_m), 1).astype(np.intp).tolist()
        return cls(np.asarray(low_m, dtype=np.float64), cell_m, (nx, ny))

    @property
    def centres_m(self) -> FloatArray:
        """Of all cells, along y first, shape (n_cells, 2)."""
        cells: FloatArray = np.indices(self.shape, dtype=np.float64).reshape(2, -1).T + 0.5
        return self.corner_m + self.cell_m * cells


class YardLikelihood:
    r"""How likely a source is at each place, by all pulses so far and by no decision about any of them.

    A pulse of strengths s, scaled to unit norm as the gains :math:`u(\theta)` are, misses a direction by
    :math:`m(\theta) = 1 - (s^T u(\theta))^2`. Scaled to what its bearing is worth, a variance :math:`\sigma^2` by
    noise, array, heading and grid, that is :math:`\chi^2 = (m - \min m) / (\sigma^2 |u_\perp'|^2)`, and a place p that
    is seen in direction :math:`\theta_p` gains

    .. math:: \ln \frac{e^{-\chi^2(\theta_p) / 2} + e^{-c^2 / 2}}{e^{-c^2 / 2}}

    with c = `OUTLIER_SIGMAS`: nothing where the pulse points elsewhere, 4.5 at most. Pulses of one place, heading and
    direction are pooled. Errors of the array are the same for many of them and are taken as independent: peaks are
    where a fix is, and sharper than its ellipse. Everything is in the plane of the array.

    Args:
        array: The array's data sheet and spread.
        pose_error: How wrong the poses are.
        grid: The places.

    Attributes:
        grid: As given.
        log_likelihood: Sum over all pulses so far, above that of a place that none points to, shape (n_cells,).

    References:
        Weiss, Direct position determination of narrowband radio frequency transmitters, IEEE Signal Processing Letters
        11 (5), 2004: of received signals, here of their strengths.
    """

    def __init__(self, array: ArrayModel, pose_error: PoseError, grid: Grid) -> None:
        self.grid = grid
        self.log_likelihood: FloatArray = np.zeros(grid.shape[0] * grid.shape[1])
        self._array = array
        self._heading_rad2 = pose_error.heading_rad**2
        self._centres_m = grid.centres_m
        self._blur_rad2 = (grid.cell_m / BLUR_RANGE_M) ** 2 / 12.0

    def add(self, pulses: PulseBatch, pose: FloatArray) -> None:
        """Add pulses, with their directions, and the poses (n, 3) at which they were detected, world frame."""
        if pulses.n_pulses == 0:
            return
        bearing_rad = np.mod(pulses.azimuth_rad + pose[:, 2], 2 * np.pi)
        steps = np.column_stack([pose[:, :2] / PLACE_M, pose[:, 2] / HEADING_RAD, bearing_rad / DIRECTION_RAD])
        _, group = np.unique(np.floor(steps), axis=0, return_inverse=True)
        pulses, pose = pooled(pulses, pose, group.ravel())
        off_m = self._centres_m - pose[:, np.newaxis, :2]
        towards_rad = np.arctan2(off_m[..., 1], off_m[..., 0]) - pose[:, 2:]
        steps = np.rint(towards_rad / FINE_STEP_RAD).astype(np.intp) % N_FINE
        told = np.take_along_axis(self._gains(pulses), steps, axis=1)
        self.log_likelihood = self.log_likelihood + told.sum(axis=0)

    def _gains(self, pulses: PulseBatch) -> FloatArray:
        """What each pulse gives to places towards azimuths in even steps once round, shape (n_pulses, N_FINE)."""
        manifold = self._array.manifold
        usable = pulses.is_usable.astype(np.float64)
        strengths = pulses.strengths_v * usable
        towards = manifold.table.gain[:: TABLE_SIZE // N_FINE].T
        along = np.square(strengths @ towards) / (usable @ np.square(towards))
        miss = 1.0 - along / np.square(strengths).sum(axis=-1, keepdims=True)
        gain, slope = manifold.gain_and_slope(pulses.azimuth_rad)
        turn2 = np.square(perpendicular_slope(gain, slope)).sum(axis=0) / np.square(gain).sum(axis=0)
        array_rad = manifold_error_std(manifold, pulses.azimuth_rad, self._array.spread)
        variance_rad2 = np.square(pulses.std_rad) + np.square(array_rad) + self._heading_rad2 + self._blur_rad2
        chi2 = (miss - miss.min(axis=-1, keepdims=True)) / (variance_rad2 * turn2)[:, np.newaxis]
        return np.logaddexp(-0.5 * chi2, -0.5 * OUTLIER_SIGMAS**2) + 0.5 * OUTLIER_SIGMAS**2
