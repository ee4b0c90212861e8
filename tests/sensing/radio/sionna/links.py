"""Links of the Sionna RT reference, see `make_reference.py`, and our own rays around its edges.

Sionna's matrices are in spherical coordinates: theta, which is down for level rays, and phi, counterclockwise from
above.
"""

import json
import math
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dirmusic.arrays import FloatArray
from pdpatrol.sensing import Surroundings, upright_solids
from pdpatrol.sensing.quantities import SPEED_OF_LIGHT_MPS
from pdpatrol.sensing.radio.diffraction import (
    WedgeFaces,
    box_edge,
    edge_frame,
    is_hidden,
    round_one,
)
from pdpatrol.sensing.radio.geometry import Vector, crosses, dot, normal_to, segment, to_frame, to_world, towards
from pdpatrol.sensing.radio.materials import CONCRETE, METAL
from pdpatrol.sensing.radio.polarisation import Reflection
from pdpatrol.sensing.radio.surroundings import faces_of, made_of, solid_of

REFERENCE = json.loads(Path(__file__).with_name("reference.json").read_text(encoding="utf-8"))
CONDUCTS = WedgeFaces(Reflection(-1.0 + 0.0j, 1.0 + 0.0j), Reflection(-1.0 + 0.0j, 1.0 + 0.0j), 0.0)

Matrix = NDArray[np.complex128]


class SionnaPath(NamedTuple):
    """Path found by Sionna RT.

    Attributes:
        kind: "direct", "reflection" or "edge".
        owners: Box that each point lies on, or "ground".
        points: Points of reflection or diffraction.
        delay_ns: Travel time.
        matrix: Polarisation matrix relative to the amplitude at 1 m, real and imaginary parts.
    """

    kind: str
    owners: list[str]
    points: list[list[float]]
    delay_ns: float
    matrix: list[float]

    @property
    def polarisation(self) -> Matrix:
        """Polarisation matrix relative to the amplitude at 1 m, shape (2, 2)."""
        parts = np.reshape(self.matrix, (2, 2, 2))
        return parts[..., 0] + 1j * parts[..., 1]


class Link(NamedTuple):
    """Source and receiver in a yard, with Sionna's paths."""

    around: Surroundings
    source: Vector
    receiver: Vector
    paths: list[SionnaPath]

    def of_kind(self, kind: str, order: int) -> list[SionnaPath]:
        return [path for path in self.paths if path.kind == kind and len(path.owners) == order]

    def received(self, path: SionnaPath, axis: Vector) -> complex:
        """Return the signal of a circular antenna from a source with a polarisation axis, as our `received` does."""
        ray = towards(self.source, Vector(*path.points[0]) if path.points else self.receiver)
        sent = np.array([dot(axis, across) for across in spherical(ray)])
        theta, phi = path.polarisation @ (sent / np.linalg.norm(sent))
        return complex(phi - 1j * theta)

    def is_clear(self, start: Vector, end: Vector) -> bool:
        obstacles = self.around.obstacles
        return not any(crosses(segment(start, end), solid_of(obstacles[k])) for k in range(obstacles.size))


@cache
def links() -> list[Link]:
    found: list[Link] = []
    for yard in REFERENCE["yards"]:
        boxes = np.array(list(yard["boxes"].values()))
        solids = upright_solids(
            centre_m=boxes[:, :2],
            yaw_rad=np.radians(boxes[:, 5]),
            half_size_m=0.5 * boxes[:, 2:4],
            radius_m=np.zeros(len(boxes)),
            bottom_m=np.zeros(len(boxes)),
            top_m=boxes[:, 4],
            owner=np.arange(len(boxes)),
        )
        obstacles = made_of(solids, [METAL._replace(flat_share=1.0)] * len(boxes))
        around = Surroundings(faces_of(obstacles), CONCRETE, obstacles)
        for link in yard["links"]:
            paths = [SionnaPath(*path) for path in link["paths"]]
            found.append(Link(around, Vector(*link["source_m"]), Vector(*link["receiver_m"]), paths))
    return found


def spherical(ray: Vector) -> tuple[Vector, Vector]:
    """Return theta and phi of a direction."""
    level = math.hypot(ray.x, ray.y)
    theta = Vector(ray.z * ray.x / level, ray.z * ray.y / level, -level)
    return theta, Vector(-ray.y / level, ray.x / level, 0.0)


def decibels(ratio: NDArray[Any]) -> FloatArray:
    return 20.0 * np.log10(np.abs(ratio))


def delay_ns(length_m: ArrayLike) -> FloatArray:
    return 1e9 * np.asarray(length_m) / SPEED_OF_LIGHT_MPS


class Bend(NamedTuple):
    """Ray around an edge: directions, length, and the amplitudes of the component along an infinite edge."""

    edge: Vector
    arrives: Vector
    leaves: Vector
    length_m: float
    soft: complex

    def in_edge_coordinates(self, matrix: Matrix) -> Matrix:
        """Rotate a matrix in spherical coordinates so that its first row and column lie in the planes of the edge."""
        turned: list[Matrix] = []
        back = Vector(-self.leaves.x, -self.leaves.y, -self.leaves.z)
        for ray, seen, sideways in (
            (self.arrives, self.arrives, normal_to(self.arrives, self.edge)),
            (self.leaves, back, normal_to(self.edge, self.leaves)),
        ):
            axes = normal_to(sideways, ray), sideways
            turned.append(np.array([[dot(axis, other) for other in spherical(seen)] for axis in axes], complex))
        return turned[1] @ matrix @ turned[0].T

    @property
    def sine(self) -> float:
        """Sine of the angle between ray and edge."""
        return math.sqrt(1.0 - dot(self.arrives, self.edge) ** 2)


def bend_at(link: Link, point: list[float]) -> Bend:
    """Return the ray around the edge that contains a point and is visible from both ends."""
    obstacles = link.around.obstacles
    for box in (solid_of(obstacles[k]) for k in range(obstacles.size)):
        for family, number in ((f, n) for f in range(3) for n in range(4 if f == 0 else 2)):
            frame, corner = edge_frame(box, family), box_edge(box, family, number)
            at = to_frame(frame, Vector(*point))
            if math.hypot(at.x - corner.x, at.y - corner.y) > 2e-3 or not corner.low < at.z < corner.high:
                continue
            source, target = to_frame(frame, link.source), to_frame(frame, link.receiver)
            if is_hidden(corner, source) or is_hidden(corner, target):  # another edge ends close by
                continue
            ray = round_one(corner, source, target, CONDUCTS)
            endless = round_one(corner._replace(low=-1e6, high=1e6), source, target, CONDUCTS)
            place, length_m = to_world(frame, Vector(corner.x, corner.y, ray.first)), ray.before_m + ray.behind_m
            np.testing.assert_allclose(place, point, atol=2e-3)
            arrives, leaves = towards(link.source, place), towards(place, link.receiver)
            return Bend(frame.z, arrives, leaves, length_m, -endless.soft / length_m)
    raise AssertionError(point)
