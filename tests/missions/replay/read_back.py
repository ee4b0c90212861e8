"""Recordings read back: what lies where, as plain values."""

from pathlib import Path
from typing import Any

from rerun.chunk import RrdReader

from pdpatrol.missions.recording import paths

Row = dict[str, Any]


def rows(path: Path) -> dict[str, int]:
    """Rows of every entity on a timeline or, for static data, in all."""
    counts: dict[str, int] = {}
    for chunk in RrdReader(path).stream().to_chunks():
        counts[str(chunk.entity_path)] = counts.get(str(chunk.entity_path), 0) + chunk.num_rows
    return counts


def values(path: Path) -> dict[str, list[Row]]:
    """Every row of every entity as plain values; what identifies rows and chunks left out."""
    found: dict[str, list[Row]] = {}
    for chunk in RrdReader(path).stream().to_chunks():
        entity = found.setdefault(str(chunk.entity_path), [])
        if chunk.entity_path == "/__properties":  # holds times of this machine
            continue
        for row in chunk.to_record_batch().to_pylist():
            entity.append({name: cell for name, cell in row.items() if "rowid" not in name.lower()})
    return found


def cells(rows_of_entity: list[Row], component: str) -> dict[int, list[Any]]:
    """One component by step."""
    key = next(name for row in rows_of_entity for name in row if name.endswith(f":{component}"))
    return {row[paths.STEP]: row[key] for row in rows_of_entity if row.get(paths.STEP) is not None and key in row}


def still(rows_of_entity: list[Row], component: str) -> list[Any]:
    """One component of what does not move."""
    (found,) = [row[key] for row in rows_of_entity for key in row if key.endswith(f":{component}")]
    return found
