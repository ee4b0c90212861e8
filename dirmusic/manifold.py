"""Gain of every element towards any azimuth: what steering vectors are to phase arrays."""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dirmusic.pattern import GainPattern, GaussianPattern

FloatArray = NDArray[np.float64]


class GainManifold:
    """The gain array manifold that the estimator believes in.

    Args:
        pattern: Gain of each element over the angle off its boresight.
        boresights_rad: Where each element looks, array frame, shape (n_elements,), n_elements >= 2.

    Raises:
        ValueError: If `boresights_rad` is not a finite vector of at least two angles.

    References:
        Dir-MUSIC, eq. (6).
    """

    def __init__(self, pattern: GainPattern, boresights_rad: ArrayLike) -> None:
        boresights = np.array(boresights_rad, dtype=np.float64)
        if boresights.ndim != 1 or boresights.size < 2 or not np.isfinite(boresights).all():
            raise ValueError(
                f"`boresights_rad` must be finite with shape (n_elements,), n_elements >= 2, got {boresights_rad!r}. "
                "One element alone leaves no noise subspace, so it has no bearing."
            )
        boresights.setflags(write=False)
        self.pattern = pattern
        self.boresights_rad = boresights

    @classmethod
    def ring(cls, n_elements: int = 6, pattern: GainPattern | None = None) -> Self:
        """A uniform ring with boresights +90 - 360 k / n degrees: element 1 looks left, the next further clockwise."""
        return cls(pattern or GaussianPattern(), np.pi / 2 - 2 * np.pi * np.arange(n_elements) / n_elements)

    @property
    def n_elements(self) -> int:
        """Number of elements."""
        return self.boresights_rad.size

    def off_boresight(self, azimuth_rad: ArrayLike) -> FloatArray:
        """Azimuth of any shape as seen from each boresight, shape (n_elements, *azimuth.shape), radians."""
        azimuth = np.asarray(azimuth_rad, dtype=np.float64)
        return azimuth - self.boresights_rad.reshape(-1, *(1,) * azimuth.ndim)

    def gain(self, azimuth_rad: ArrayLike) -> FloatArray:
        """Gains towards array-frame azimuths of any shape; shape (n_elements, *azimuth.shape), unitless."""
        return self.pattern(self.off_boresight(azimuth_rad))

    def derivative(self, azimuth_rad: ArrayLike) -> FloatArray:
        """Slopes of the gains per radian of azimuth; shape (n_elements, *azimuth.shape)."""
        return self.pattern.derivative(self.off_boresight(azimuth_rad))
