"""Free ground and shortest paths on the map that the robot carries."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from functools import cache
from itertools import permutations

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree

from dirmusic.arrays import BoolArray, FloatArray, IntArray
from pdpatrol.envs import Scenario
from pdpatrol.envs.scenario.radio import surroundings_of
from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing.radio.transmission import MIN_TRANSMISSION, Sight

CELL_M = 0.25
"""Grid spacing. Assumed; about the radius of a robot."""

MARGIN_M = 0.15
"""Clearance of paths beyond the robot's footprint. Assumed; three standard deviations of its pose."""

COMFORT_M = 0.8
"""Clearance below which ground costs up to twice as much. Assumed; keeps paths away from equipment where there is
space."""

ZONE_MARGIN_M = 0.4
"""Distance from a zone at which its limit applies. Assumed; the distance of points of a path and three standard
deviations of the pose, so that the limit holds in the zone."""

_MOVES = ((1, 0), (0, 1), (1, 1), (1, -1), (1, 2), (2, 1), (1, -2), (2, -1))
"""Moves between cells, along x and y; each is also used in reverse. With these sixteen directions, paths are 1.4 % too
long on average; with eight, they are 5.5 % too long and have turns of 45 degrees, for which a robot slows down."""


@dataclass(frozen=True)
class ShortestPaths:
    """Shortest paths from one place to all cells of a map.

    Attributes:
        length_m: Cost-weighted path length to every cell, shape (n_cells,); infinite for unreachable cells.
        before: Cell before each cell on its path, shape (n_cells,); the cell itself at the start and for unreachable
            cells.
        site_map: Map on which the paths were found.
    """

    length_m: FloatArray
    before: IntArray
    site_map: SiteMap

    def nearest(self, point_m: ArrayLike) -> int:
        """Return the reachable cell nearest to a point (2,)."""
        away_m = np.linalg.norm(self.site_map.centres_m - np.asarray(point_m)[:2], axis=-1)
        return int(np.where(np.isfinite(self.length_m), away_m, np.inf).argmin())

    def integrate(self, values: FloatArray) -> FloatArray:
        """Integrate a quantity along the path to each cell, shape (n_cells, ...); zero for unreachable cells.

        Args:
            values: Quantity per metre of path in each cell, shape (n_cells, ...).
        """
        before, centres_m = self.before, self.site_map.centres_m
        total = (values.T * np.linalg.norm(centres_m - centres_m[before], axis=-1)).T
        while (before != before[before]).any():  # each pass doubles the number of steps that are summed
            total = total + total[before]
            before = before[before]
        return total

    def cell_after(self, length_m: float) -> IntArray:
        """Return, for the path to each cell, the first cell at or beyond a length; for shorter paths, the last cell."""
        is_short = self.length_m[self.before] < length_m
        cell = np.where(is_short, np.arange(is_short.size), self.before)
        while (cell != cell[cell]).any():
            cell = cell[cell]
        return cell

    def cells(self, cell: int) -> IntArray:
        """Return the numbers of the cells from the start to `cell`, both included, shape (n,)."""
        cells = [cell]
        while (before := int(self.before[cells[-1]])) != cells[-1]:
            cells.append(before)
        return np.array(cells[::-1])

    def path(self, cell: int) -> FloatArray:
        """Return the cell centres from the start to `cell`, shape (n, 2), metres."""
        return self.site_map.centres_m[self.cells(cell)]


class SiteMap:
    """The yard as the operator's plan shows it: fence, equipment, route. It does not contain the discharges.

    Args:
        scenario: Scenario of the mission.
        yard: Yard to show; by default that of the scenario's map, which may differ from the true yard.

    Attributes:
        yard: Fence and equipment as shown.
        robot: The robot that must fit.
        route: Dock and waypoints.
        task: Rules of the mission.
        zones: Zones with a speed limit.
        obstacles_m: Points of obstacles that the plan does not show, shape (n, 2), world frame.
        centres_m: Cell centres, shape (n_cells, 2).
        clearance_m: Distance from each cell centre to equipment, fence or obstacle, shape (n_cells,).
        is_free: True for cells on which the robot fits, shape (n_cells,).
        moves: Costs of the moves between neighbouring free cells, at least `CELL_M`, shape (n_cells, n_cells).
        antenna_height_m: Height of the array above the ground.
        bearing_std_rad: Standard deviation of bearings from the uncertainty of array and heading.
        position_std_m: Standard deviation of the robot's position, along x and along y.
        knows_pattern_above: True if the antenna pattern is known outside the horizontal plane.
        sight: Transmission of the mapped equipment along straight paths.
    """

    def __init__(self, scenario: Scenario, yard: Yard | None = None) -> None:
        self.yard = scenario.known_yard if yard is None else yard
        self.robot = scenario.robot.description
        self.route = scenario.route
        self.task = scenario.task
        self.zones = scenario.zones
        self.antenna_height_m = scenario.array.height_m
        pose_error = scenario.pose_sensor.pose_error
        self.bearing_std_rad = float(np.hypot(scenario.known_array.bearing_std_rad, pose_error.heading_rad))
        self.position_std_m = pose_error.position_m
        self.knows_pattern_above = scenario.array.pattern_error == 0.0
        self.sight = Sight(surroundings_of(self.yard))
        shape = tuple(round(size / CELL_M) for size in self.yard.size_m)
        self.centres_m = CELL_M * (np.argwhere(np.ones(shape)) + np.float64(0.5))
        self._planned_clearance_m = self.yard.clearance(self.centres_m)
        self._place_obstacles(np.empty((0, 2)))

    def with_obstacles(self, points_m: FloatArray) -> SiteMap:
        """Return the same plan with these obstacles, shape (n, 2), world frame, instead of the present ones."""
        other = copy(self)
        other._place_obstacles(points_m)
        return other

    def _place_obstacles(self, points_m: FloatArray) -> None:
        """Set the obstacles and everything that depends on them."""
        self.obstacles_m = points_m
        self._obstacle_tree = KDTree(points_m)
        self.clearance_m = np.minimum(self._planned_clearance_m, self._obstacle_tree.query(self.centres_m)[0])
        self.is_free = self.clearance_m >= self.robot.footprint_radius_m + MARGIN_M
        self._free_cells = np.flatnonzero(self.is_free)
        self._free_tree = KDTree(self.centres_m[self._free_cells])
        self.moves = self._moves()

    def clearance(self, points_m: FloatArray) -> FloatArray:
        """Return the distance from points (..., 2) to equipment, fence or obstacle, shape (...)."""
        return np.minimum(self.yard.clearance(points_m), self._obstacle_tree.query(points_m)[0])

    def speed_limit(self, points_m: FloatArray) -> FloatArray:
        """Return the highest speed at points (..., 2) by zones and robot, shape (...)."""
        limit_mps = np.full(points_m.shape[:-1], self.robot.max_speed_mps)
        for zone in self.zones:
            is_near = zone.polygon.signed_distance(points_m) > -ZONE_MARGIN_M
            limit_mps = np.where(is_near, np.minimum(limit_mps, zone.limit_mps), limit_mps)
        return limit_mps

    def is_clear(self, start_m: FloatArray, end_m: FloatArray) -> bool:
        """Return True if the robot fits all along the straight line between two points (2,)."""
        between = np.linspace(start_m, end_m, 2 + int(np.linalg.norm(end_m - start_m) / CELL_M))
        return bool(self.clearance(between).min() >= self.robot.room_m)

    def in_sight(self, points_m: FloatArray, target_m: FloatArray, within_m: float) -> BoolArray:
        """Return whether the array above each point of the ground (n, 2) has a line of sight to a target (3,).

        Equipment within `within_m` of the target does not count; see `Sight`.
        """
        places_m = np.insert(points_m, 2, self.antenna_height_m, axis=-1)
        return self.sight(places_m, target_m, within_m) >= MIN_TRANSMISSION

    def _moves(self) -> csr_array:
        """Build the graph of moves over free cells; moves close to equipment cost more."""
        n_cells, n_y = self.is_free.size, round(self.yard.size_m[1] / CELL_M)
        price = 1.0 + np.clip((COMFORT_M - self.clearance_m) / COMFORT_M, 0.0, 1.0)
        steps = np.array([n_y * dx + dy for dx, dy in _MOVES])
        steps = np.sort(np.concatenate([steps, -steps]))
        costs = np.zeros((n_cells, steps.size))
        for dx, dy in _MOVES:
            by_x, by_y = (np.array([0, int(by / 2), by - int(by / 2), by]) for by in (dx, dy))
            # A move that leaves the grid wraps around to cells along the south or west fence, which are never free.
            passed = (self._free_cells + (n_y * by_x + by_y)[:, np.newaxis]) % n_cells
            passed = passed[:, self.is_free[passed].all(axis=0)]
            cost, step = CELL_M * np.hypot(dx, dy) * price[passed].mean(axis=0), n_y * dx + dy
            costs[passed[0], np.searchsorted(steps, step)] = cost
            costs[passed[-1], np.searchsorted(steps, -step)] = cost
        is_move = costs > 0.0
        ends = (np.arange(n_cells, dtype=np.int32)[:, np.newaxis] + steps.astype(np.int32))[is_move]
        begins = np.append(0, np.cumsum(np.count_nonzero(is_move, axis=1), dtype=np.int32)).astype(np.int32)
        return csr_array((costs[is_move], ends, begins), shape=(n_cells, n_cells))

    def cell(self, point_m: ArrayLike) -> int:
        """Return the free cell nearest to a point (2,)."""
        return int(self.nearest_free(point_m))

    def nearest_free(self, points_m: ArrayLike) -> IntArray:
        """Return the free cell nearest to each point (..., 2 or more), shape (...)."""
        return self._free_cells[self._free_tree.query(np.asarray(points_m)[..., :2])[1]]

    def reach(self, point_m: ArrayLike) -> ShortestPaths:
        """Find the shortest paths from a point (2,) to all cells."""
        length_m, before = dijkstra(self.moves, indices=self.nearest_free(point_m), return_predecessors=True)
        return ShortestPaths(length_m, np.where(before >= 0, before, np.arange(before.size)), self)

    def shortest_tour(self, places_m: Sequence[FloatArray], within_m: float) -> float:
        """Return the length of the shortest path from the dock to within a distance of each place, in the best order.

        From each place the path goes on to the nearest cell from which the next place is near enough.

        Args:
            places_m: At most a handful of places, each of shape (2,), world frame.
            within_m: Horizontal distance at which a place counts as reached.

        Returns:
            Path length, metres; 0 without places, infinite if a place cannot be reached.
        """
        is_near = [np.linalg.norm(self.centres_m - place_m, axis=-1) <= within_m for place_m in places_m]
        reach = cache(lambda cell: self.reach(self.centres_m[cell]))
        shortest_m = np.inf
        for order in permutations(is_near):
            cell, total_m = self.cell(self.route.dock_m), 0.0
            for near in order:
                paths = reach(cell)
                weighted_m = np.where(near, paths.length_m, np.inf)
                cell = int(weighted_m.argmin())
                total_m += distances_along(paths.path(cell))[-1] if np.isfinite(weighted_m[cell]) else np.inf
            shortest_m = min(shortest_m, total_m)
        return float(shortest_m)


def distances_along(path_m: FloatArray) -> FloatArray:
    """Return the distance of each point of a path (n, 2 or more) from its start, along it; shape (n,), metres."""
    return np.append(0.0, np.linalg.norm(np.diff(path_m[:, :2], axis=0), axis=-1).cumsum())
