"""Scenes of a wall, a piece of equipment and the ground, with stated losses and reflections."""

from typing import Any, cast

import numpy as np

from pdpatrol.sensing import Faces, Surroundings, UprightSolids
from pdpatrol.sensing.radio.materials import Material


def ground_face() -> Faces:
    return Faces(np.zeros((1, 3)), np.eye(3)[2:], np.eye(3)[np.newaxis, :2], np.full((1, 2), np.inf), np.array([-1]))


def on_the_ground(wall: Faces) -> Faces:
    """Return the faces of the ground and a wall."""
    return Faces(*(np.concatenate(cast("Any", pair)) for pair in zip(ground_face(), wall, strict=True)))


def lossy(loss_db: float, flat_share: float = 0.0) -> Material:
    """Make a material that reflects a fixed share of every wave and transmits the rest with a loss."""
    return Material.of_loss(1.0, 1e12, loss_db, flat_share)


def wall_across(x: float, half_length: float = 1.0) -> UprightSolids:
    """Make a wall, 0.4 m thick, across the x axis."""
    one, none = np.ones(1), np.zeros(1)
    return UprightSolids(
        np.array([[x, 0.0]]), none, np.array([[0.2, half_length]]), none, none, 3 * one, np.zeros(1, np.intp)
    )


def around(
    loss_db: float, faces: Faces | None = None, solids: UprightSolids | None = None, **share: float
) -> Surroundings:
    """Make one piece of equipment with a loss, and faces; `wall` and `ground` are their reflected shares."""
    ground = lossy(0.0, share.get("ground", 0.0))
    pieces = [lossy(loss_db, share.get("wall", 0.0))]
    made = Surroundings.of_materials(pieces, faces or Faces.none(), solids or UprightSolids.none(), ground)
    made.obstacles["diffracts"] = False
    return made
