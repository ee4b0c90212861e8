"""Support: what a fit of a finding rests on, and whether another one would rest on something else."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

FRESH_SHARE = 0.1
"""Findings are fitted anew once the pulses of one have become more, or fewer, by this share (assumed): where these are
as good as the others, that is a twentieth of a deviation."""

FRESH_RAD = np.radians(10.0)
"""Findings are fitted anew once one is seen from an arc that is wider, or narrower, by this (assumed): a few pulses
from another side tell more than many from where others came."""


class Support(NamedTuple):
    """What a fit of a finding rests on.

    Attributes:
        n_pulses: Of its own.
        n_in_sight: Those that came in sight of it.
        aperture_rad: Over which its lines of sight spread.
    """

    n_pulses: int
    n_in_sight: int
    aperture_rad: float

    def is_new_beside(self, fitted: Support) -> bool:
        """Whether a fit would rest on something else than this one."""
        return (
            abs(self.n_pulses - fitted.n_pulses) > FRESH_SHARE * fitted.n_pulses
            or abs(self.n_in_sight - fitted.n_in_sight) > FRESH_SHARE * fitted.n_in_sight
            or abs(self.aperture_rad - fitted.aperture_rad) > FRESH_RAD
        )


def are_worth_a_fit(supports: dict[int, Support], fitted: dict[int, Support]) -> bool:
    """Whether there are other findings than at the last fit, or one rests on something else."""
    if supports.keys() != fitted.keys():
        return True
    return any(support.is_new_beside(fitted[number]) for number, support in supports.items())
