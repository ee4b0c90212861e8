"""Scenario table of people and vehicles that move through the yard, unknown to the robot."""

from collections.abc import Iterator
from itertools import pairwise
from math import atan2, dist, pi
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from pdpatrol.robot_models.moving_bodies import MOVING_SOLIDS, MovingBody, MovingKind, Trajectory, distance_to_body
from pdpatrol.robot_models.yard.quantities import Coordinate, Name
from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing.quantities import Config

MOST_MOVING = 32
"""Maximum number of people and vehicles (assumed)."""

LEAST_LEG_M = 0.5
"""Shortest distance between two points of a path. Assumed; bounds the size of a track."""

Pause = Annotated[float, Field(ge=0.0, le=86_400.0)]


class MovingConfig(Config):
    """Person or vehicle that moves on a path, without regard to the robot.

    It starts at the first point after a pause. At the last point it pauses again and goes back, vehicles in reverse
    gear; with `loop`, it goes on to the first point instead, and pauses only there. At corners it turns on the spot. It
    is an obstacle for robot and lidar, not for radio waves.
    """

    name: Name
    """Name of the person or vehicle, used once."""
    kind: MovingKind
    """`person`, or `vehicle`: a van of 4.5 x 1.9 m."""
    path_m: Annotated[tuple[tuple[Coordinate, Coordinate], ...], Field(min_length=2, max_length=100)]
    """Corners of the path, world frame."""
    speed_mps: Annotated[float, Field(ge=0.05, le=10.0)]
    """Speed along the path."""
    loop: bool = False
    """Go on from the last point to the first, instead of back along the path."""
    pause_s: tuple[Pause, Pause] = (0.0, 0.0)
    """Shortest and longest pause; each pause is drawn uniformly."""

    @property
    def body(self) -> MovingBody:
        """Name and shape."""
        return MovingBody(self.name, self.kind)

    @property
    def points_m(self) -> tuple[tuple[float, float], ...]:
        """Points of one passage in order, from the first to the last, or back to the first."""
        return (*self.path_m, self.path_m[0]) if self.loop else self.path_m

    @model_validator(mode="after")
    def _check_path(self) -> Self:
        if self.pause_s[0] > self.pause_s[1]:
            raise ValueError(f"pause_s: must be the shortest and the longest pause, got {self.pause_s}")
        for before_m, point_m in pairwise(self.points_m):
            if dist(before_m, point_m) < LEAST_LEG_M:
                raise ValueError(f"path_m: points must be {LEAST_LEG_M:g} m apart, {before_m} is followed by {point_m}")
        return self

    def errors(self, yard: Yard, dock_m: tuple[float, float], room_m: float) -> Iterator[str]:
        """Yield an error if the path leaves the yard or crosses equipment, or starts on the robot at its dock.

        Args:
            yard: True yard.
            dock_m: Dock of the robot.
            room_m: Distance from the dock that the robot needs.
        """
        solid = MOVING_SOLIDS[self.kind]
        half_width_m = solid.radius_m + 0.5 * solid.footprint_m[1]
        beyond_m = max(0.5 * solid.footprint_m[0] - half_width_m, 0.0)
        for start_m, end_m in pairwise(self.points_m):
            length_m = dist(start_m, end_m)
            along_m = np.arange(-beyond_m, length_m + beyond_m + 0.1, 0.1)
            clearance_m = yard.clearance(start_m + np.outer(along_m / length_m, np.subtract(end_m, start_m)))
            if clearance_m.min() < half_width_m:
                yield (
                    f"path_m: must stay {half_width_m:g} m from fence and equipment, comes within "
                    f"{clearance_m.min():.2f} m between {start_m} and {end_m}"
                )
        start = np.array([*self.path_m[0], _yaw(*self.points_m[:2])])
        away_m = float(distance_to_body(self.body, start, np.array([dock_m]))[0])
        if away_m < room_m:
            yield f"path_m: must start {room_m:.3g} m or more from the robot at its dock, starts {away_m:.2f} m from it"

    def draw(self, duration_s: float, rng: np.random.Generator) -> Trajectory:
        """Draw the track of one episode, of at least a given duration."""
        knots, time_s, points_m, is_way_back = list[tuple[float, float, float, float]](), 0.0, self.points_m, False
        while time_s <= duration_s:
            knots.append((time_s, *points_m[0], _yaw(*points_m[:2], is_reverse=is_way_back)))
            time_s += rng.uniform(*self.pause_s)
            for start_m, end_m in pairwise(points_m):
                knots.append((time_s, *start_m, _yaw(start_m, end_m, is_reverse=is_way_back)))
                time_s += dist(start_m, end_m) / self.speed_mps
            if not self.loop:
                points_m, is_way_back = points_m[::-1], not is_way_back
        time, x, y, yaw = np.array([*knots, (time_s, *points_m[0], knots[-1][3])]).T
        return Trajectory(time, np.column_stack([x, y]), yaw)


def _yaw(start_m: tuple[float, float], end_m: tuple[float, float], *, is_reverse: bool = False) -> float:
    """Return the yaw of a body that moves from one point to another, in reverse or not."""
    return atan2(end_m[1] - start_m[1], end_m[0] - start_m[0]) + (pi if is_reverse else 0.0)
