"""Where chance puts a discharge: mostly on a site of the catalogue, now and then where nobody looks first."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dirmusic.angles import aperture
from dirmusic.locating.rules import AssignmentRules, LocatingRules
from pdpatrol.envs.scenario.radio import surroundings_of
from pdpatrol.envs.scenario.sources import SourceConfig
from pdpatrol.robot_models.yard.pieces import SITE_STANDOFF_M
from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing import ArrayConfig
from pdpatrol.sensing.radio.transmission import Sight

FloatArray = NDArray[np.float64]

ROOM_TO_TURN_M = 0.55
"""Round every stop (assumed): more than any of the shipped robots needs."""

OFF_SITE_SHARE = 0.2
"""Of the sources, as in the suite: knowing the catalogue is not knowing the answer."""

OFF_SITE_M = 0.3
"""How far from every site they are at least (assumed)."""

AIR_M = (0.1, 0.6)
"""How far from equipment they are if they are not on its surface, which is as probable (assumed)."""

LEAST_HEIGHT_M = 0.2
"""Above the ground (assumed)."""

SEEN_FROM_M = (2.0, 8.0)
LOOK_EVERY_M = 0.5
"""Ground from which such a source is to be in sight under the aperture of a plan, and how closely one looks: as
in the suite, each source can be seen. Opposite sides count as an aperture, though lines of sight through a gap do not
cross: a few sources can be seen and hardly be located."""

TRIES = 200
"""Places that are tried before the source is on a site after all (assumed)."""


def random_source(yard: Yard, rng: np.random.Generator) -> SourceConfig:
    """A discharge of a yard: on one of its sites, off them in `OFF_SITE_SHARE`, in the open where there is no site."""
    sites = yard.site_names()
    if not sites:
        return SourceConfig(name="discharge", position_m=(*yard.free_place(rng, ROOM_TO_TURN_M).tolist(), 1.5))
    site = str(rng.choice(sites))
    place_m = place_off_sites(yard, rng) if rng.uniform() < OFF_SITE_SHARE else None
    if place_m is None:
        return SourceConfig(name="discharge", sites=(site,))
    x, y, z = place_m.tolist()
    return SourceConfig(name="discharge", position_m=(x, y, z))


def place_off_sites(yard: Yard, rng: np.random.Generator) -> FloatArray | None:
    """A place on or near a piece of equipment that can discharge, at none of its sites, that can be seen.

    Args:
        yard: With equipment that can discharge.
        rng: What is drawn, and in which order, does not depend on where one looks from.

    Returns:
        Shape (3,), world frame; None if `TRIES` places are none.
    """
    sites_m = np.array([yard.site_position(name) for name in yard.site_names()])
    discharging = [k for k, item in enumerate(yard.equipment) if item.assembly.sites]
    parts = np.flatnonzero(np.isin(yard.owner, discharging))
    sight, solids = Sight(surroundings_of(yard)), yard.solids
    for _ in range(TRIES):
        part = int(rng.choice(parts))
        off_m = SITE_STANDOFF_M if rng.uniform() < 0.5 else float(rng.uniform(*AIR_M))
        half_m = np.append(solids.half_size_m[part], 0.5 * (solids.top_m[part] - solids.bottom_m[part]))
        half_m[:2] += solids.radius_m[part]
        centre_m = np.append(solids.centre_m[part], 0.5 * (solids.top_m[part] + solids.bottom_m[part]))
        place_m = _pushed_out(yard, centre_m + _turned(rng.uniform(-half_m, half_m), solids.yaw_rad[part]), off_m)
        is_place = yard.contains(place_m) and place_m[2] >= LEAST_HEIGHT_M
        is_place = is_place and abs(_distance(yard, place_m) - off_m) < 0.5 * SITE_STANDOFF_M
        is_place = is_place and np.linalg.norm(sites_m - place_m, axis=-1).min() >= OFF_SITE_M
        if is_place and _can_be_seen(yard, sight, place_m):
            return np.round(place_m, 3)
    return None


def _turned(point_m: FloatArray, yaw_rad: float) -> FloatArray:
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.array([cos * point_m[0] - sin * point_m[1], sin * point_m[0] + cos * point_m[1], point_m[2]])


def _distance(yard: Yard, place_m: FloatArray) -> float:
    """To the nearest surface, negative inside."""
    return float(yard.solids.distance(place_m).min())


def _pushed_out(yard: Yard, place_m: FloatArray, off_m: float) -> FloatArray:
    """A place (3,) moved along the slope of the distance to equipment until it is so far from it."""
    step = 1e-4 * np.eye(3)
    for _ in range(4):
        slope = np.array([_distance(yard, place_m + d) - _distance(yard, place_m - d) for d in step]) / 2e-4
        place_m = place_m + (off_m - _distance(yard, place_m)) * slope / max(float(slope @ slope), 1e-3)
    return place_m


def _can_be_seen(yard: Yard, sight: Sight, place_m: FloatArray) -> bool:
    """Whether it is in sight from free ground nearby under the aperture of a plan."""
    ahead = np.arange(-SEEN_FROM_M[1], SEEN_FROM_M[1] + LOOK_EVERY_M, LOOK_EVERY_M)
    off_m = np.stack(np.meshgrid(ahead, ahead), axis=-1).reshape(-1, 2)
    range_m = np.linalg.norm(off_m, axis=-1)
    ground_m = place_m[:2] + off_m[(range_m >= SEEN_FROM_M[0]) & (range_m <= SEEN_FROM_M[1])]
    ground_m = ground_m[yard.clearance(ground_m) >= ROOM_TO_TURN_M]
    share = sight(np.column_stack([ground_m, np.full(len(ground_m), ArrayConfig().height_m)]), place_m)
    seen_m = ground_m[share >= 10 ** (-AssignmentRules().sight_loss_db / 20)] - place_m[:2]
    return aperture(np.arctan2(seen_m[:, 1], seen_m[:, 0])) >= LocatingRules().planned_aperture_rad
