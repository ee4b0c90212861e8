"""Scenario of a substation from its map."""

from pathlib import Path
from typing import Any

import numpy as np
import tomlkit

from dirmusic import InputFileError
from dirmusic.arrays import FloatArray
from pdpatrol.envs.scenario.base import on_one_line
from pdpatrol.missions.site_map_files.features import MapContent, read_features
from pdpatrol.missions.site_map_files.name_mapping import read_mapping
from pdpatrol.missions.site_map_files.site_frame import SiteFrame, site_frame, with_outline
from pdpatrol.missions.site_map_files.site_pieces import site_pieces
from pdpatrol.robot_models.yard.quantities import MOST_PIECES
from pdpatrol.robot_models.yard.yard import Yard

DRAWING = ".dxf"
"""Ending of the names of drawings."""

DOCK_ROOM_M = 1.2
"""Clearance of the dock (assumed); more than the shipped robots need."""


def import_site(path: Path, mapping: Path | None = None) -> tuple[str, Yard, list[str]]:
    """Make a scenario from a map.

    Args:
        path: GeoJSON file, or DXF file if its name ends in .dxf.
        mapping: Table of kinds by names of blocks and layers of a DXF file.

    Returns:
        Text of the scenario file, its yard, and notes on the features that were left out.

    Raises:
        InputFileError: If the file has errors, or no equipment is known in it.
    """
    content = _content(path, mapping)
    features = with_outline(content.features)
    frame = site_frame(path, features)
    fence = _fenced(frame)
    pieces, piece_notes = site_pieces(features, frame.reference, fence)
    notes = [on_one_line(note) for note in (*content.notes, *frame.notes, *piece_notes)]
    if not pieces:
        raise InputFileError([f"{path}: must contain equipment, got none that is known", *notes])
    if len(pieces) > MOST_PIECES:
        raise InputFileError([f"{path}: must have at most {MOST_PIECES} pieces of equipment, got {len(pieces)}"])
    yard = Yard(size_m=fence.size_m, fence_m=fence.fence_m, equipment=tuple(pieces))
    rows = [_row(piece.model_dump(mode="json", exclude_none=True)) for piece in pieces]
    lines = [
        f"# Made by pdpatrol import from {on_one_line(path.name)}, {len(pieces)} pieces",
        *([] if not notes else ["#", "# Notes:", *(f"# - {note}" for note in notes)]),
        "",
        "[yard]",
        f"size_m = {list(yard.size_m)}" if yard.fence_m is None else f"fence_m = {list(map(list, yard.fence_m))}",
        "equipment = [",
        *(f"  {row}," for row in rows),
        "]",
        "",
        "[route]",
        f"dock_m = {_dock(path, yard).tolist()}",
        'waypoints_m = "planned"',
        "",
        "[array]",
        "",
        tomlkit.dumps({"georeference": frame.reference.model_dump()} if content.is_located else {}),
    ]
    return "\n".join(lines), yard, notes


def _fenced(frame: SiteFrame) -> Yard:
    """Return the yard without equipment; a rectangle is rounded to centimetres."""
    if frame.fence_m is not None:
        return Yard.model_validate({"fence_m": tuple(map(tuple, frame.fence_m.tolist()))})
    x_m, y_m = frame.size_m.round(2).tolist()
    return Yard(size_m=(x_m, y_m))


def _content(path: Path, mapping: Path | None) -> MapContent:
    """Read the features of a map, by the ending of its name."""
    if path.suffix.lower() == DRAWING:
        from pdpatrol.missions.site_map_files.drawing import read_drawing  # ezdxf is an extra

        return read_drawing(path, read_mapping(mapping))
    if mapping is not None:
        raise InputFileError([f"--mapping: is for {DRAWING} files, got {path}"])
    return read_features(path)


def _row(keys: dict[str, Any]) -> str:
    """Return a piece as an inline table."""
    if keys.get("shape") == "catalogue":
        del keys["shape"]
    if not keys.get("yaw_deg"):
        keys.pop("yaw_deg", None)
    if not keys.get("sites", True):
        del keys["sites"]
    table = tomlkit.inline_table()
    table.update(keys)
    return table.as_string()


def _dock(path: Path, yard: Yard) -> FloatArray:
    """Return the free place nearest to the south-western corner of a yard, shape (2,).

    Raises:
        InputFileError: If no place has the clearance of a dock.
    """
    places_m = np.stack(np.meshgrid(*(np.arange(0.5, size_m, 0.5) for size_m in yard.size_m)), axis=-1).reshape(-1, 2)
    free_m = places_m[yard.clearance(places_m) >= DOCK_ROOM_M]
    if not free_m.size:
        raise InputFileError(
            [f"{path}: the yard of {yard.size_m} m must have free ground for a dock, {DOCK_ROOM_M:g} m from all"]
        )
    return free_m[np.linalg.norm(free_m, axis=1).argmin()]
