"""Waves from above the plane of the array: elevations of pulses that no direction in the plane explains."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from dirmusic.angles import difference, wrap
from dirmusic.array.element_errors import ElementSpread, off_by_pattern
from dirmusic.array.manifold import (
    SEARCH_AZIMUTHS_RAD,
    TABLE_SIZE,
    GainManifold,
    nearest_search_azimuth,
)
from dirmusic.array.model import ArrayModel
from dirmusic.array.pattern import SpatialGain
from dirmusic.arrays import FloatArray
from dirmusic.pulses.batch import UNKNOWN_STD_RAD, Bearings, PulseBatch

ELEVATIONS_RAD = np.radians([0.0, 15.0, 30.0, 45.0, 60.0, 75.0])
"""Elevations at which pulses are compared with the model, evenly spaced from zero. Assumed: half a step changes gains
by at most 2 %, less than the errors of the elements. A wave from nearly overhead has no direction in the plane."""

MISFIT_FACTOR, MISFIT_FLOOR = 3.0, 0.05**2
"""Largest misfit of a pulse that a direction explains, as a multiple of that expected from noise, array errors and this
floor, which stands for nearby sources and multipath. Assumed. With an error of gain of 5 %
the limit is 0.02 without noise: a ring of six searches waves from above about 40 degrees."""

LEAST_CHANNELS = 4
"""Smallest number of channels with which an elevation can be tested: amplitude and direction take three."""


@lru_cache(maxsize=64)
def _response(manifold: GainManifold) -> SpatialGain:
    off_rad = SEARCH_AZIMUTHS_RAD[:, np.newaxis] - manifold.boresights_rad
    return manifold.response_in_space(off_rad, ELEVATIONS_RAD[:, np.newaxis, np.newaxis])


def gains_in_space(manifold: GainManifold) -> FloatArray:
    """Tabulate the gains at `ELEVATIONS_RAD` and the search azimuths, shape (n_elevations, n_azimuths, n_elements)."""
    return _response(manifold).gain


@lru_cache(maxsize=64)
def errors_by_elevation(manifold: GainManifold) -> FloatArray:
    """Tabulate the best-fitting in-plane azimuth minus the true azimuth, shape (n_elevations, n_azimuths)."""
    in_plane = manifold.table.gain / np.linalg.norm(manifold.table.gain, axis=-1, keepdims=True)
    best_rad = 2 * np.pi / TABLE_SIZE * (gains_in_space(manifold) @ in_plane.T).argmax(axis=-1)
    return difference(best_rad, SEARCH_AZIMUTHS_RAD)


class SpaceTable(NamedTuple):
    """Directions at `ELEVATIONS_RAD` and the search azimuths.

    Attributes:
        unit: Gains, scaled to unit norm, shape (n_elevations, n_azimuths, n_elements).
        inverse: Errors of amplitude, azimuth and elevation per error of each of these gains: the pseudo-inverse of the
            Jacobian matrix, shape (n_elevations, n_azimuths, 3, n_elements).
        array_std_rad: Standard deviation of the azimuth due to array errors and multipath, to first order, shape
            (n_elevations, n_azimuths).
        array_misfit: Misfit that array errors and multipath cause in the plane, mean over azimuths.
    """

    unit: FloatArray
    inverse: FloatArray
    array_std_rad: FloatArray
    array_misfit: float


@lru_cache(maxsize=64)
def space_table(manifold: GainManifold, spread: ElementSpread) -> SpaceTable:
    """Tabulate the directions in space of an array with errors."""
    response = _response(manifold)
    norm = np.linalg.norm(response.gain, axis=-1, keepdims=True)
    unit = response.gain / norm
    jacobian: FloatArray = np.stack(response, axis=-1) / norm[..., np.newaxis]
    inverse = np.asarray(np.linalg.pinv(jacobian, rcond=1e-3), dtype=np.float64)
    turn, second = inverse[..., 1, :], unit[0].T  # second waves from all azimuths in the plane
    off_plane = off_by_pattern(np.square(np.sin(ELEVATIONS_RAD[:, np.newaxis, np.newaxis]))) - 1.0
    variance = spread.variance(response.gain, response.by_azimuth) + spread.pattern**2 * off_plane
    by_array = np.square(turn / norm * np.sqrt(variance)).sum(axis=-1)
    by_multipath = np.square(turn @ second).mean(axis=-1) / (1.0 - np.square(unit @ second).mean(axis=-1))
    std_rad = np.minimum(np.sqrt(by_array + spread.unexplained**2 * by_multipath), UNKNOWN_STD_RAD)
    array_misfit = float((variance / norm**2)[0].sum(axis=-1).mean()) + spread.unexplained**2
    return SpaceTable(unit, inverse, std_rad, array_misfit)


def search_elevations(found: Bearings, pulses: PulseBatch, array: ArrayModel) -> None:
    """Replace the directions of pulses that no direction in the plane explains but one above it does.

    The best direction of the table is refined by one Gauss-Newton step in amplitude, azimuth and elevation, of at most
    half a step of the table in elevation. Noise and array errors leave a share of 1 - 2 / n_elements of their energy
    unexplained, because amplitude and azimuth are fitted.

    Args:
        found: Directions in the plane, of which some are replaced; misfits are not.
        pulses: The pulses.
        array: Nominal array of the channels of the pulses.
    """
    if not found.misfit.size or found.misfit.max() <= MISFIT_FACTOR * MISFIT_FLOOR:
        return
    table, step_rad = space_table(array.manifold, array.spread), ELEVATIONS_RAD[1]
    factor = MISFIT_FACTOR * (1.0 - 2.0 / array.manifold.n_elements)
    least = MISFIT_FACTOR * MISFIT_FLOOR + factor * table.array_misfit
    for k in np.flatnonzero(found.misfit > least).tolist():  # few
        pulse, noise_v2 = pulses.strengths_v[k], pulses.variance_v2[k]
        energy = pulse @ pulse
        limit_v2 = least * energy + factor * noise_v2.sum()
        if found.misfit[k] * energy <= limit_v2:
            continue
        match = table.unit @ pulse
        best, (level, column) = match.max(), divmod(int(match.argmax()), SEARCH_AZIMUTHS_RAD.size)
        if energy - best * best < limit_v2:
            _, turn, rise = table.inverse[level, column]
            up_rad = min(max(rise @ pulse / best, -0.5 * step_rad), 0.5 * step_rad)
            found.azimuth_rad[k] = wrap(SEARCH_AZIMUTHS_RAD[column] + turn @ pulse / best)
            found.std_rad[k] = min(np.sqrt(np.square(turn) @ noise_v2) / best, UNKNOWN_STD_RAD)
            found.elevation_rad[k] = ELEVATIONS_RAD[level] + up_rad


def total_std(pulses: PulseBatch, array: ArrayModel) -> FloatArray:
    r"""Compute the total standard deviation of bearings in the array frame.

    .. math:: \sigma^2 = \sigma_{noise}^2 + \delta(\theta, \phi_0)^2
              + \sum_i t_i^2 \left[ e^2 g_i^2 + d^2 g_i'^2 + o^2 + p^2 v(\phi) \right]
              + u^2 \frac{\langle (t^T g_r)^2 \rangle}{\langle \lVert g_{r\perp} \rVert^2 \rangle}

    with azimuth :math:`\theta`, elevation :math:`\phi`, gains g and slopes g'; their errors e (gain), d (pointing), o
    (offset) and p (pattern, see `off_by_pattern` for v); and the bearing error t per error of a gain, with amplitude
    and elevation unknown. Multipath is a second wave in the gate from a random azimuth r, of which the direction leaves
    :math:`g_{r\perp}` unexplained: a share :math:`u^2` of the energy, see `ElementSpread.unexplained`. A pulse without
    an elevation is taken to come from the one that fits best, :math:`\phi_0`, where an estimator in the plane has the
    bearing error :math:`\delta`; for others this term is 0. Pulses from one direction share all terms but the noise.

    Args:
        pulses: Pulses with their directions. Channels that are faulty in one of them are not used.
        array: The array's data sheet and spread.

    Returns:
        Shape (n_pulses,), radians; at most that of a uniform direction.
    """
    if not pulses.n_pulses:
        return np.empty(0)
    good = np.asarray(pulses.is_usable.all(axis=0))
    own, of = (pulses, array) if good.all() else (pulses.take_channels(good), array.take(good))
    column, in_plane = nearest_search_azimuth(own.azimuth_rad), own.elevation_rad == 0.0
    above = np.rint(np.minimum(own.elevation_rad, ELEVATIONS_RAD[-1]) / ELEVATIONS_RAD[1]).astype(np.intp)
    table = space_table(of.manifold, of.spread)
    best_match = np.einsum("epc,pc->ep", table.unit[:, column], own.strengths_v).argmax(axis=0)
    level = above + in_plane * best_match
    array_rad = table.array_std_rad[level, column]
    in_plane_rad = in_plane * errors_by_elevation(of.manifold)[level, column]
    return np.minimum(np.hypot(np.hypot(own.std_rad, array_rad), in_plane_rad), UNKNOWN_STD_RAD)
