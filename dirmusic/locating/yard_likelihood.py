"""Likelihood map of the yard from all pulses so far, on a grid of positions (direct position determination)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dirmusic.array.bounds import manifold_error_std, perpendicular_slope
from dirmusic.array.manifold import TABLE_SIZE
from dirmusic.array.model import ArrayModel
from dirmusic.arrays import FloatArray
from dirmusic.locating.protocol import PoseError
from dirmusic.locating.pulse_pool import Groups, pool_pulses
from dirmusic.pulses.batch import PulseBatch

CELL_M = 0.75
"""Side length of a grid cell (assumed). It is larger in a yard that would have more than 10 000 cells."""

N_FINE = 720
"""Number of azimuths at which the likelihood of a pulse is tabulated: every half degree."""

OUTLIER_SIGMAS = 3.0
"""Offset of a pulse from a position, in standard deviations, beyond which all positions are equally likely (assumed):
with several sources and reflections, only some of the pulses come from each position."""


class Grid(NamedTuple):
    """Grid of square cells on the ground.

    Attributes:
        corner_m: Corner of the first cell, world frame, shape (2,).
        cell_m: Side length of a cell.
        shape: Number of cells along x and y.
    """

    corner_m: FloatArray
    cell_m: float
    shape: tuple[int, int]

    @classmethod
    def over(cls, low_m: FloatArray, high_m: FloatArray) -> Grid:
        """Create a grid that covers the rectangle between two corners, world frame, each of shape (2,)."""
        size_m = high_m - low_m
        cell_m = max(CELL_M, float(np.sqrt(np.prod(size_m) / 10_000)))
        nx, ny = np.maximum(np.ceil(size_m / cell_m), 1).astype(np.intp).tolist()
        return cls(np.asarray(low_m, dtype=np.float64), cell_m, (nx, ny))

    @property
    def centres_m(self) -> FloatArray:
        """Centres of all cells, with y varying fastest, shape (n_cells, 2)."""
        cells: FloatArray = np.indices(self.shape, dtype=np.float64).reshape(2, -1).T + 0.5
        return self.corner_m + self.cell_m * cells


class YardLikelihood:
    r"""Likelihood of a source at each position, from all pulses so far, without associating pulses with findings.

    The misfit of a pulse in direction :math:`\theta` is :math:`m(\theta) = 1 - (s^T u(\theta))^2`, where the strengths
    s and the gains :math:`u(\theta)` are scaled to unit norm. With the variance :math:`\sigma^2` of its bearing due to
    noise, array, heading and grid, the normalised misfit is
    :math:`\chi^2 = (m - \min m) / (\sigma^2 |u_\perp'|^2)`. The pulse adds to the log likelihood of a position p that
    is seen in direction :math:`\theta_p`

    .. math:: \ln \frac{e^{-\chi^2(\theta_p) / 2} + e^{-c^2 / 2}}{e^{-c^2 / 2}}

    with c = `OUTLIER_SIGMAS`. This is 0 where the pulse points elsewhere, and about 4.5 at most. Pulses from one
    position, heading and direction are pooled. Errors of the array, which many pulses share, are treated as
    independent: the peaks are at the positions of the findings, but sharper than their ellipses. All computations are
    in the plane of the array.

    Args:
        array: The array's data sheet and spread.
        pose_error: Error of the poses.
        grid: Grid of positions.

    Attributes:
        grid: Grid of positions.
        pose_error: Error of the poses of later pulses; may be changed.
        log_likelihood: Sum over all pulses so far, relative to a position that no pulse points to, shape (n_cells,).

    References:
        Weiss, Direct position determination of narrowband radio frequency transmitters, IEEE Signal Processing Letters
        11 (5), 2004. The paper uses received signals; this class uses their strengths.
    """

    def __init__(self, array: ArrayModel, pose_error: PoseError, grid: Grid) -> None:
        self.grid, self.pose_error = grid, pose_error
        self.log_likelihood: FloatArray = np.zeros(grid.shape[0] * grid.shape[1])
        self._array = array
        self._centres_m = grid.centres_m
        # Beyond 4 m (assumed), a line of bearing is at least as wide as a cell, so that it cannot pass between cells.
        self._blur_rad2 = (grid.cell_m / 4.0) ** 2 / 12.0

    def add(self, pulses: PulseBatch, pose: FloatArray) -> None:
        """Add pulses with their directions.

        Pulses that differ by less than 0.5 m in position, 10 degrees in heading and 10 degrees in bearing are pooled
        (assumed): this is less than a cell, and the gains are nearly linear over such angles.

        Args:
            pulses: The pulses, n rows.
            pose: Poses at which they were detected, x m, y m, yaw rad, world frame, shape (n, 3).
        """
        if pulses.n_pulses == 0:
            return
        bearing_rad = np.mod(pulses.azimuth_rad + pose[:, 2], 2 * np.pi)
        steps = np.column_stack([pose[:, :2] / 0.5, pose[:, 2] / np.radians(10.0), bearing_rad / np.radians(10.0)])
        _, group = np.unique(np.floor(steps), axis=0, return_inverse=True)
        group = group.ravel().astype(np.intp)
        groups = pool_pulses(pulses, pose, group, group)
        off_m = self._centres_m - groups.pose[:, np.newaxis, :2]
        towards_rad = np.arctan2(off_m[..., 1], off_m[..., 0]) - groups.pose[:, 2:]
        steps = np.rint(towards_rad / (2 * np.pi / N_FINE)).astype(np.intp) % N_FINE
        contribution = np.take_along_axis(self._gains(groups), steps, axis=1)
        self.log_likelihood = self.log_likelihood + contribution.sum(axis=0)

    def _gains(self, groups: Groups) -> FloatArray:
        """Tabulate the contribution of each group over array azimuth, shape (n, N_FINE)."""
        manifold = self._array.manifold
        usable = groups.is_usable.astype(np.float64)
        towards = manifold.table.gain[:: TABLE_SIZE // N_FINE].T
        along = np.square(groups.strengths @ towards) / (usable @ np.square(towards))
        miss = 1.0 - along  # strengths have unit norm
        gain, slope = manifold.gain_and_slope(groups.azimuth_rad)
        turn2 = np.square(perpendicular_slope(gain, slope)).sum(axis=0) / np.square(gain).sum(axis=0)
        array_rad = manifold_error_std(manifold, groups.azimuth_rad, self._array.spread)
        variance_rad2 = np.square(groups.std_rad) + np.square(array_rad) + self._blur_rad2
        variance_rad2 += self.pose_error.heading_rad**2
        chi2 = (miss - miss.min(axis=-1, keepdims=True)) / (variance_rad2 * turn2)[:, np.newaxis]
        return np.logaddexp(-0.5 * chi2, -0.5 * OUTLIER_SIGMAS**2) + 0.5 * OUTLIER_SIGMAS**2
