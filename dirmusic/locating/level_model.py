"""Likelihood of an emitter's position given levels in decibels, from receivers that measure strength only."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dirmusic.array.pattern import GainPattern, gain_in_space
from dirmusic.arrays import FloatArray, IntArray

BATCH = 2_000_000
"""Number of pairs of a position and a row that are evaluated at once; 100 MB."""


class LevelRows(NamedTuple):
    """Received levels, each with the pose of its antenna; several antennas, or one that is moved and turned.

    Attributes:
        level_db: Received levels, for example dBm, shape (n,).
        position_m: Positions of the antenna, in the plane or in space, shape (n, 2) or (n, 3).
        boresight_rad: Azimuths of the antenna's boresight, shape (n,); any value for an omnidirectional antenna.
        channel: Number of the channel of each row, from 0, shape (n,).
    """

    level_db: FloatArray
    position_m: FloatArray
    boresight_rad: FloatArray
    channel: IntArray


class LevelChannel(NamedTuple):
    """Antenna and receiver of a channel.

    Attributes:
        pattern: Pattern of the antenna; None if omnidirectional.
        offset_db: Gain of the channel relative to the others.
        offset_std_db: Standard deviation of the offset.
    """

    pattern: GainPattern | None = None
    offset_db: float = 0.0
    offset_std_db: float = 0.0


class LevelModel(NamedTuple):
    r"""Model of received levels.

    .. math:: L_i = S + k\,G_{c(i)}(\theta_i) + o_{c(i)} - 10 n \log_{10} r_i + e_i

    with the level S at 1 m on the boresight, the pattern G in decibels at the angle off the boresight, the offset o of
    the channel, and the range r in metres. S, o and n are normal and integrated out. The errors e have the covariance

    .. math:: s^2 \left( \sigma_s^2 e^{-d_{ij} / \ell} \, [c + (1 - c) e^{-(1 - \cos \psi_{ij}) / w}] +
              (\sigma_w^2 + q^2 / 12)\,\delta_{ij} \right)

    for antennas at the distance d whose boresights differ by :math:`\psi`. Multipath and shadowing are shared by
    antennas that are close to each other and look the same way, so that many rows along a short path count as few. The
    scale s is unknown: :math:`\nu / s^2` has a chi-square distribution with :math:`\nu` degrees of freedom, so that
    all levels together have a multivariate Student's t distribution.

    Attributes:
        channels: Antennas and receivers.
        passes: k: 1, or 2 where the antenna also sends the wave that the emitter returns (passive tags).
        source_db: Mean of S.
        source_std_db: Standard deviation of S; the default is nearly uniform.
        exponent: Mean of n: 2 in free space, 3 to 4 in buildings.
        exponent_std: Standard deviation of n.
        white_db: Standard deviation of independent errors.
        shadow_db: Standard deviation of errors that neighbours share.
        shadow_length_m: Distance at which their correlation is 1/e.
        shadow_turn: w: 1 - cos of the angle between boresights at which their correlation is 1/e.
        shadow_common: c: part of the variance that antennas at one position share, whatever their boresights.
        degrees_of_freedom: Confidence in the sizes of the errors; 4 allows errors twice as large or half as large.
        step_db: Quantisation q of the levels.
        least_range_m: Range below which levels no longer rise.

    References:
        Gudmundson, Correlation model for shadow fading in mobile radio systems, Electronics Letters 27 (23), 1991.
        Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, section 2.7.
    """

    channels: tuple[LevelChannel, ...]
    passes: int = 1
    source_db: float = 0.0
    source_std_db: float = 100.0
    exponent: float = 2.0
    exponent_std: float = 0.5
    white_db: float = 1.0
    shadow_db: float = 3.0
    shadow_length_m: float = 1.0
    shadow_turn: float = 0.5
    shadow_common: float = 0.3
    degrees_of_freedom: float = 4.0
    step_db: float = 0.0
    least_range_m: float = 0.1

    def error_covariance(self, rows: LevelRows) -> FloatArray:
        """Compute the covariance of all that does not depend on the emitter's position, for s = 1, shape (n, n)."""
        off_m = rows.position_m[:, np.newaxis] - rows.position_m
        turn = 1.0 - np.cos(rows.boresight_rad[:, np.newaxis] - rows.boresight_rad)
        shared = self.shadow_common + (1.0 - self.shadow_common) * np.exp(-turn / self.shadow_turn)
        shadow = self.shadow_db**2 * np.exp(-np.linalg.norm(off_m, axis=-1) / self.shadow_length_m) * shared
        offset2 = np.array([channel.offset_std_db for channel in self.channels])[rows.channel] ** 2
        same = rows.channel[:, np.newaxis] == rows.channel
        white = (self.white_db**2 + self.step_db**2 / 12.0) * np.eye(rows.level_db.size)
        return shadow + offset2 * same + white + self.source_std_db**2

    def gain_db(self, rows: LevelRows, towards_m: FloatArray, turn_rad: float) -> FloatArray:
        """Compute gain and offset of each row towards vectors from its antenna, shape (m, n, 2 or 3) to (m, n)."""
        off_rad = np.arctan2(towards_m[..., 1], towards_m[..., 0]) - rows.boresight_rad - turn_rad
        gain_db = np.empty(off_rad.shape)
        for number, (pattern, offset_db, _) in enumerate(self.channels):
            own = rows.channel == number
            gain_db[:, own] = offset_db
            if pattern is not None and towards_m.shape[-1] == 3:
                flat_m = np.hypot(towards_m[:, own, 0], towards_m[:, own, 1])
                gain = gain_in_space(pattern, off_rad[:, own], np.arctan2(towards_m[:, own, 2], flat_m)).gain
                gain_db[:, own] += 20.0 * self.passes * np.log10(gain)
            elif pattern is not None:
                gain_db[:, own] += 20.0 * self.passes * np.log10(pattern(off_rad[:, own]))
        return gain_db


class LevelLikelihood:
    """Likelihood of positions of one emitter.

    Args:
        rows: The levels.
        model: Their model.
    """

    def __init__(self, rows: LevelRows, model: LevelModel) -> None:
        self.rows, self.model = rows, model
        self._whitening = np.linalg.inv(np.linalg.cholesky(model.error_covariance(rows)))

    def __call__(self, position_m: FloatArray, turn_rad: FloatArray) -> FloatArray:
        """Compute the log likelihood, without the constant, of positions and of turns of all boresights.

        Args:
            position_m: Positions, shape (m, 2) or (m, 3), as in the rows.
            turn_rad: Angles by which all boresights are turned, shape (k,).

        Returns:
            Log likelihood, shape (k, m).
        """
        size = max(1, BATCH // self.rows.level_db.size)
        batches = [position_m[start : start + size] for start in range(0, len(position_m), size)]
        return np.concatenate([self._batch(batch, turn_rad) for batch in batches], axis=1)

    def _batch(self, position_m: FloatArray, turn_rad: FloatArray) -> FloatArray:
        rows, model = self.rows, self.model
        towards_m = position_m[:, np.newaxis] - rows.position_m
        decades_db = 10.0 * np.log10(np.maximum(np.linalg.norm(towards_m, axis=-1), model.least_range_m))
        over_db = rows.level_db - model.source_db + model.exponent * decades_db
        slope = model.exponent_std * decades_db @ self._whitening.T
        growth = 1.0 + np.square(slope).sum(axis=-1)  # of the determinant, because the exponent is integrated out
        miss = ((over_db - model.gain_db(rows, towards_m, turn)) @ self._whitening.T for turn in turn_rad.tolist())
        chi2 = np.array(
            [np.square(each).sum(axis=-1) - np.square((slope * each).sum(axis=-1)) / growth for each in miss]
        )
        dof = model.degrees_of_freedom
        return -0.5 * np.log(growth) - 0.5 * (dof + rows.level_db.size) * np.log1p(chi2 / dof)
