"""Directions that an array cannot tell apart: their gains have the same ratios."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.angles import difference
from dirmusic.array.manifold import SEARCH_AZIMUTHS_RAD, GainManifold

FloatArray = NDArray[np.float64]

FAR_APART_RAD = np.radians(20.0)
"""Directions nearer to each other than this may well be alike: what noise makes of them is the bound's matter."""

LEAST_CONTRAST_RAD = np.radians(1.0)
"""Unit gains that differ by less are taken for the same (assumed): 1 degree is 2 % of the strengths, less than the
elements of one array differ by. Rings have 5 degrees and more, two elements hundredths of one."""


class Ambiguity(NamedTuple):
    """The two directions far apart that an array can tell apart least.

    Attributes:
        contrast_rad: Angle between their gains as vectors.
        first_rad: The one azimuth, array frame, in [0, 2 pi).
        second_rad: The other azimuth.
    """

    contrast_rad: float
    first_rad: float
    second_rad: float

    @property
    def is_harmless(self) -> bool:
        """Whether the array tells all directions apart."""
        return self.contrast_rad >= LEAST_CONTRAST_RAD


def worst_ambiguity(manifold: GainManifold) -> Ambiguity:
    """The pair of azimuths, at least `FAR_APART_RAD` from each other, whose gains have the most alike ratios."""
    unit_gain = manifold.search_unit_gain
    likeness: FloatArray = unit_gain.T @ unit_gain
    apart_rad = np.abs(difference(SEARCH_AZIMUTHS_RAD[:, np.newaxis], SEARCH_AZIMUTHS_RAD))
    likeness[apart_rad < FAR_APART_RAD - 1e-9] = -1.0
    first, second = divmod(int(likeness.argmax()), SEARCH_AZIMUTHS_RAD.size)
    contrast = float(np.linalg.norm(unit_gain[:, first] - unit_gain[:, second]))
    return Ambiguity(
        contrast_rad=float(2 * np.arcsin(0.5 * contrast)),
        first_rad=float(SEARCH_AZIMUTHS_RAD[first]),
        second_rad=float(SEARCH_AZIMUTHS_RAD[second]),
    )
