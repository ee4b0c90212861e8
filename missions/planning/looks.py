"""What a way shows of each target: over which angles, and for how long."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.angles import aperture
from pdpatrol.missions.planning.hearing import Hearing

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

TINY_RAD = 1e-9
"""Angles that are wider by less than this are as wide."""

CROSSING_RAD = np.radians(45.0)
"""Under which lines of sight are to cross (assumed): from two opposite sides they are one line, whatever the aperture,
and a position is open along it."""

N_CELLS = 12
"""Cells of the way that are to hear a target (assumed): 3 m, and at 20 pulses a second nearly four times those that
confirm."""


class Looks(NamedTuple):
    """What some cells show of targets, or what they need to be shown; each of shape (n_targets,).

    Attributes:
        aperture_rad: Of the narrowest arc of aspects that holds all cells that hear a target.
        crossing_rad: The same of the lines of sight, the two directions of which are one: at most 90 degrees.
        n_cells: How many cells hear it.
    """

    aperture_rad: FloatArray
    crossing_rad: FloatArray
    n_cells: IntArray

    def meet(self, needed: Looks) -> BoolArray:
        """Which targets are shown as is needed, shape (n_targets,)."""
        wide = (self.aperture_rad >= needed.aperture_rad - TINY_RAD) & (
            self.crossing_rad >= needed.crossing_rad - TINY_RAD
        )
        return wide & (self.n_cells >= needed.n_cells)

    def take(self, targets: BoolArray) -> Looks:
        """Those at some targets, by mask (n_targets,)."""
        return Looks(self.aperture_rad[targets], self.crossing_rad[targets], self.n_cells[targets])


def looks_from(hearing: Hearing, columns: IntArray, targets: BoolArray) -> Looks:
    """What some columns show of some targets.

    Args:
        hearing: Where targets are heard from.
        columns: Of `hearing`, each once.
        targets: Which count, shape (n_targets,).
    """
    rows = np.flatnonzero(targets)[:, np.newaxis]
    is_heard, aspect_rad = hearing.is_heard[rows, columns], hearing.aspect_rad[rows, columns]
    seen_rad = [aspects[heard] for aspects, heard in zip(aspect_rad, is_heard, strict=True)]
    return Looks(
        aperture_rad=np.array([aperture(each) for each in seen_rad]),
        crossing_rad=np.array([min(0.5 * aperture(2.0 * each), 0.5 * np.pi) for each in seen_rad]),
        n_cells=is_heard.sum(axis=1),
    )


def needed_of(hearing: Hearing, columns: IntArray, aperture_rad: FloatArray) -> Looks:
    """What a tour has to show of each target: crossing and cells as wanted, or as a longer tour shows if that is less.

    Args:
        hearing: Where targets are heard from.
        columns: On the way of that longer tour, each once.
        aperture_rad: That is needed, shape (n_targets,).
    """
    longer = looks_from(hearing, columns, np.ones(len(hearing.targets), dtype=np.bool_))
    return Looks(
        aperture_rad,
        np.minimum(longer.crossing_rad, CROSSING_RAD),
        np.minimum(longer.n_cells, N_CELLS).astype(np.intp),
    )
