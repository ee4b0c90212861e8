"""Random yards with catalogue equipment and one discharge."""

import numpy as np

from dirmusic.angles import aperture
from dirmusic.arrays import FloatArray
from dirmusic.locating.rules import LocatingRules
from pdpatrol.envs.scenario.base import as_tuples
from pdpatrol.envs.scenario.radio import surroundings_of
from pdpatrol.envs.scenario.scenario import RouteConfig, Scenario, TaskConfig
from pdpatrol.envs.scenario.sources import SourceConfig
from pdpatrol.robot_models.equipment.catalogue import assemble
from pdpatrol.robot_models.yard.pieces import SITE_STANDOFF_M, CatalogueEquipment
from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing import ArrayConfig
from pdpatrol.sensing.radio.surroundings import level_transform
from pdpatrol.sensing.radio.transmission import MIN_TRANSMISSION, Sight

SIZE_M = (32.0, 26.0)
DOCK_M = (2.5, 2.5)
N_WAYPOINTS = 4

KINDS = (
    "busbar",
    "circuit_breaker",
    "control_building",
    "current_transformer",
    "fence",
    "gis_bay",
    "kerb",
    "power_transformer",
    "voltage_transformer",
)
"""Kinds of equipment of these yards: those with a size for a compact yard."""

GAP_M = 2.0
"""Gap between pieces of equipment, and around the dock. Assumed; about the width of a service vehicle."""

TURNING_RADIUS_M = 0.55
"""Clearance of every stop. Assumed; more than the shipped robots need."""

OFF_SITE_SHARE = 0.2
"""Share of sources away from the sites of the catalogue, as in the suite, so that guessing among the sites is not
enough."""

OFF_SITE_M = 0.3
"""Smallest distance of such a source from every site. Assumed; several times the error of a good position estimate."""

AIR_M = (0.1, 0.6)
"""Range of distances from equipment for the half of these sources that are not on a surface. Assumed; typical of
conductors."""

SEEN_FROM_M = (2.0, 8.0)
"""Range of distances from which a source away from the sites must be in sight, over the aperture of a planned route."""


def random_yard(seed: int | np.random.Generator, n_obstructions: int = 5) -> Scenario:
    """Draw a scenario with one discharge in a yard with random equipment; the size and the dock are always the same.

    The first piece of equipment is of a kind that can discharge. In four of five yards the source is on a site of the
    catalogue; in the others it is on or near equipment, away from the sites. Without equipment it is on open ground.
    The robot fits at every waypoint, but may not be able to reach it: a mission reports the waypoints that it could
    not reach.

    Args:
        seed: Seed or generator.
        n_obstructions: Number of pieces of equipment, in [0, 12]; fewer are placed if the yard is full.

    Raises:
        ValueError: If `n_obstructions` is out of range.
    """
    if not 0 <= n_obstructions <= 12:
        raise ValueError(f"`n_obstructions` must be in [0, 12], got {n_obstructions}")
    rng = np.random.default_rng(seed)
    with_sites = [kind for kind in KINDS if assemble(kind).sites]
    yard = Yard(size_m=SIZE_M)
    for number in range(n_obstructions):
        kind = str(rng.choice(with_sites if number == 0 else KINDS))
        yard = _with_piece(yard, f"{kind}_{number + 1}", kind, rng)
    stops_m = [yard.free_place(rng, TURNING_RADIUS_M).tolist() for _ in range(N_WAYPOINTS)]
    return Scenario(
        name="random_yard",
        yard=yard,
        route=RouteConfig(dock_m=DOCK_M, waypoints_m=as_tuples(stops_m)),
        array=ArrayConfig(),
        sources=(random_source(yard, rng),),
        task=TaskConfig(time_limit_s=300.0),
    )


def _with_piece(yard: Yard, name: str, kind: str, rng: np.random.Generator) -> Yard:
    """Return the yard with one more piece of equipment, or unchanged if it fits at none of 60 random positions."""
    for _ in range(60):
        item = CatalogueEquipment(
            name=name,
            kind=kind,
            position_m=as_tuples(rng.uniform([0.0, 0.0], yard.size_m).tolist()),
            yaw_deg=float(rng.choice([0.0, 90.0, 180.0, 270.0])),
        )
        low, high = item.solids.extent_m
        taken = [*(other.solids.extent_m for other in yard.equipment), (np.array(DOCK_M), np.array(DOCK_M))]
        apart = [np.maximum(low - other_high, other_low - high).max() for other_low, other_high in taken]
        if min(*low, *(yard.size_m - high), *apart) >= GAP_M:
            return Yard(size_m=yard.size_m, equipment=(*yard.equipment, item))
    return yard


def random_source(yard: Yard, rng: np.random.Generator) -> SourceConfig:
    """Draw a discharge on a site, or off the sites in `OFF_SITE_SHARE` of cases; without sites, on open ground."""
    sites = yard.site_names()
    if not sites:
        return SourceConfig(name="discharge", position_m=(*yard.free_place(rng, TURNING_RADIUS_M).tolist(), 1.5))
    site = str(rng.choice(sites))
    place_m = place_off_sites(yard, rng) if rng.uniform() < OFF_SITE_SHARE else None
    if place_m is None:
        return SourceConfig(name="discharge", sites=(site,))
    return SourceConfig(name="discharge", position_m=as_tuples(place_m.tolist()))


def place_off_sites(yard: Yard, rng: np.random.Generator) -> FloatArray | None:
    """Draw a place in sight of free ground, on or near equipment with discharge sites, but away from the sites.

    Args:
        yard: Yard with discharge sites.
        rng: Random generator.

    Returns:
        Position, shape (3,), world frame; None if none of 200 random places is suitable.
    """
    sites_m = np.array([yard.site_position(name) for name in yard.site_names()])
    discharging = [k for k, item in enumerate(yard.equipment) if item.assembly.sites]
    parts = np.flatnonzero(np.isin(yard.owner, discharging))
    sight, solids = Sight(surroundings_of(yard)), yard.solids
    for _ in range(200):
        part = int(rng.choice(parts))
        off_m = SITE_STANDOFF_M if rng.uniform() < 0.5 else float(rng.uniform(*AIR_M))
        bottom_m, top_m = solids.bottom_m[part], solids.top_m[part]
        half_m = np.append(solids.half_size_m[part] + solids.radius_m[part], 0.5 * (top_m - bottom_m))
        x, y, z = rng.uniform(-half_m, half_m)
        world_from_part = level_transform(np.append(solids.centre_m[part], solids.yaw_rad[part]))
        inside_m = world_from_part @ (x, y, z + 0.5 * (top_m + bottom_m), 1.0)
        place_m = pushed_out(yard, inside_m[:3], off_m)
        if (
            yard.contains(place_m)
            and place_m[2] >= 0.2
            and abs(_distance(yard, place_m) - off_m) < 0.5 * SITE_STANDOFF_M
            and np.linalg.norm(sites_m - place_m, axis=-1).min() >= OFF_SITE_M
            and _can_be_seen(yard, sight, place_m)
        ):
            return np.round(place_m, 3)
    return None


def _distance(yard: Yard, place_m: FloatArray) -> float:
    """Return the distance from a place (3,) to the nearest surface, negative inside equipment."""
    return float(yard.solids.distance(place_m).min())


def pushed_out(yard: Yard, place_m: FloatArray, off_m: float) -> FloatArray:
    """Move a place (3,) along the gradient of the distance to equipment until the distance is `off_m`."""
    step = 1e-4 * np.eye(3)
    for _ in range(4):
        slope = np.array([_distance(yard, place_m + d) - _distance(yard, place_m - d) for d in step]) / 2e-4
        place_m = place_m + (off_m - _distance(yard, place_m)) * slope / max(float(slope @ slope), 1e-3)
    return place_m


def _can_be_seen(yard: Yard, sight: Sight, place_m: FloatArray) -> bool:
    """Return whether a place is in sight of free ground nearby, over the aperture of a planned route."""
    ahead = np.arange(-SEEN_FROM_M[1], SEEN_FROM_M[1] + 0.5, 0.5)
    off_m = np.stack(np.meshgrid(ahead, ahead), axis=-1).reshape(-1, 2)
    range_m = np.linalg.norm(off_m, axis=-1)
    ground_m = place_m[:2] + off_m[(range_m >= SEEN_FROM_M[0]) & (range_m <= SEEN_FROM_M[1])]
    ground_m = ground_m[yard.clearance(ground_m) >= TURNING_RADIUS_M]
    share = sight(np.column_stack([ground_m, np.full(len(ground_m), ArrayConfig().height_m)]), place_m)
    seen_m = ground_m[share >= MIN_TRANSMISSION] - place_m[:2]
    return aperture(np.arctan2(seen_m[:, 1], seen_m[:, 0])) >= LocatingRules().planned_aperture_rad
