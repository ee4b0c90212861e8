"""Two emitters that transmit at once, located from received levels: sums of powers over pairs of positions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp

from dirmusic.arrays import FloatArray
from dirmusic.locating.level_model import LevelModel, LevelRows

RATIOS_DB = (0.0, -5.0, -10.0)
"""Level of the second emitter relative to the first (assumed). Either may be the first."""


class LevelPair(NamedTuple):
    """Most likely positions of two emitters.

    Attributes:
        position_m: Positions, the stronger one first, shape (2, 2) or (2, 3).
        probability: Posterior probability of the two cells, whichever of them is the first.
    """

    position_m: FloatArray
    probability: float


def locate_two_levels(rows: LevelRows, model: LevelModel, cell_m: FloatArray) -> LevelPair:
    """Locate two emitters at two of the given positions; their powers add at each receiver.

    The exponent is that of the model without its uncertainty, because it cannot be integrated out in closed form.

    Args:
        rows: The levels.
        model: Their model, as for one emitter.
        cell_m: Candidate positions, shape (m, 2) or (m, 3); m (m - 1) pairs are compared.
    """
    towards_m = cell_m[:, np.newaxis] - rows.position_m
    decades_db = 10.0 * np.log10(np.maximum(np.linalg.norm(towards_m, axis=-1), model.least_range_m))
    power = 10.0 ** (0.1 * (model.gain_db(rows, towards_m, 0.0) - model.exponent * decades_db))
    whitening = np.linalg.inv(np.linalg.cholesky(model.error_covariance(rows)))
    dof = model.degrees_of_freedom
    log_likelihood = np.empty((len(RATIOS_DB), len(cell_m), len(cell_m)))
    for number, ratio_db in enumerate(RATIOS_DB):
        sum_db = 10.0 * np.log10(power[:, np.newaxis] + 10.0 ** (0.1 * ratio_db) * power)
        miss = (rows.level_db - model.source_db - sum_db) @ whitening.T
        log_likelihood[number] = -0.5 * (dof + rows.level_db.size) * np.log1p(np.square(miss).sum(axis=-1) / dof)
    log_likelihood[:, np.arange(len(cell_m)), np.arange(len(cell_m))] = -np.inf
    ordered = np.exp(log_likelihood - logsumexp(log_likelihood)).sum(axis=0)
    first, second = np.unravel_index(np.argmax(ordered + ordered.T), ordered.shape)
    if ordered[second, first] > ordered[first, second]:
        first, second = second, first
    probability = ordered[first, second] + ordered[second, first]
    return LevelPair(cell_m[[first, second]], float(probability))
