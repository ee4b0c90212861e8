"""What a robot knows of its array."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.bounds import manifold_error_std, rms_bearing_error
from dirmusic.array.element_errors import ElementSpread, EstimatedErrors
from dirmusic.array.manifold import SEARCH_AZIMUTHS_RAD, GainManifold

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class ArrayModel:
    """What the robot knows of its array: the data sheet, and how far real arrays, or this very one, are off it.

    Attributes:
        manifold: Nominal gains.
        positions_m: Nominal element positions, array frame, heights above the ground, shape (n_elements, 3).
        spread: How far real arrays spread about the data sheet.
        band_manifolds: Nominal gains in the lower and the upper half of each sub-band that the receiver reads, lowest
            first; none where it reads none.
        errors: What earlier missions have shown of this very array; None where no more than the spread is known.
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
        """Bearing error by what is not known of the array, root mean square over azimuths; averaging lessens it not."""
        manifold = self.manifold
        errors = self.errors or EstimatedErrors.of_spread(self.spread, manifold.n_elements)
        by_pattern = manifold_error_std(manifold, SEARCH_AZIMUTHS_RAD, ElementSpread(pattern=self.spread.pattern))
        return float(np.hypot(rms_bearing_error(manifold, errors.covariance), np.sqrt(np.square(by_pattern).mean())))

    def take(self, elements: Sequence[int] | NDArray[np.intp] | NDArray[np.bool_]) -> ArrayModel:
        """The same array with some of its elements alone, by index or mask."""
        chosen = np.arange(self.manifold.n_elements)[np.asarray(elements)]
        return ArrayModel(
            manifold=self.manifold.take(chosen),
            positions_m=self.positions_m[chosen],
            spread=self.spread,
            band_manifolds=tuple(manifold.take(chosen) for manifold in self.band_manifolds),
            errors=None if self.errors is None else self.errors.take(chosen),
        )
