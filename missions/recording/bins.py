"""Bins of a log, each drawn at once, and the shapes that several views share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import rerun as rr
from numpy.typing import ArrayLike, NDArray

from dirmusic.arrays import IntArray
from pdpatrol.missions.record.mission_log import MissionLog


@dataclass(frozen=True)
class LogBin:
    """Rows of a log that belong to a few consecutive steps; a bin may contain events without steps.

    Attributes:
        log: Log of the mission.
        first: Number of the first row, by the name of the table.
        tables: Rows of the bin, by the name of the table.
    """

    log: MissionLog
    first: Mapping[str, int]
    tables: Mapping[str, dict[str, NDArray[Any]]]

    @property
    def end(self) -> int:
        """Row after the last step."""
        return self.first["step"] + self.tables["step"]["time_s"].size


def set_step(stream: rr.RecordingStream, log: MissionLog, step: int) -> None:
    """Set the time for the following calls of `stream.log` to a step of a mission; zero before the first step."""
    stream.set_time("sim_time", duration=log.column("step", "time_s", step, step + 1).sum())  # of one value or none
    stream.set_time("step", sequence=step)


def at_steps(log: MissionLog, steps: IntArray) -> list[rr.TimeColumn]:
    """Return the times of steps (n,) for `stream.send_columns`."""
    time_s = log.column("step", "time_s")[steps]
    return [rr.TimeColumn("sim_time", duration=time_s), rr.TimeColumn("step", sequence=steps)]


def labels_3d(places: Mapping[str, ArrayLike], radius_m: float = 0.01, colour: int = 0xFFFFFFFF) -> rr.Points3D:
    """Return labelled points at places x, y, z."""
    return rr.Points3D(list(places.values()), labels=list(places), colors=colour, radii=radius_m, show_labels=True)


def lines_3d(lines: Any, colour: int, width: float = 0.8) -> rr.LineStrips3D:  # noqa: ANN401 - nested sequences
    """Return lines whose width is in points of the screen."""
    return rr.LineStrips3D(lines, colors=colour, radii=rr.Radius.ui_points(width))
