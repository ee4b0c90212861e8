"""Scenes of a wall, a piece of equipment and the ground, with stated losses and reflections."""

from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from pdpatrol.sensing import Faces, Surroundings, UprightSolids
from pdpatrol.sensing.radio.materials import Material


def ground_face() -> Faces:
    return Faces(np.zeros((1, 3)), np.eye(3)[2:], np.eye(3)[np.newaxis, :2], np.full((1, 2), np.inf), np.array([-1]))


def wall_face(centre_m: ArrayLike, normal: tuple[float, float], half_m: tuple[float, float]) -> Faces:
    """Make one upright face; `half_m` is half its length and half its height."""
    x, y = normal
    axes = np.array([[[-y, x, 0.0], [0.0, 0.0, 1.0]]])
    return Faces(np.array([centre_m]), np.array([[x, y, 0.0]]), axes, np.array([half_m]), np.array([0]))


def solids_at(
    *centres: tuple[float, float],
    half_m: tuple[float, float] = (0.0, 0.0),
    radius_m: float = 0.0,
    bottom_m: float = 0.0,
    top_m: float = 3.0,
) -> UprightSolids:
    """Make equal solids at centres on plan, each a piece of equipment."""
    one = np.ones(len(centres))
    half, owner = np.tile(half_m, (one.size, 1)), np.arange(one.size)
    return UprightSolids(np.array(centres), 0.0 * one, half, radius_m * one, bottom_m * one, top_m * one, owner)


def wall_across(x: float, half_length: float = 1.0) -> UprightSolids:
    """Make a wall, 0.4 m thick, across the x axis."""
    return solids_at((x, 0.0), half_m=(0.2, half_length))


def on_the_ground(wall: Faces) -> Faces:
    """Return the faces of the ground and a wall."""
    return Faces(*(np.concatenate(cast("Any", pair)) for pair in zip(ground_face(), wall, strict=True)))


def lossy(loss_db: float, flat_share: float = 0.0) -> Material:
    """Make a material that reflects a fixed share of every wave and transmits the rest with a loss."""
    return Material.of_loss(1.0, 1e12, loss_db, flat_share)


def around(
    loss_db: float, faces: Faces | None = None, solids: UprightSolids | None = None, **share: float
) -> Surroundings:
    """Make one piece of equipment with a loss, and faces; `wall` and `ground` are their reflected shares."""
    ground = lossy(0.0, share.get("ground", 0.0))
    pieces = [lossy(loss_db, share.get("wall", 0.0))]
    made = Surroundings.of_materials(pieces, faces or Faces.none(), solids or UprightSolids.none(), ground)
    made.obstacles["diffracts"] = False
    return made
