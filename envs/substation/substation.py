"""Layout of a whole substation: bays, roads, control building, fire walls, fence, dock and patrol route."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dirmusic.arrays import FloatArray
from pdpatrol.envs.substation.drawing import ROAD_M, VERGE_M, Bay, Drawing, make_piece
from pdpatrol.envs.substation.schemes import LEAST_BAYS, MOST_BAYS, SCHEMES, Scheme
from pdpatrol.robot_models.equipment.voltages import VOLTAGES, Kv
from pdpatrol.robot_models.yard.clearances import OIL_FILLED
from pdpatrol.robot_models.yard.pieces import CatalogueEquipment
from pdpatrol.robot_models.yard.yard import Yard

BUILDING_DEPTH_M, BUILDING_GAP_M = 8.0, 4.0
"""Depth of the building, and free ground between it and the equipment (assumed)."""

BUILDING_M = (8.0, 30.0)
"""Range of its length: a fifth of that of the yard (assumed)."""

GAP_RANGE_M = (0.4, 1.4)
"""Range of the excess of the free distance between rows over the phase clearance (assumed)."""

LEAST_GAP_M = 2.0
"""Least free distance between rows, for maintenance (assumed)."""

MOST_STEP_M = 20.0
"""Maximum distance between waypoints."""

Point = tuple[float, float]


@dataclass(frozen=True)
class SubstationParameters:
    """Parameters of a drawing.

    Attributes:
        kv: Nominal voltage.
        scheme: Scheme of the busbars.
        n_bays: Number of bays.
        seed: Seed of everything that is drawn.
    """

    kv: Kv = 110
    scheme: Scheme = "double_busbar"
    n_bays: int = 6
    seed: int = 0

    def errors(self) -> list[str]:
        """List the errors of the parameters."""
        least, most = LEAST_BAYS[self.scheme], MOST_BAYS[self.scheme]
        if least <= self.n_bays <= most:
            return []
        return [f"bays: must be from {least} to {most} for {self.scheme}, got {self.n_bays}"]


@dataclass(frozen=True)
class Substation:
    """Substation with its roads and the route on them, world frame.

    Attributes:
        parameters: Parameters of the drawing.
        size_m: Size of the yard.
        bays: Bays in order, and everything else as further groups.
        roads_m: Ends of the middles of the roads.
        dock_m: Dock, on the road by the building.
        waypoints_m: Patrol route on the roads.
    """

    parameters: SubstationParameters
    size_m: Point
    bays: tuple[Bay, ...]
    roads_m: tuple[tuple[Point, Point], ...]
    dock_m: Point
    waypoints_m: tuple[Point, ...]

    @property
    def yard(self) -> Yard:
        """Yard with the pieces of all bays."""
        return Yard(size_m=self.size_m, equipment=tuple(piece for bay in self.bays for piece in bay.pieces))

    @property
    def route_length_m(self) -> float:
        """Length of the route from the dock past all waypoints and back."""
        stops_m = np.array([self.dock_m, *self.waypoints_m, self.dock_m])
        return float(np.linalg.norm(np.diff(stops_m, axis=0), axis=1).sum())


def draw_substation(parameters: SubstationParameters) -> Substation:
    """Draw a substation.

    Raises:
        ValueError: If the parameters have errors, as `SubstationParameters.errors` lists them.
    """
    if errors := parameters.errors():
        raise ValueError("\n".join(errors))
    rng = np.random.default_rng(parameters.seed)
    level = VOLTAGES[parameters.kv]
    gap_m = round(max(level.to_phase_m + float(rng.uniform(*GAP_RANGE_M)), LEAST_GAP_M), 2)
    drawing = Drawing(parameters.kv, gap_m)
    SCHEMES[parameters.scheme](drawing, parameters.n_bays, rng)
    _add_fire_walls(drawing)
    low_m, high_m = drawing.extent()
    low_m[0] -= BUILDING_GAP_M + BUILDING_DEPTH_M
    building_y_m = _add_building(drawing, low_m, high_m, rng)
    border_m = 2.0 * VERGE_M + ROAD_M
    size_m = np.ceil(high_m - low_m + 2.0 * border_m)
    move_m = 0.5 * (size_m - low_m - high_m)
    ring_m = VERGE_M + 0.5 * ROAD_M
    west, south, east, north = ring_m, ring_m, float(size_m[0]) - ring_m, float(size_m[1]) - ring_m
    levels_m = [south, *sorted(round(y + float(move_m[1]), 3) for y in drawing.roads_y_m), north]
    dock_m = (west, round(building_y_m + float(move_m[1]), 3))
    return Substation(
        parameters=parameters,
        size_m=(float(size_m[0]), float(size_m[1])),
        bays=tuple(Bay(bay.title, [_moved(piece, move_m) for piece in bay.pieces]) for bay in drawing.bays),
        roads_m=(
            *(((west, y), (east, y)) for y in levels_m),
            ((west, south), (west, north)),
            ((east, south), (east, north)),
        ),
        dock_m=dock_m,
        waypoints_m=_waypoints(dock_m, west, east, levels_m),
    )


def _add_building(drawing: Drawing, low_m: FloatArray, high_m: FloatArray, rng: np.random.Generator) -> float:
    """Draw the building on the western side, where the roads leave most room; return the y of its middle."""
    off_m = VERGE_M + 0.5 * ROAD_M
    roads_m = [float(low_m[1]) - off_m, *sorted(drawing.roads_y_m), float(high_m[1]) + off_m]
    south_m, north_m = max(pairwise(roads_m), key=lambda pair: pair[1] - pair[0])
    room_m = north_m - south_m - 2.0 * off_m
    length_m = min(float(np.clip(round(0.2 * float(high_m[1] - low_m[1])), *BUILDING_M)), room_m)
    y = float(rng.uniform(south_m + off_m + 0.5 * length_m, north_m - off_m - 0.5 * length_m))
    drawing.add_bay("control building")
    drawing.place("building", "building", (float(low_m[0]) + 0.5 * BUILDING_DEPTH_M, y), 90.0, length_m)
    return y


def _moved(piece: CatalogueEquipment, move_m: FloatArray) -> CatalogueEquipment:
    x, y = (round(float(value), 2) for value in np.array(piece.position_m) + move_m)
    return CatalogueEquipment.model_validate({**piece.model_dump(), "position_m": (x, y)})


def _add_fire_walls(drawing: Drawing) -> None:
    """Draw a wall between oil-filled pieces next to each other that are nearer than the fire clearance."""
    oil = sorted((item for item in drawing.pieces if item.kind in OIL_FILLED), key=lambda item: item.position_m)
    walls = list[CatalogueEquipment]()
    for item, other in [(one, two) for k, one in enumerate(oil) for two in oil[k + 1 :]]:
        (low_m, high_m), (other_low_m, other_high_m) = item.solids.extent_m, other.solids.extent_m
        apart_m, along_m = other_low_m[0] - high_m[0], np.minimum(high_m, other_high_m) - np.maximum(low_m, other_low_m)
        if apart_m < drawing.level.fire_m and along_m[1] > 0.0:
            south_m, north_m = min(low_m[1], other_low_m[1]) - 1.0, max(high_m[1], other_high_m[1]) + 1.0
            place_m = (0.5 * float(high_m[0] + other_low_m[0]), 0.5 * float(south_m + north_m))
            name = f"fire_wall_{len(walls) + 1}"
            walls.append(make_piece(drawing.kv, name, "fire_wall", place_m, 90.0, float(north_m - south_m)))
    if walls:
        drawing.bays.append(Bay("fire walls", walls))


def _waypoints(dock_m: Point, west: float, east: float, levels_m: list[float]) -> tuple[Point, ...]:
    """Draw a route along all roads, from the southern one to the northern one, and back to the dock."""
    corners_m: list[Point] = [dock_m]
    for number, y in enumerate(levels_m):
        corners_m += [(west, y), (east, y)] if number % 2 == 0 else [(east, y), (west, y)]
    stops_m: list[Point] = []
    for start_m, end_m in pairwise(corners_m):
        steps = max(1, int(np.ceil(np.hypot(end_m[0] - start_m[0], end_m[1] - start_m[1]) / MOST_STEP_M)))
        between_m = np.linspace(start_m, end_m, steps + 1)[1:].round(2)
        stops_m += [(float(x), float(y)) for x, y in between_m]
    return tuple(stops_m)
