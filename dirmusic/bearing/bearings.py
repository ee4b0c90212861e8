"""Directions of arrival: what every bearing estimator gives."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.pulses.batch import PulseBatch

FloatArray = NDArray[np.float64]

LEAST_SHARE = 0.01
"""Share of the pooled energy that is taken as signal at least, where it cannot be told from noise (assumed)."""

UNKNOWN_STD_RAD = np.pi / np.sqrt(3)
"""Deviation of a direction of which nothing is known: uniform on the circle. No estimate from strengths says a wider
one; tables that hold no NaN say pi where there was no strength at all."""


class Bearings(NamedTuple):
    """Directions of arrival in the array frame.

    Attributes:
        azimuth_rad: Shape (...), in (-pi, pi]; NaN where all strengths were zero.
        std_rad: Shape (...). From noise alone, unless a prior on the manifold was given: an error of the manifold is
            common to all pulses from one direction. NaN without a variance of the noise and without a prior.
        misfit: Shape (...), share of the energy that no single direction explains, in [0, 1]. Large where two sources
            overlap, a channel is dead, or there is only noise.
    """

    azimuth_rad: FloatArray
    std_rad: FloatArray
    misfit: FloatArray

    def attached_to(self, pulses: PulseBatch) -> PulseBatch:
        """Those pulses with these directions, one for each."""
        return pulses._replace(azimuth_rad=self.azimuth_rad, std_rad=self.std_rad, misfit=self.misfit)

    def take(self, rows: slice | NDArray[np.bool_]) -> Bearings:
        """Some of the directions, by slice or mask."""
        return Bearings(self.azimuth_rad[rows], self.std_rad[rows], self.misfit[rows])
