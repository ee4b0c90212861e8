"""Links of the Sionna RT reference, with our own rays for each of its paths: see `make_reference.py`.

Sionna's matrices are in spherical coordinates: theta, which is down for level rays, and phi, counterclockwise on plan.
"""

import json
import math
from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.bearing.gain_delay import SPEED_OF_LIGHT_MPS
from pdpatrol.robot_models.yard.pieces import BoxEquipment
from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing import Faces, Surroundings, UprightSolids
from pdpatrol.sensing.radio.diffraction import (
    BoxEdge,
    EdgePoint,
    WedgeFaces,
    box_edge,
    edge_axes,
    is_hidden,
    round_one,
    to_edge,
    to_world,
)
from pdpatrol.sensing.radio.geometry import Vector, crosses, dot, normal_to, segment, towards
from pdpatrol.sensing.radio.materials import CONCRETE, METAL
from pdpatrol.sensing.radio.polarisation import Field, Reflection, component, face_reflection, reflected
from pdpatrol.sensing.radio.surroundings import solid_of

HERE = Path(__file__).parent
REFERENCE = json.loads((HERE / "reference.json").read_text(encoding="utf-8"))
EDGES = json.loads((HERE / "edges.json").read_text(encoding="utf-8"))["links"]
SMOOTH_METAL = METAL._replace(flat_share=1.0)
CONDUCTS = WedgeFaces(Reflection(-1.0 + 0.0j, 1.0 + 0.0j), Reflection(-1.0 + 0.0j, 1.0 + 0.0j), 0.0)
ENDLESS = {"low": -1e6, "high": 1e6}

Matrix = NDArray[np.complex128]


class Link(NamedTuple):
    """Source and receiver in a yard, with Sionna's paths."""

    around: Surroundings
    faces: Faces
    names: list[str]
    source: Vector
    receiver: Vector
    paths: list[Any]
    edges: list[Any]

    def of_kind(self, kind: str, order: int) -> list[Any]:
        return [path for path in self.paths if path[0] == kind and len(path[1]) == order]


@cache
def links() -> list[Link]:
    found: list[Link] = []
    for yard in REFERENCE["yards"]:
        boxes = [
            BoxEquipment(
                name=name,
                kind="wall",
                shape="box",
                position_m=(x, y),
                footprint_m=(length, width),
                height_m=height,
                yaw_deg=yaw_deg,
            )
            for name, (x, y, length, width, height, yaw_deg) in yard["boxes"].items()
        ]
        plan = Yard(size_m=(25.0, 20.0), equipment=tuple(boxes))
        solids = UprightSolids(**plan.solid_columns())
        faces = Faces.of(solids)
        around = Surroundings.of_materials([SMOOTH_METAL] * len(boxes), faces, solids, CONCRETE)
        for link in yard["links"]:
            ends = Vector(*link["source_m"]), Vector(*link["receiver_m"])
            found.append(Link(around, faces, list(yard["boxes"]), *ends, link["paths"], EDGES[len(found)]))
    return found


def matrix_of(stored: list[float]) -> Matrix:
    """Return the polarisation matrix of a path, over the amplitude at 1 m."""
    parts = np.reshape(stored, (2, 2, 2))
    return parts[..., 0] + 1j * parts[..., 1]


def spherical(ray: Vector) -> tuple[Vector, Vector]:
    """Return theta and phi of a direction."""
    level = math.hypot(ray.x, ray.y)
    theta = Vector(ray.z * ray.x / level, ray.z * ray.y / level, -level)
    return theta, Vector(-ray.y / level, ray.x / level, 0.0)


def back(ray: Vector) -> Vector:
    return Vector(-ray.x, -ray.y, -ray.z)


def field_along(axis: Vector) -> Field:
    return Field(complex(axis.x), complex(axis.y), complex(axis.z))


def decibels(ratio: NDArray[Any]) -> NDArray[np.float64]:
    return 20.0 * np.log10(np.abs(ratio))


def delay_ns(length_m: float) -> float:
    return 1e9 * length_m / SPEED_OF_LIGHT_MPS


def face_at(link: Link, owner: str, point: list[float]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return normal and middle of the face of a box, or of the ground, that a point is on."""
    if owner == "ground":
        return np.array([0.0, 0.0, 1.0]), np.zeros(3)
    faces = link.faces
    its = np.flatnonzero(faces.owner == link.names.index(owner))
    off = np.asarray(point) - faces.centre_m[its]
    aside = np.abs(np.einsum("fai,fi->fa", faces.axes[its], off)) - faces.half_size_m[its]
    away = np.abs(np.einsum("fi,fi->f", faces.normal[its], off)) + np.maximum(aside, 0.0).sum(axis=1)
    assert away.min() < 3e-3
    face = its[away.argmin()]
    return faces.normal[face], faces.centre_m[face]


def by_reflections(link: Link, owners: list[str], points: list[list[float]]) -> tuple[Matrix, float]:
    """Return our own matrix and delay of a ray reflected by faces in turn."""
    planes = [face_at(link, *each) for each in zip(owners, points, strict=True)]
    images = [np.array(link.source)]
    for normal, middle in planes:
        images.append(images[-1] - 2.0 * np.dot(images[-1] - middle, normal) * normal)
    stops = [np.array(link.receiver)]
    for (normal, middle), image in zip(planes[::-1], images[:0:-1], strict=True):
        share = np.dot(middle - image, normal) / np.dot(stops[0] - image, normal)
        stops.insert(0, image + share * (stops[0] - image))
    np.testing.assert_allclose(np.reshape(stops[:-1], (-1, 3)), np.reshape(points, (-1, 3)), atol=2e-3)
    way = [link.source, *(Vector(*stop) for stop in stops)]
    rays = [towards(start, end) for start, end in pairwise(way)]
    matrix, received_as = np.empty((2, 2), np.complex128), spherical(back(rays[-1]))
    for column, sent in enumerate(spherical(rays[0])):
        field = field_along(sent)
        for owner, plane, arrives, leaves in zip(owners, planes, rays, rays[1:], strict=False):
            normal, material = Vector(*plane[0]), CONCRETE if owner == "ground" else SMOOTH_METAL
            field = reflected(field, arrives, leaves, normal, face_reflection(abs(dot(leaves, normal)), material))
        matrix[:, column] = [component(field, axis) for axis in received_as]
    length_m = float(np.linalg.norm(np.array(link.receiver) - images[-1]))
    matrix /= length_m
    return matrix, delay_ns(length_m)


class Bend(NamedTuple):
    """Ray around an edge: edge, ends in its coordinates, directions, and lengths."""

    corner: BoxEdge
    source: EdgePoint
    target: EdgePoint
    edge: Vector
    arrives: Vector
    leaves: Vector
    before_m: float
    behind_m: float

    def in_edge_coordinates(self, matrix: Matrix) -> Matrix:
        """Rotate a matrix in spherical coordinates so that its first row and column lie in the planes of the edge."""
        turned: list[Matrix] = []
        for ray, seen, sideways in (
            (self.arrives, self.arrives, normal_to(self.arrives, self.edge)),
            (self.leaves, back(self.leaves), normal_to(self.edge, self.leaves)),
        ):
            axes = normal_to(sideways, ray), sideways
            turned.append(np.array([[dot(axis, other) for other in spherical(seen)] for axis in axes], complex))
        return turned[1] @ matrix @ turned[0].T

    @property
    def sine(self) -> float:
        """Sine of the angle between ray and edge."""
        return math.sqrt(1.0 - dot(self.arrives, self.edge) ** 2)

    @property
    def ours(self) -> tuple[complex, complex]:
        """Amplitudes behind an endless edge of the components along it and across it, over that at 1 m."""
        ray = round_one(self.corner._replace(**ENDLESS), self.source, self.target, CONDUCTS)
        length_m = self.before_m + self.behind_m
        return -ray.soft / length_m, -ray.hard / length_m


def bend_at(link: Link, point: list[float]) -> Bend:
    """Return the ray around the edge that a point is on and that both ends see."""
    for box in (solid_of(link.around.obstacles[k]) for k in range(len(link.names))):
        for family, number in ((f, n) for f in range(3) for n in range(4 if f == 0 else 2)):
            frame, corner = edge_axes(box, family), box_edge(box, family, number)
            at = to_edge(frame, Vector(*point))
            if math.hypot(at.p - corner.p, at.q - corner.q) > 2e-3 or not corner.low < at.along < corner.high:
                continue
            source, target = to_edge(frame, link.source), to_edge(frame, link.receiver)
            if is_hidden(corner, source) or is_hidden(corner, target):  # another edge ends close by
                continue
            ray = round_one(corner, source, target, CONDUCTS)
            place = to_world(frame, corner.p, corner.q, ray.first)
            np.testing.assert_allclose(place, point, atol=2e-3)
            arrives, leaves = towards(link.source, place), towards(place, link.receiver)
            return Bend(corner, source, target, frame.edge, arrives, leaves, ray.before_m, ray.behind_m)
    raise AssertionError(point)


def bends_of_luebbers() -> Iterator[tuple[Bend, list[Any]]]:
    """Yield each diffraction with point, delay and matrix by the older Sionna."""
    for link in links():
        for stored in link.edges:
            yield bend_at(link, stored[0]), stored


def is_clear(link: Link, start: Vector, end: Vector) -> bool:
    obstacles = link.around.obstacles
    return not any(crosses(segment(start, end), solid_of(obstacles[k])) for k in range(obstacles.size))
