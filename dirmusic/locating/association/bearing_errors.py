"""Bearing errors by the array's elements and by elevation, tabulated: every pulse is corrected in every fit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from dirmusic.angles import difference
from dirmusic.array.bounds import manifold_error, manifold_error_std, perpendicular_slope
from dirmusic.array.element_errors import ElementErrors, ElementSpread, off_by_pattern
from dirmusic.array.manifold import SEARCH_AZIMUTHS_RAD, SEARCH_STEP_RAD, TABLE_SIZE, GainManifold
from dirmusic.array.model import ArrayModel
from dirmusic.locating.elevation import ELEVATIONS_RAD, gains_in_space

FloatArray = NDArray[np.float64]


ONCE_ROUND_RAD = np.append(SEARCH_AZIMUTHS_RAD, 2 * np.pi)


class BearingErrors:
    """`manifold_error` and `manifold_error_std` between the search azimuths, linearly, and what elevation adds.

    Args:
        array: The array's data sheet and spread.
    """

    def __init__(self, array: ArrayModel) -> None:
        self._manifold = array.manifold
        self._last: tuple[ElementErrors, FloatArray] | None = None
        self._std_rad = _once_round(manifold_error_std(array.manifold, SEARCH_AZIMUTHS_RAD, array.spread))
        self._by_elevation_rad = _errors_by_elevation(array.manifold)
        self._by_pattern_rad = _deviation_by_pattern(array.manifold, array.spread)

    def std(self, azimuth_rad: FloatArray) -> FloatArray:
        """Standard deviation of the bearings towards azimuths (n,) while no error is known, shape (n,), radians."""
        return _interpolated(azimuth_rad, self._std_rad)

    def of(self, errors: ElementErrors, azimuth_rad: FloatArray) -> FloatArray:
        """Bearing error towards azimuths (n,) by known errors of the elements, shape (n,), radians."""
        return _interpolated(azimuth_rad, self._over_azimuth(errors))

    def by_elevation(self, azimuth_rad: FloatArray, elevation_rad: FloatArray) -> FloatArray:
        """Error of bearings that are taken in the plane, of waves from azimuths and elevations (n,), radians.

        In a ring of helices 1.6 degrees root mean square at an elevation of 30 degrees, 8 at 60; linear in between to
        half a degree, and beyond the last of `ELEVATIONS_RAD` as there.
        """
        error_rad: FloatArray = map_coordinates(
            self._by_elevation_rad, _at(azimuth_rad, elevation_rad), order=1, mode="nearest"
        )
        return error_rad

    def variance_off_plane(self, azimuth_rad: FloatArray, elevation_rad: FloatArray) -> FloatArray:
        """What an unknown pattern adds to the variance of bearings off the plane, shape (n,), rad^2, beside `std`.

        For the computed helices within a factor of two up to 75 degrees of elevation: once `by_elevation` is taken out,
        their bearings are off by 7 degrees at 30, by 49 at 45.
        """
        row, column = _at(azimuth_rad, elevation_rad)
        above, level = (
            map_coordinates(self._by_pattern_rad, (of_row, column), order=1, mode="nearest")
            for of_row in (row, np.zeros_like(row))
        )
        return np.square(above) - np.square(level)

    def most_apart(self, first: ElementErrors, second: ElementErrors) -> float:
        """Largest difference of bearing errors by two sets of errors of the elements, over all azimuths, radians."""
        return float(np.abs(self._over_azimuth(first) - self._over_azimuth(second)).max())

    def _over_azimuth(self, errors: ElementErrors) -> FloatArray:
        if self._last is None or self._last[0] is not errors:
            self._last = errors, _once_round(manifold_error(self._manifold, SEARCH_AZIMUTHS_RAD, errors))
        return self._last[1]


def _errors_by_elevation(manifold: GainManifold) -> FloatArray:
    """The direction in the plane that fits best less the true one, for `ELEVATIONS_RAD` and search azimuths once round.

    Shape (n_elevations, n_azimuths + 1).
    """
    in_plane = manifold.table.gain / np.linalg.norm(manifold.table.gain, axis=-1, keepdims=True)
    best_rad = 2 * np.pi / TABLE_SIZE * (gains_in_space(manifold) @ in_plane.T).argmax(axis=-1)
    error_rad = difference(best_rad, SEARCH_AZIMUTHS_RAD)
    return np.column_stack([error_rad, error_rad[:, 0]])


def _deviation_by_pattern(manifold: GainManifold, spread: ElementSpread) -> FloatArray:
    r"""Deviation of bearings by what an unknown pattern is off by, for `ELEVATIONS_RAD` and azimuths once round.

    To first order :math:`\sigma / \lVert g'_\perp \rVert`, with :math:`\sigma^2` of `off_by_pattern` and the change of
    the gains over azimuth at that elevation, which leaves fewer degrees to tell apart than in the plane; but no more
    than if any direction were as likely. Shape (n_elevations, n_azimuths + 1).
    """
    gain = gains_in_space(manifold)
    slope = (np.roll(gain, -1, axis=1) - np.roll(gain, 1, axis=1)) / (2 * SEARCH_STEP_RAD)
    turning = np.linalg.norm(perpendicular_slope(gain.T, slope.T), axis=0).T
    off_by = spread.pattern * np.sqrt(off_by_pattern(np.square(np.sin(ELEVATIONS_RAD))))
    std_rad = np.minimum(off_by[:, np.newaxis] / turning, np.pi / np.sqrt(3.0))
    return np.column_stack([std_rad, std_rad[:, 0]])


def _at(azimuth_rad: FloatArray, elevation_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Row and column of tables over elevation and azimuth once round."""
    return np.abs(elevation_rad) / ELEVATIONS_RAD[1], np.mod(azimuth_rad, 2 * np.pi) / SEARCH_STEP_RAD


def _once_round(at_search_azimuths: FloatArray) -> FloatArray:
    """With the first once more at the end, for `_interpolated`."""
    return np.append(at_search_azimuths, at_search_azimuths[0])


def _interpolated(azimuth_rad: FloatArray, once_round: FloatArray) -> FloatArray:
    return np.interp(np.mod(azimuth_rad, 2 * np.pi), ONCE_ROUND_RAD, once_round)
