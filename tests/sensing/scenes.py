"""Scenes of a wall, a piece of equipment and the ground, with stated losses and reflections."""

import numpy as np
from numpy.typing import ArrayLike

from dirmusic.arrays import FloatArray
from pdpatrol.sensing import Surroundings, upright_solids
from pdpatrol.sensing.radio.materials import METAL, Material
from pdpatrol.sensing.radio.ray_paths import RayPaths
from pdpatrol.sensing.radio.surroundings import Rows, flat_face, made_of

NO_SOLID = -2


def wall_face(
    centre_m: ArrayLike, normal: tuple[float, float], half_m: tuple[float, float], material: Material = METAL
) -> Rows:
    """Make one upright face without a solid behind it; `half_m` is half its length and half its height."""
    x, y = normal
    face = flat_face(centre_m, (x, y, 0.0), ((-y, x, 0.0), (0.0, 0.0, 1.0)), half_m, NO_SOLID)
    return made_of(face, [material._replace(transmission=1.0)])


def solids_at(
    *centres: tuple[float, float],
    half_m: tuple[float, float] = (0.0, 0.0),
    radius_m: float = 0.0,
    bottom_m: float = 0.0,
    top_m: float = 3.0,
    yaw_rad: float = 0.0,
) -> Rows:
    """Make equal solids at horizontal centres, each a piece of equipment."""
    one = np.ones(len(centres))
    half, owner = np.tile(half_m, (one.size, 1)), np.arange(one.size)
    return upright_solids(
        centre_m=np.array(centres),
        yaw_rad=yaw_rad * one,
        half_size_m=half,
        radius_m=radius_m * one,
        bottom_m=bottom_m * one,
        top_m=top_m * one,
        owner=owner,
    )


def wall_across(x: float, half_length: float = 1.0) -> Rows:
    """Make a wall, 0.4 m thick, across the x axis."""
    return solids_at((x, 0.0), half_m=(0.2, half_length))


def lossy(loss_db: float, flat_share: float = 0.0) -> Material:
    """Make a material that reflects a fixed fraction of every wave and transmits the rest with a loss."""
    return Material.of_loss(1.0, 1e12, loss_db, flat_share)


def around(loss_db: float, solids: Rows, face: Rows) -> Surroundings:
    """Make solids with a loss, whose edges do not diffract, and a face."""
    obstacles = made_of(solids, [lossy(loss_db)] * solids.size)
    obstacles["diffracts"] = False
    return Surroundings(face, obstacles=obstacles)


def origins_m(paths: RayPaths) -> FloatArray:
    """Return the points that paths seem to come from, shape (n_paths, 3)."""
    return np.column_stack([paths.rows[axis] for axis in "xyz"])
