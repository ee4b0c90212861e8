"""Result of one run on measured data."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from dirmusic.arrays import FloatArray
from dirmusic.locating.level_fit import LevelEstimate

HEADINGS = ("run", "levels", "error (m)", "ellipse, long semi-axis (m)", "truth inside", "located", "simple (m)")


class Run(NamedTuple):
    """Result of one run.

    Attributes:
        name: Name of the run.
        n_levels: Number of levels.
        error_m: Distance of the estimate from the truth.
        semi_major_m: Longest semi-axis of the 95 % ellipse.
        is_inside: True where the ellipse holds the truth.
        is_located: True where the emitter counts as located.
        simple_m: Error of the simple method.
    """

    name: str
    n_levels: int
    error_m: float
    semi_major_m: float
    is_inside: bool
    is_located: bool
    simple_m: float

    @classmethod
    def of(cls, name: str, n_levels: int, found: LevelEstimate, truth_m: FloatArray, simple_m: FloatArray) -> Self:
        """Compare an estimate, and the position by the simple method, with the truth."""
        error_m, simple_error_m = (float(np.linalg.norm(each - truth_m)) for each in (found.position_m, simple_m))
        inside = found.holds(truth_m)
        return cls(name, n_levels, error_m, found.semi_major_m, inside, found.is_located, simple_error_m)

    @property
    def cells(self) -> list[str]:
        """Cells of the table under `HEADINGS`; a confident error is marked as lost."""
        located = "yes" if self.is_located else "no"
        inside = "yes" if self.is_inside else "**no: lost**" if self.is_located else "no"
        numbers = (f"{self.error_m:.2f}", f"{self.semi_major_m:.2f}")
        return [self.name, str(self.n_levels), *numbers, inside, located, f"{self.simple_m:.2f}"]
