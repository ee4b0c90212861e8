"""Free ground to path to wheel command, on the map that the robot carries."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from dirmusic.angles import difference
from envs import Scenario
from robot_models.inspector import CHASSIS_RADIUS_M, MAX_SPEED_MPS, MAX_YAW_RATE_RADPS

FloatArray = NDArray[np.float64]

CELL_M = 0.25
"""Grid spacing (assumed): a robot's radius."""

MARGIN_M = 0.15
"""Room left beside the robot (assumed): three standard deviations of its pose."""

COMFORT_M = 0.8
"""Ground nearer than this to equipment costs up to twice as much (assumed)."""

LOOKAHEAD_M = 0.7
"""How far ahead on the path the robot steers (assumed)."""


@dataclass(frozen=True, kw_only=True)
class Reach:
    """What can be reached from one place, and how.

    Attributes:
        length_m: Cost-weighted path length to every cell, shape (n_cells,); infinite where there is no way.
    """

    length_m: FloatArray
    _previous: NDArray[np.int32]
    _site_map: SiteMap

    def path(self, cell: int) -> FloatArray:
        """Cell centres from the start to `cell`, shape (n, 2), metres."""
        cells = [cell]
        while self._previous[cells[-1]] >= 0:
            cells.append(int(self._previous[cells[-1]]))
        return self._site_map.centres_m[cells[::-1]]


class SiteMap:
    """The yard as the operator's plan shows it: fence, equipment, route. It knows of no discharge."""

    def __init__(self, scenario: Scenario) -> None:
        self.yard = scenario.yard
        self.route = scenario.route
        self.task = scenario.task
        self._shape = tuple(round(size / CELL_M) for size in self.yard.size_m)

    @cached_property
    def centres_m(self) -> FloatArray:
        """Cell centres, shape (n_cells, 2)."""
        axes = [CELL_M * (np.arange(n) + 0.5) for n in self._shape]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1, dtype=np.float64).reshape(-1, 2)

    @cached_property
    def clearance_m(self) -> FloatArray:
        """Distance from each cell centre to equipment or fence, shape (n_cells,)."""
        return self.yard.clearance(self.centres_m)

    @cached_property
    def is_free(self) -> NDArray[np.bool_]:
        """Cells on which the robot fits, shape (n_cells,)."""
        return self.clearance_m >= CHASSIS_RADIUS_M + MARGIN_M

    @cached_property
    def _graph(self) -> csr_array:
        """Steps to the eight neighbours, between free cells, dearer close to equipment."""
        index = np.arange(self.is_free.size).reshape(self._shape)
        dear = 1.0 + np.clip((COMFORT_M - self.clearance_m) / COMFORT_M, 0.0, 1.0)
        rows, columns, costs = [], [], []
        for dx, dy in ((1, 0), (0, 1), (1, 1), (1, -1)):
            low, high = max(-dy, 0), self._shape[1] - max(dy, 0)
            a = index[: self._shape[0] - dx, low:high].ravel()
            b = index[dx:, low + dy : high + dy].ravel()
            both = self.is_free[a] & self.is_free[b]
            a, b = a[both], b[both]
            cost = CELL_M * np.hypot(dx, dy) * 0.5 * (dear[a] + dear[b])
            rows += [a, b]
            columns += [b, a]
            costs += [cost, cost]
        shape = (index.size, index.size)
        return csr_array((np.concatenate(costs), (np.concatenate(rows), np.concatenate(columns))), shape=shape)

    def cell(self, point_m: ArrayLike) -> int:
        """The free cell nearest to a point (2,)."""
        square = np.square(self.centres_m - np.asarray(point_m, dtype=np.float64)[:2]).sum(axis=-1)
        return int(np.where(self.is_free, square, np.inf).argmin())

    def reach(self, point_m: ArrayLike) -> Reach:
        """All shortest ways from a point (2,)."""
        length, previous = dijkstra(self._graph, indices=[self.cell(point_m)], return_predecessors=True)
        return Reach(length_m=length[0], _previous=previous[0], _site_map=self)


def steer(pose: FloatArray, path_m: FloatArray) -> tuple[float, float]:
    """Speed (m/s) and yaw rate (rad/s) that follow a path (n, 2): turn towards a point ahead, slow down in turns."""
    nearest = int(np.square(path_m - pose[:2]).sum(axis=-1).argmin())
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path_m[nearest:], axis=0), axis=-1))])
    ahead = path_m[nearest + min(int(np.searchsorted(along, LOOKAHEAD_M)), along.size - 1)]
    off = float(difference(np.arctan2(ahead[1] - pose[1], ahead[0] - pose[0]), pose[2]))
    yaw_rate = float(np.clip(2.5 * off, -MAX_YAW_RATE_RADPS, MAX_YAW_RATE_RADPS))
    return MAX_SPEED_MPS * max(0.0, 1.0 - abs(off) / np.radians(50.0)), yaw_rate
