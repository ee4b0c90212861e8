"""Model of the array that the robot uses for direction finding and locating."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dirmusic.array.bounds import manifold_error_std, rms_bearing_error
from dirmusic.array.element_errors import ElementSpread, EstimatedErrors
from dirmusic.array.manifold import SEARCH_AZIMUTHS_RAD, GainManifold
from dirmusic.arrays import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, kw_only=True)
class ArrayModel:
    """Array model that the robot uses: data sheet, spread of real arrays, and estimated errors of this one.

    Attributes:
        manifold: Nominal gains.
        positions_m: Nominal positions of the elements, array frame, with heights above the ground, shape
            (n_elements, 3).
        spread: Standard deviations of real arrays from the data sheet.
        band_manifolds: Nominal gains in the lower and the upper half of each sub-band of the receiver, lowest first;
            empty if the receiver does not measure sub-bands.
        errors: Errors of this array as estimated in earlier missions; None if unknown.
    """

    manifold: GainManifold
    positions_m: FloatArray
    spread: ElementSpread
    band_manifolds: tuple[GainManifold, ...] = ()
    errors: EstimatedErrors | None = None

    @property
    def height_m(self) -> float:
        """Mean height of the elements above the ground."""
        return float(self.positions_m[:, 2].mean())

    @property
    def bearing_std_rad(self) -> float:
        """Bearing error due to unknown array errors, rms over azimuths; averaging over pulses does not reduce it."""
        manifold = self.manifold
        errors = self.errors or EstimatedErrors.of_spread(self.spread, manifold.n_elements)
        by_pattern = manifold_error_std(manifold, SEARCH_AZIMUTHS_RAD, ElementSpread(pattern=self.spread.pattern))
        return float(np.hypot(rms_bearing_error(manifold, errors.covariance), np.sqrt(np.square(by_pattern).mean())))

    def take(self, elements: Sequence[int] | IntArray | BoolArray) -> ArrayModel:
        """Select elements by index or mask."""
        chosen = np.arange(self.manifold.n_elements)[np.asarray(elements)]
        return ArrayModel(
            manifold=self.manifold.take(chosen),
            positions_m=self.positions_m[chosen],
            spread=self.spread,
            band_manifolds=tuple(manifold.take(chosen) for manifold in self.band_manifolds),
            errors=None if self.errors is None else self.errors.take(chosen),
        )
