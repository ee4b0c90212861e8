"""Which pieces of equipment many lines cross, as the radio's compiled loops say it of one."""

import numba
import numpy as np
from numpy.typing import NDArray

from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing import Solids
from pdpatrol.sensing.radio.materials import METAL
from pdpatrol.sensing.radio.obstruction import crosses, line
from pdpatrol.sensing.radio.tables import Obstacles, obstacle_table, shape_of
from pdpatrol.sensing.radio.vectors import Vector


@numba.njit
def _cross(
    starts_m: NDArray[np.float64], ends_m: NDArray[np.float64], obstacles: Obstacles, n_pieces: int
) -> NDArray[np.bool_]:
    crossed = np.zeros((len(starts_m), n_pieces), np.bool_)
    for i in range(len(starts_m)):
        start, end = starts_m[i], ends_m[i]
        way = line(Vector(start[0], start[1], start[2]), Vector(end[0], end[1], end[2]))
        for k in range(obstacles.size):
            if crosses(way, shape_of(obstacles[k])):
                crossed[i, obstacles[k].owner] = True
    return crossed


def cross(
    starts_m: NDArray[np.float64], ends_m: NDArray[np.float64], solids: Solids, n_pieces: int
) -> NDArray[np.bool_]:
    """For lines (n, 3) to (n, 3): shape (n, n_pieces)."""
    return _cross(starts_m, ends_m, obstacle_table(solids, [METAL] * solids.owner.size), n_pieces)


def solids_of(yard: Yard) -> Solids:
    """All solids of a yard."""
    return Solids(**yard.obstacles()._asdict())
