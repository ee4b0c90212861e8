"""Free ground and the shortest ways over it, on the map that the robot carries."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree

from dirmusic.locating.rules import AssignmentRules
from pdpatrol.envs import Scenario
from pdpatrol.envs.scenario.radio import surroundings_of
from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing.radio.sight import Sight

FloatArray = NDArray[np.float64]

CELL_M = 0.25
"""Grid spacing (assumed): about the radius of a robot."""

MARGIN_M = 0.15
"""Room left beside the robot (assumed): three standard deviations of its pose."""

LEAST_SIGHT = 10 ** (-AssignmentRules().sight_loss_db / 20)
"""Share of a wave that is left on the straight path where a target is in sight: as pulses are judged."""

STEPS = ((1, 0), (0, 1), (1, 1), (1, -1), (1, 2), (2, 1), (1, -2), (2, -1))
"""Of a path, in cells along x and y, and back: ways run in sixteen directions, 1.4 % longer than they need be on
average; in eight directions they are 5.5 %, with turns of 45 degrees, for which a robot slows down."""

COMFORT_M = 0.8
"""Ground nearer than this to equipment costs up to twice as much (assumed)."""


@dataclass(frozen=True, kw_only=True)
class ShortestPaths:
    """What can be reached from one place, and how.

    Attributes:
        length_m: Cost-weighted path length to every cell, shape (n_cells,); infinite where there is no way.
    """

    length_m: FloatArray
    _previous: NDArray[np.int32]
    _site_map: SiteMap

    def nearest(self, point_m: ArrayLike) -> int:
        """The cell nearest to a point (2,) among those that can be reached."""
        return self._site_map.nearest(point_m, np.isfinite(self.length_m))

    def gather(self, values: FloatArray) -> FloatArray:
        """What is gathered on the way to each cell, shape (n_cells, ...); nothing where there is no way.

        Args:
            values: Of a metre of way in each cell, shape (n_cells, ...).
        """
        before, centres_m = self._before, self._site_map.centres_m
        step_m = np.linalg.norm(centres_m - centres_m[before], axis=-1)
        gathered = values * step_m.reshape(-1, *np.ones(values.ndim - 1, dtype=np.intp))
        while (before != before[before]).any():  # each time, ways are gathered twice as far back
            gathered = gathered + gathered[before]
            before = before[before]
        return gathered

    def along(self, length_m: float) -> NDArray[np.intp]:
        """The cell on the way to each cell where the way is so long first; the cell itself if it is nearer."""
        is_short = self.length_m[self._before] < length_m
        along = np.where(is_short, np.arange(is_short.size), self._before)
        while (along != along[along]).any():
            along = along[along]
        return along

    @cached_property
    def _before(self) -> NDArray[np.intp]:
        """The cell before each cell on the way to it; itself where the ways start and where there is none."""
        return np.where(self._previous >= 0, self._previous, np.arange(self._previous.size))

    def cells(self, cell: int) -> NDArray[np.intp]:
        """Numbers of the cells on the way from the start to `cell`, both included, shape (n,)."""
        cells = [cell]
        while self._previous[cells[-1]] >= 0:
            cells.append(int(self._previous[cells[-1]]))
        return np.array(cells[::-1], dtype=np.intp)

    def path(self, cell: int) -> FloatArray:
        """Cell centres from the start to `cell`, shape (n, 2), metres."""
        return self._site_map.centres_m[self.cells(cell)]


class SiteMap:
    """The yard as the operator's plan shows it: fence, equipment, route. It knows of no discharge.

    Args:
        scenario: Of the mission.
        yard: What it shows; by default what the scenario's map does, which may differ from what stands there.

    Attributes:
        yard: Fence and equipment as shown.
        robot: The robot that is to fit.
        obstacles_m: Points of what stands in the way though the plan does not show it, shape (n, 2), world frame.
        centres_m: Cell centres, shape (n_cells, 2).
        antenna_height_m: Of the array above the ground.
        bearing_std_rad: How far off bearings may be, by what is not known of array and heading.
        position_std_m: How far off the robot's place may be, along x and y.
        knows_pattern_above: Whether the robot takes the pattern of its antennas to hold off the plane as well.
        sight: What the equipment that is shown leaves of waves on straight paths.
    """

    def __init__(self, scenario: Scenario, yard: Yard | None = None) -> None:
        self.yard = scenario.known_yard if yard is None else yard
        self.robot = scenario.robot.description
        self.route = scenario.route
        self.task = scenario.task
        self.antenna_height_m = scenario.array.height_m
        pose_error = scenario.pose_sensor.pose_error
        self.bearing_std_rad = float(np.hypot(scenario.known_array.bearing_std_rad, pose_error.heading_rad))
        self.position_std_m = pose_error.position_m
        self.knows_pattern_above = scenario.array.pattern_error == 0.0
        self.sight = Sight(surroundings_of(self.yard))
        self.obstacles_m: FloatArray = np.empty((0, 2))
        self._shape = tuple(round(size / CELL_M) for size in self.yard.size_m)
        axes = [CELL_M * (np.arange(n) + 0.5) for n in self._shape]
        cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1, dtype=np.float64)
        self.centres_m: FloatArray = cells.reshape(-1, 2)
        self._planned_clearance_m = self.yard.clearance(self.centres_m)

    def with_obstacles(self, points_m: FloatArray) -> SiteMap:
        """The same plan with these obstacles, shape (n, 2), world frame, instead of those it had."""
        other = copy(self)
        for stale in ("clearance_m", "is_free", "_free_cells", "_graph"):
            vars(other).pop(stale, None)
        other.obstacles_m = points_m
        return other

    @cached_property
    def clearance_m(self) -> FloatArray:
        """Distance from each cell centre to equipment, fence or obstacle, shape (n_cells,)."""
        return np.minimum(self._planned_clearance_m, self._to_obstacles(self.centres_m))

    def clearance(self, points_m: FloatArray) -> FloatArray:
        """Distance from points (..., 2) to equipment, fence or obstacle, shape (...)."""
        return np.minimum(self.yard.clearance(points_m), self._to_obstacles(points_m))

    def _to_obstacles(self, points_m: FloatArray) -> FloatArray:
        if not self.obstacles_m.size:
            return np.full(points_m.shape[:-1], np.inf)
        return np.asarray(KDTree(self.obstacles_m).query(points_m)[0], dtype=np.float64)

    def is_clear(self, start_m: FloatArray, end_m: FloatArray) -> bool:
        """Whether the robot fits all along the straight line between two points (2,)."""
        between = np.linspace(start_m, end_m, 2 + int(np.linalg.norm(end_m - start_m) / CELL_M))
        return bool(self.clearance(between).min() >= self.robot.room_m)

    def in_sight(self, points_m: FloatArray, target_m: FloatArray, within_m: float) -> NDArray[np.bool_]:
        """Whether the array over points of the ground (n, 2) has a target (3,) in sight; `within_m` as of `Sight`."""
        places_m = np.column_stack([points_m, np.full(len(points_m), self.antenna_height_m)])
        return self.sight(places_m, target_m, within_m) >= LEAST_SIGHT

    @cached_property
    def is_free(self) -> NDArray[np.bool_]:
        """Cells on which the robot fits, shape (n_cells,)."""
        return self.clearance_m >= self.robot.footprint_radius_m + MARGIN_M

    @cached_property
    def _graph(self) -> csr_array:
        """Steps past free cells, dearer close to equipment."""
        index = np.arange(self.is_free.size).reshape(self._shape)
        dear = 1.0 + np.clip((COMFORT_M - self.clearance_m) / COMFORT_M, 0.0, 1.0)
        rows, columns, costs = [], [], []
        for dx, dy in STEPS:
            low, high = max(-dy, 0), self._shape[1] - max(dy, 0)
            passed = [
                index[x : self._shape[0] - dx + x, low + y : high + y].ravel()
                for x, y in ((0, 0), (int(dx / 2), int(dy / 2)), (dx - int(dx / 2), dy - int(dy / 2)), (dx, dy))
            ]
            is_clear = self.is_free[passed].all(axis=0)
            cost = CELL_M * np.hypot(dx, dy) * dear[passed].mean(axis=0)[is_clear]
            a, b = passed[0][is_clear], passed[-1][is_clear]
            rows += [a, b]
            columns += [b, a]
            costs += [cost, cost]
        shape = (index.size, index.size)
        return csr_array((np.concatenate(costs), (np.concatenate(rows), np.concatenate(columns))), shape=shape)

    def cell(self, point_m: ArrayLike) -> int:
        """The free cell nearest to a point (2,)."""
        return int(self.nearest_free(np.asarray(point_m, dtype=np.float64)[:2]))

    def nearest_free(self, points_m: FloatArray) -> NDArray[np.intp]:
        """The free cell nearest to each point (..., 2), shape (...)."""
        tree, cells = self._free_cells
        return cells[tree.query(points_m)[1]]

    @cached_property
    def _free_cells(self) -> tuple[KDTree, NDArray[np.intp]]:
        """The free cells, to be searched by place."""
        cells = np.flatnonzero(self.is_free)
        return KDTree(self.centres_m[cells]), cells

    def nearest(self, point_m: ArrayLike, among: NDArray[np.bool_]) -> int:
        """The cell nearest to a point (2,) of those marked in `among`, shape (n_cells,)."""
        square = np.square(self.centres_m - np.asarray(point_m, dtype=np.float64)[:2]).sum(axis=-1)
        return int(np.where(among, square, np.inf).argmin())

    def reach(self, point_m: ArrayLike) -> ShortestPaths:
        """All shortest ways from a point (2,)."""
        length, previous = dijkstra(self._graph, indices=[self.cell(point_m)], return_predecessors=True)
        return ShortestPaths(length_m=length[0], _previous=previous[0], _site_map=self)

    def way_along_route(self) -> FloatArray:
        """From the dock past the stops of the route and back, as far as ways are known, shape (n, 2), metres."""
        stops = (self.route.dock_m, *self.route.stops_m, self.route.dock_m) if self.route.stops_m else ()
        legs = [self.reach(start).path(self.cell(end)) for start, end in pairwise(stops)]
        way_m = np.concatenate([np.empty((0, 2)), *(leg for leg in legs if len(leg) > 1)])
        ahead = np.diff(way_m, axis=0)
        goes_straight = np.isclose(ahead[:-1, 0] * ahead[1:, 1], ahead[:-1, 1] * ahead[1:, 0])
        return way_m[np.flatnonzero(np.concatenate([[True], ~goes_straight, [True]]))] if len(way_m) > 2 else way_m
