"""Pieces of equipment that lines cross, computed by the compiled functions of the radio model."""

import numba
import numpy as np

from dirmusic.arrays import BoolArray, FloatArray
from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing import upright_solids
from pdpatrol.sensing.radio.geometry import Vector, crosses, segment
from pdpatrol.sensing.radio.surroundings import Rows, solid_of


@numba.njit
def _cross(starts_m: FloatArray, ends_m: FloatArray, obstacles: Rows, n_pieces: int) -> BoolArray:
    crossed = np.zeros((len(starts_m), n_pieces), np.bool_)
    for i in range(len(starts_m)):
        start, end = starts_m[i], ends_m[i]
        path = segment(Vector(start[0], start[1], start[2]), Vector(end[0], end[1], end[2]))
        for k in range(obstacles.size):
            if crosses(path, solid_of(obstacles[k])):
                crossed[i, obstacles[k].owner] = True
    return crossed


def cross(starts_m: FloatArray, ends_m: FloatArray, solids: Rows, n_pieces: int) -> BoolArray:
    """Return which pieces lines from (n, 3) to (n, 3) cross, shape (n, n_pieces)."""
    return _cross(starts_m, ends_m, solids, n_pieces)


def solids_of(yard: Yard) -> Rows:
    """Return all solids of a yard."""
    return upright_solids(**vars(yard.solids))
