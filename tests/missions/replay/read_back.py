"""Recordings read back as plain values."""

from pathlib import Path
from typing import Any

from rerun.chunk import RrdReader

from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.recording import write_recording

Entities = dict[str, dict[str, dict[int | None, Any]]]


def read_recording(path: Path, *, is_start: bool = False) -> Entities:
    """Return the values of each component of each entity by step; static values have the step None.

    The values at time zero, before the first step, are returned alone, with the step None, if `is_start` is true.
    """
    found: Entities = {}
    for chunk in RrdReader(path).stream().to_chunks():
        batch = chunk.to_record_batch()
        if is_start != ("sim_time" in batch.schema.names and "step" not in batch.schema.names):
            continue
        entity = found.setdefault(str(chunk.entity_path).lstrip("/"), {})
        for row in batch.to_pylist():
            for name, cell in row.items():
                if ":" in name and cell is not None and "rowid" not in name.lower():
                    entity.setdefault(name.rpartition(":")[2], {})[row.get("step")] = cell
    return found


def recorded(log: MissionLog, folder: Path) -> Entities:
    """Write the recording of a log and read it back."""
    write_recording(log, folder / "mission.rrd")
    return read_recording(folder / "mission.rrd")
