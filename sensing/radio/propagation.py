"""What decides how pulses arrive at elements: places of sources and arrays, and what surrounds them; one record."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.pattern_table import PatternTable
from dirmusic.compiled import compiled
from sensing.array.array_table import ArrayTable
from sensing.radio.surroundings import Faces, Obstacles, Surroundings

FloatArray = NDArray[np.float64]


class SourceTable(NamedTuple):
    """The sources of several robots, equally many for each, as compiled loops read them.

    Attributes:
        positions_m: Of each robot its own sources, shape (n_robots, n_sources, 3), world frame.
        burst_s: How long emissions last that are no pulses, 0 for pulses, shape (n_robots, n_sources).
    """

    positions_m: FloatArray
    burst_s: FloatArray


class Propagation(NamedTuple):
    """Where sources and arrays are, and what surrounds them.

    Attributes:
        sources: Each robot's own.
        world_from_array: Poses of the arrays, shape (n_robots, 4, 4).
        arrays: One for each robot.
        surroundings: The same for all robots.
    """

    sources: SourceTable
    world_from_array: FloatArray
    arrays: ArrayTable
    surroundings: Surroundings


@compiled
def named_propagation(propagation: tuple[Any, ...]) -> Propagation:
    """A `Propagation` from a plain one, in which all inner records are plain too."""
    sources, world_from_array, arrays, (faces, reflection, log_loss, obstacles) = propagation
    elements_m, boresights, gain_factors, gain_offsets, pattern = arrays
    surroundings = Surroundings(Faces(*faces), reflection, log_loss, Obstacles(*obstacles))
    table = ArrayTable(elements_m, boresights, gain_factors, gain_offsets, PatternTable(*pattern))
    return Propagation(SourceTable(*sources), world_from_array, table, surroundings)
