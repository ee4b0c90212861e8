"""Drawing of a substation: pieces placed in rows along a direction, with the clearances of a voltage level."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from dirmusic.arrays import FloatArray
from pdpatrol.robot_models.equipment.poles import APPARATUS
from pdpatrol.robot_models.equipment.voltages import VOLTAGES, Kv, VoltageLevel
from pdpatrol.robot_models.yard.pieces import CatalogueEquipment

ROAD_M = 4.0
"""Width of a road. Assumed; that of a lorry with a crane."""

VERGE_M = 1.0
"""Free strip on both sides of a road (assumed)."""

NORTH, SOUTH, EAST = 0.0, 180.0, 270.0
"""Yaws, degrees, at which the current of a piece flows in a direction."""

ONE_SIDED = ("gantry", "power_transformer", "shunt_reactor")
"""Kinds that are turned round on the southern side; all others look the same from both sides."""

PHASES = (-1.0, 0.0, 1.0)


class Bay(NamedTuple):
    """Pieces of a bay.

    Attributes:
        title: Designation and purpose, for a reader.
        pieces: Equipment.
    """

    title: str
    pieces: list[CatalogueEquipment]


@dataclass(frozen=True)
class Drawing:
    """Pieces and roads drawn so far, in a frame whose origin is of no importance.

    Attributes:
        kv: Voltage level.
        gap_m: Free distance between rows of equipment.
        bays: Bays in order.
        roads_y_m: Middles of the roads along x.
    """

    kv: Kv
    gap_m: float
    bays: list[Bay] = field(default_factory=list[Bay])
    roads_y_m: list[float] = field(default_factory=list[float])

    @property
    def level(self) -> VoltageLevel:
        """Clearances and spacings."""
        return VOLTAGES[self.kv]

    @property
    def pieces(self) -> list[CatalogueEquipment]:
        """All pieces, bay by bay."""
        return [piece for bay in self.bays for piece in bay.pieces]

    def add_bay(self, title: str) -> None:
        """Begin a bay, to which all pieces belong that are placed from now on."""
        self.bays.append(Bay(title, []))

    def place(
        self, name: str, kind: str, place_m: tuple[float, float], yaw_deg: float = 0.0, length_m: float | None = None
    ) -> CatalogueEquipment:
        """Place a piece in the latest bay."""
        piece = make_piece(self.kv, name, kind, place_m, yaw_deg, length_m)
        self.bays[-1].pieces.append(piece)
        return piece

    def extent(self) -> tuple[FloatArray, FloatArray]:
        """Return the south-west and north-east corners of all pieces, each of shape (2,)."""
        corners_m = np.array([piece.solids.extent_m for piece in self.pieces])
        return corners_m[:, 0].min(axis=0), corners_m[:, 1].max(axis=0)


def make_piece(
    kv: Kv,
    name: str,
    kind: str,
    place_m: tuple[float, float],
    yaw_deg: float = 0.0,
    length_m: float | None = None,
) -> CatalogueEquipment:
    """Make a piece of equipment, with a voltage if its size depends on it."""
    has_size = kind not in ("building", "cable_trench_cover")
    x, y = (round(float(value), 3) for value in place_m)
    return CatalogueEquipment(
        name=name,
        kind=kind,
        position_m=(x, y),
        yaw_deg=yaw_deg,
        length_m=None if length_m is None else round(length_m, 3),
        kv=kv if has_size else None,
    )


class Chain:
    """Rows of equipment along a direction, each as near to the one before as the gap allows.

    Args:
        drawing: Drawing in which the rows are placed.
        start_m: Place from which the first row keeps the gap, shape (2,).
        yaw_deg: Direction: `NORTH`, `SOUTH` or `EAST`.
    """

    def __init__(self, drawing: Drawing, start_m: tuple[float, float], yaw_deg: float) -> None:
        self.drawing, self._yaw_deg = drawing, yaw_deg
        yaw_rad = np.radians(yaw_deg)
        self._ahead = np.array([-np.sin(yaw_rad), np.cos(yaw_rad)]).round(9)
        self._across = np.abs(self._ahead[::-1])
        self._axis_m = np.array(start_m) * self._across
        self.edge_m = float(np.array(start_m) @ self._ahead)

    def row(self, name: str, kind: str, phases: tuple[int, ...] = (1, 2, 3)) -> None:
        """Place a row: one piece of three poles, or a single-phase piece for each of the phases."""
        yaw_deg = self._yaw_deg if kind in ONE_SIDED or self._yaw_deg == EAST else NORTH
        if kind in ("power_transformer", "shunt_reactor"):
            yaw_deg = (yaw_deg + 180.0) % 360.0  # its high-voltage bushings face the busbar
        before_m, behind_m = self._depth(kind, yaw_deg)
        middle_m = self.edge_m + self.drawing.gap_m + before_m
        self.edge_m = middle_m + behind_m
        if kind in APPARATUS and APPARATUS[kind].n_poles == 1:
            for phase in phases:
                off_m = PHASES[phase - 1] * self.drawing.level.spacing_m
                self.drawing.place(f"{name}_l{phase}", kind, self._at(middle_m, off_m), yaw_deg)
        else:
            self.drawing.place(name, kind, self._at(middle_m), yaw_deg)

    def crossing(self, name: str, kind: str) -> float:
        """Place the disconnector of a busbar that crosses the chain; return the position of its middle phase.

        The poles of a pantograph stand below their phases, those of another disconnector side by side.
        """
        level = self.drawing.level
        half_m = max(level.spacing_m + 0.5, self._depth(kind, NORTH)[1])
        middle_m = self.edge_m + self.drawing.gap_m + half_m
        self.edge_m = middle_m + half_m
        if kind == "disconnector_pantograph":
            for phase, share in enumerate(PHASES, start=1):
                off_m = share * level.spacing_m
                sign = float(self._ahead.sum())
                self.drawing.place(f"{name}_l{phase}", kind, self._at(middle_m + sign * off_m, off_m), NORTH)
        else:
            self.drawing.place(name, kind, self._at(middle_m), NORTH)
        return float(self._at(middle_m) @ np.abs(self._ahead))

    def road(self) -> None:
        """Leave room for a road across the chain."""
        middle_m = self.edge_m + VERGE_M + 0.5 * ROAD_M
        self.edge_m = middle_m + 0.5 * ROAD_M + VERGE_M - self.drawing.gap_m
        y = float(self._at(middle_m)[1])
        if not any(abs(y - other) < 0.01 for other in self.drawing.roads_y_m):
            self.drawing.roads_y_m.append(y)

    def skip(self, length_m: float) -> None:
        """Leave additional room before the next row."""
        self.edge_m += length_m

    def _depth(self, kind: str, yaw_deg: float) -> tuple[float, float]:
        """Return how far a piece extends before and behind its middle, along the direction."""
        low_m, high_m = make_piece(self.drawing.kv, "it", kind, (0.0, 0.0), yaw_deg).solids.extent_m
        before_m, behind_m = sorted((float(low_m @ self._ahead), float(high_m @ self._ahead)))
        return -before_m, behind_m

    def _at(self, along_m: float, across_m: float = 0.0) -> FloatArray:
        return self._axis_m + along_m * self._ahead + across_m * self._across
