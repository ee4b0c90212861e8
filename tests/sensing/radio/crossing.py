"""Pieces of equipment that lines cross, by the compiled functions of the radio model."""

import numba
import numpy as np
from numpy.typing import NDArray

from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing import upright_solids
from pdpatrol.sensing.radio.geometry import Vector, crosses, segment
from pdpatrol.sensing.radio.surroundings import Rows, solid_of


@numba.njit
def _cross(
    starts_m: NDArray[np.float64], ends_m: NDArray[np.float64], obstacles: Rows, n_pieces: int
) -> NDArray[np.bool_]:
    crossed = np.zeros((len(starts_m), n_pieces), np.bool_)
    for i in range(len(starts_m)):
        start, end = starts_m[i], ends_m[i]
        path = segment(Vector(start[0], start[1], start[2]), Vector(end[0], end[1], end[2]))
        for k in range(obstacles.size):
            if crosses(path, solid_of(obstacles[k])):
                crossed[i, obstacles[k].owner] = True
    return crossed


def cross(starts_m: NDArray[np.float64], ends_m: NDArray[np.float64], solids: Rows, n_pieces: int) -> NDArray[np.bool_]:
    """Return which pieces lines from (n, 3) to (n, 3) cross, shape (n, n_pieces)."""
    return _cross(starts_m, ends_m, solids, n_pieces)


def solids_of(yard: Yard) -> Rows:
    """Return all solids of a yard."""
    return upright_solids(**yard.solid_columns())
