"""People and vehicles that move through a yard on given tracks."""
# pyright: reportAttributeAccessIssue=false
# The compiled bindings of MuJoCo carry no types for their enums and spec elements.

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from dirmusic.arrays import FloatArray
from pdpatrol.robot_models.sensors import OBSTACLE_CONTYPE
from pdpatrol.robot_models.yard.solids import Solid, YardSolids

MovingKind = Literal["person", "vehicle"]

MOVING_SOLIDS: dict[str, Solid] = {
    "person": Solid(radius_m=0.25, top_m=1.75),
    "vehicle": Solid(footprint_m=(4.5, 1.9), top_m=1.9),
}
"""Shape of each kind, x ahead. Assumed: the breadth of an adult with swinging arms, and a small van."""

MOVING_RGBA = {"person": (0.95, 0.55, 0.1, 1.0), "vehicle": (0.9, 0.8, 0.2, 1.0)}
"""Colours of high-visibility clothing and of a service vehicle."""


class MovingBody(NamedTuple):
    """Person or vehicle.

    Attributes:
        name: Unique name.
        kind: Person or vehicle.
    """

    name: str
    kind: MovingKind

    @property
    def solid(self) -> Solid:
        """Shape, in the frame of the body."""
        return MOVING_SOLIDS[self.kind]

    @property
    def half_size_m(self) -> tuple[float, float, float]:
        """MuJoCo's size of the shape: radius, half height and 0 of a cylinder, half lengths of a box."""
        (length_m, width_m), half_height_m = self.solid.footprint_m, 0.5 * self.solid.top_m
        if self.solid.radius_m > 0.0:
            return self.solid.radius_m, half_height_m, 0.0
        return 0.5 * length_m, 0.5 * width_m, half_height_m

    @property
    def label(self) -> str:
        """Name under which contacts are reported."""
        return f"moving/{self.name}"


class Trajectory(NamedTuple):
    """Motion of a body along straight lines between knots. Before the first and after the last knot it stands.

    Attributes:
        time_s: Time of each knot, ascending, shape (n,).
        place_m: Place at each knot, shape (n, 2), world frame.
        yaw_rad: Yaw from each knot to the next, shape (n,).
    """

    time_s: FloatArray
    place_m: FloatArray
    yaw_rad: FloatArray

    def pose(self, time_s: ArrayLike) -> FloatArray:
        """Return x m, y m and yaw rad at times (...), shape (..., 3)."""
        times = np.asarray(time_s, dtype=np.float64)
        x_m, y_m = (np.interp(times, self.time_s, along) for along in self.place_m.T)
        knot = np.clip(self.time_s.searchsorted(times, side="right") - 1, 0, self.time_s.size - 1)
        return np.stack([x_m, y_m, self.yaw_rad[knot]], axis=-1)


def distance_to_body(body: MovingBody, pose: FloatArray, points_m: FloatArray) -> FloatArray:
    """Return signed horizontal distances from points to a body, negative inside.

    Args:
        body: The body.
        pose: Its pose x m, y m, yaw rad, shape (3,), or one for each point, shape (n, 3).
        points_m: Points, world frame, shape (n, 2).

    Returns:
        Shape (n,), metres.
    """
    x_m, y_m, yaw_rad = pose[..., 0], pose[..., 1], pose[..., 2]
    cos, sin, dx_m, dy_m = np.cos(yaw_rad), np.sin(yaw_rad), points_m[:, 0] - x_m, points_m[:, 1] - y_m
    shape, zero = body.solid, np.zeros(1)
    footprint = YardSolids(
        centre_m=np.zeros((1, 2)),
        yaw_rad=zero,
        half_size_m=0.5 * np.array([shape.footprint_m]),
        radius_m=np.array([shape.radius_m]),
        bottom_m=zero,
        top_m=np.array([shape.top_m]),
        owner=np.zeros(1, dtype=np.intp),
    )
    own_m = np.stack([cos * dx_m + sin * dy_m, cos * dy_m - sin * dx_m], axis=-1)
    return footprint.horizontal_distance(own_m)[..., 0]


def add_moving_bodies(spec: mujoco.MjSpec, bodies: Sequence[MovingBody]) -> None:
    """Add a mocap body with one geom, both named `moving/NAME`, for each body; they collide with the robot only."""
    for body in bodies:
        is_round = body.solid.radius_m > 0.0
        spec.worldbody.add_body(name=body.label, mocap=True).add_geom(
            name=body.label,
            type=mujoco.mjtGeom.mjGEOM_CYLINDER if is_round else mujoco.mjtGeom.mjGEOM_BOX,
            pos=[0.0, 0.0, 0.5 * body.solid.top_m],
            size=body.half_size_m,
            rgba=MOVING_RGBA[body.kind],
            group=1,
            contype=OBSTACLE_CONTYPE,
            conaffinity=0,
        )


def describe_moving(body: MovingBody, track: Trajectory) -> dict[str, Any]:
    """Describe a body and its track as plain data, for logs."""
    return {"name": body.name, "kind": body.kind} | {key: value.tolist() for key, value in track._asdict().items()}


def described_moving(description: dict[str, Any]) -> tuple[MovingBody, Trajectory]:
    """Rebuild a body and its track from their description."""
    columns = (np.array(description[key], dtype=np.float64) for key in Trajectory._fields)
    return MovingBody(description["name"], description["kind"]), Trajectory(*columns)
