"""Bearing errors that the array's elements make, tabulated over azimuth: every pulse is corrected in every fit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.bounds import manifold_error, manifold_error_std
from dirmusic.array.element_errors import ElementErrors
from dirmusic.array.manifold import SEARCH_AZIMUTHS_RAD
from dirmusic.array.model import ArrayModel

FloatArray = NDArray[np.float64]


class BearingErrors:
    """`manifold_error` and `manifold_error_std` between the search azimuths, linearly.

    Args:
        array: The array's data sheet and spread.
    """

    def __init__(self, array: ArrayModel) -> None:
        self._manifold = array.manifold
        self._last: tuple[ElementErrors, FloatArray] | None = None
        self._std_rad = manifold_error_std(array.manifold, SEARCH_AZIMUTHS_RAD, array.spread)

    def std(self, azimuth_rad: FloatArray) -> FloatArray:
        """Standard deviation of the bearings towards azimuths (n,) while no error is known, shape (n,), radians."""
        return _interpolated(azimuth_rad, self._std_rad)

    def of(self, errors: ElementErrors, azimuth_rad: FloatArray) -> FloatArray:
        """Bearing error towards azimuths (n,) by known errors of the elements, shape (n,), radians."""
        return _interpolated(azimuth_rad, self._over_azimuth(errors))

    def most_apart(self, first: ElementErrors, second: ElementErrors) -> float:
        """Largest difference of bearing errors by two sets of errors of the elements, over all azimuths, radians."""
        return float(np.abs(self._over_azimuth(first) - self._over_azimuth(second)).max())

    def _over_azimuth(self, errors: ElementErrors) -> FloatArray:
        if self._last is None or self._last[0] is not errors:
            self._last = errors, manifold_error(self._manifold, SEARCH_AZIMUTHS_RAD, errors)
        return self._last[1]


def _interpolated(azimuth_rad: FloatArray, at_search_azimuths: FloatArray) -> FloatArray:
    return np.interp(azimuth_rad, SEARCH_AZIMUTHS_RAD, at_search_azimuths, period=2 * np.pi)
