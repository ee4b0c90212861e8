"""Yards without end: equipment of the catalogue where chance puts it, and a discharge somewhere on it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdpatrol.envs.random_sources import ROOM_TO_TURN_M, random_source
from pdpatrol.envs.scenario.scenario import PLANNED, RouteConfig, Scenario, TaskConfig
from pdpatrol.envs.scenario.sources import SourceConfig
from pdpatrol.robot_models.equipment import CATALOGUE
from pdpatrol.robot_models.yard.pieces import CatalogueEquipment, Equipment
from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing import ArrayConfig

FloatArray = NDArray[np.float64]

SIZE_M = (32.0, 26.0)
DOCK_M = (2.5, 2.5)
N_WAYPOINTS = 4

ROOM_M = 2.0
"""Between two pieces of equipment, and round the dock: what a service car needs (assumed)."""

OPEN_ROUND_M = ((27.0, 4.0), (27.0, 22.0), (5.0, 22.0))
OPEN_TIME_LIMIT_S = 90.0
"""In the open yard (assumed): time enough to reach its far corner twice over, and too little for the whole round."""

TRIES = 60
"""Places that are tried for a piece before there is no room for it."""

DISCHARGING = tuple(kind for kind, entry in CATALOGUE.items() if entry.build(entry.length_m).sites)


def random_yard(
    seed: int | np.random.Generator, n_obstructions: int = 5, *, has_planned_route: bool = False
) -> Scenario:
    """A scenario with one discharge in a yard of `n_obstructions` pieces of equipment, all of the same size and route.

    The first piece is one that can discharge; without any, the source hangs in the open. The source sits on a site of
    the catalogue, or in one of five yards at a place on or near equipment that is none. Waypoints lie where the robot
    fits; whether there is a way to each is not promised, as in a real yard: a mission reports what it could not reach.

    Args:
        seed: The same seed gives the same yard.
        n_obstructions: Pieces of equipment asked for, in [0, 12]; where no room is left, there are fewer.
        has_planned_route: Whether the route is the planned one instead, for missions; the environment alone does not
            plan and refuses it.

    Returns:
        The scenario.

    Raises:
        ValueError: If `n_obstructions` is out of range.
    """
    if not 0 <= n_obstructions <= 12:
        raise ValueError(f"`n_obstructions` must be in [0, 12], got {n_obstructions}")
    rng = np.random.default_rng(seed)
    kinds = list(CATALOGUE)
    yard = Yard(size_m=SIZE_M)
    for number in range(n_obstructions):
        kind = str(rng.choice(DISCHARGING if number == 0 else kinds))
        yard = _with_one_more(yard, f"{kind}_{number + 1}", kind, rng)
    stops_m = [yard.free_place(rng, ROOM_TO_TURN_M) for _ in range(N_WAYPOINTS)]
    drawn_m = tuple((float(x), float(y)) for x, y in stops_m)
    return Scenario(
        name="random_yard",
        yard=yard,
        route=RouteConfig(dock_m=DOCK_M, waypoints_m=PLANNED if has_planned_route else drawn_m),
        array=ArrayConfig(),
        sources=(random_source(yard, rng),),
        task=TaskConfig(time_limit_s=300.0),
    )


def open_yard() -> Scenario:
    """A yard with nothing in it but a discharge in mid-air: the first thing for a learner.

    Each episode draws the place of the discharge, 1.5 m above the ground, its amplitude, the robot's heading at the
    dock in the south-west corner and the errors of its array: another seed of `reset` is another yard. The round is
    84 m long and the robot drives 72 m in the time limit, so an episode that terminates has reached the source.
    """
    return Scenario(
        name="open_yard",
        yard=Yard(size_m=SIZE_M),
        route=RouteConfig(dock_m=DOCK_M, waypoints_m=OPEN_ROUND_M),
        array=ArrayConfig(),
        sources=(SourceConfig(name="discharge", anywhere_at_m=1.5),),
        task=TaskConfig(time_limit_s=OPEN_TIME_LIMIT_S),
    )


def _with_one_more(yard: Yard, name: str, kind: str, rng: np.random.Generator) -> Yard:
    """The yard with a piece where there is room, or as it was where there is none."""
    for _ in range(TRIES):
        position = rng.uniform([0.0, 0.0], yard.size_m)
        item = CatalogueEquipment(
            name=name,
            kind=kind,
            position_m=(float(position[0]), float(position[1])),
            yaw_deg=float(rng.choice([0.0, 90.0, 180.0, 270.0])),
        )
        low, high = _bounds(item)
        taken = [_bounds(other) for other in yard.equipment] + [(np.array(DOCK_M), np.array(DOCK_M))]
        apart = [np.maximum(low - other_high, other_low - high).max() for other_low, other_high in taken]
        if min(*low, *(yard.size_m - high), *apart) >= ROOM_M:
            return Yard(size_m=yard.size_m, equipment=(*yard.equipment, item))
    return yard


def _bounds(item: Equipment) -> tuple[FloatArray, FloatArray]:
    """South-west and north-east corner of what a piece covers, each (2,), for a yaw of whole quarter turns."""
    solids = item.solids
    turned = np.abs(np.sin(solids.yaw_rad)) > 0.5
    half_m = np.where(turned[:, np.newaxis], solids.half_size_m[:, ::-1], solids.half_size_m)
    half_m = half_m + solids.radius_m[:, np.newaxis]
    return (solids.centre_m - half_m).min(axis=0), (solids.centre_m + half_m).max(axis=0)
