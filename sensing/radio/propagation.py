"""What decides how pulses arrive at elements: places of sources and arrays, and what surrounds them; one record."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdpatrol.sensing.array.array_table import ArrayTable
from pdpatrol.sensing.radio.surroundings import Surroundings

FloatArray = NDArray[np.float64]


class SourceTable(NamedTuple):
    """The sources of several robots, equally many for each, as compiled loops read them.

    Attributes:
        positions_m: Of each robot its own sources, shape (n_robots, n_sources, 3), world frame.
        axes: Their linear polarisations, unit vectors, shape (n_robots, n_sources, 3).
        burst_s: How long emissions last that are no pulses, 0 for pulses, shape (n_robots, n_sources).
    """

    positions_m: FloatArray
    axes: FloatArray
    burst_s: FloatArray


class Propagation(NamedTuple):
    """Sources and arrays, and what surrounds them.

    Attributes:
        sources: Each robot's own.
        arrays: One for each robot.
        surroundings: The same for all robots.
    """

    sources: SourceTable
    arrays: ArrayTable
    surroundings: Surroundings
