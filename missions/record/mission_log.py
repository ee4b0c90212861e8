"""MissionLog: the record of a mission from which report, recording and plots are made.

It consists of flat tables with columns of equal length and `meta`, a JSON text. It does not need the simulator: field
data have the same tables, with NaN in the columns that only a simulator knows.
"""

from __future__ import annotations

import json
import shutil
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dirmusic import InputFileError
from pdpatrol.missions.atomic_file import atomic_file
from pdpatrol.missions.record.events import EventKind

SCHEMA = 8

TABLES: dict[str, dict[str, str]] = {
    "step": {
        "time_s": "f8",
        "pose": "3f8",  # estimated x m, y m, yaw rad, world frame, at the end of the step
        "true_pose": "3f8",  # NaN in field data
        "odometry": "3f8",  # wheels and gyro, from the first estimated pose on; NaN in field data
        "battery": "f8",  # remaining fraction; NaN in field data
        "command": "2f8",  # commanded speed m/s and yaw rate rad/s
        "phase": "U",  # `record.events.Phase`: what the policy was doing
        "phase_target": "i8",  # waypoint that it drove to, or finding that it viewed; 0 if neither
    },
    "pulse": {
        "step": "i8",
        "strengths_v": "(0,)f8",  # one value per element
        "std_v": "(0,)f4",  # standard deviation of each strength by noise
        "mains_phase_rad": "f8",
        "is_clipped": "?",  # exceeded the ADC's full scale; not used for locating
        "is_used": "?",  # used for locating: not clipped, and with a direction
    },
    "bearing": {
        "pulse": "i8",  # row in the pulse table
        "azimuth_rad": "f8",  # array frame
        "bearing_rad": "f8",  # world frame, with the estimated heading
        "std_rad": "f8",  # from noise only
        "total_std_rad": "f8",  # of `bearing_rad`: with array errors, elevation, multipath and the error of the heading
        "elevation_rad": "f8",  # 0 where a direction in the plane explains the pulse
    },
    "scan": {  # lidar; empty for field data
        "step": "i8",
        "localised_pose": "3f8",  # pose of the localisation, of which `step.pose` is corrected by the frame
        "range_m": "(0,)f4",  # one value per beam, first ahead, then counter-clockwise; see `meta`
    },
    "frame": {  # of the localisation against the map; see `dirmusic.frame.FrameEstimate`; empty for field data
        "step": "i8",
        "offset": "3f8",  # displacement x m, y m and rotation rad about the dock; zeros while poses are not corrected
        "covariance": "(3,3)f8",
        "pose_std": "2f8",  # standard deviations of position m and heading rad, with which findings are located
    },
    "finding": {
        "step": "i8",
        "id": "i8",
        "position_m": "3f8",
        "covariance_m2": "(3,3)f8",
        "state": "U",  # candidate, confirmed, outside; dropped once when it is removed
        "existence": "f8",  # probability that a source exists there
        "possibly_two": "?",  # two sources close to each other explain its pulses better than one
        "n_bearings": "i8",
        "first_detected_s": "f8",
        "confirmed_s": "f8",  # time of the first confirmation; NaN before
        "aperture_rad": "f8",  # angle between the outermost lines of sight, seen from the finding
        "level_db": "f8",  # median level of its pulses, dB relative to 1 V at 1 m; NaN until detected in sight
    },
    "likelihood": {  # likelihood over the yard by all used pulses so far
        "step": "i8",
        "log_likelihood": "(0,)f4",  # one value per cell of `log_contents.grid_of`
    },
    "association": {  # written at the end; empty for a killed mission
        "pulse": "i8",  # row in the pulse table
        "finding": "i8",  # id; 0 for none
    },
    "event": {
        "step": "i8",
        "kind": "U",  # `record.events.EventKind`
        "number": "i8",  # waypoint or channel, from 1, or id of the finding; 0 for other events
        "subject": "U",  # touched object, or reason for the end; empty for other events
        "text": "U",  # one sentence for people
    },
}
"""Every table, its columns and their types. Step i covers the time up to `step.time_s[i]`; other tables refer to a step
by its row.

Rows of shape (0,) have one value per element, beam or cell. Text columns have no width: NumPy chooses the width of the
longest text, so nothing is cut.
"""


class NumberColumn:
    """Column of numbers that grows; a list of NumPy rows would take several times as much memory.

    Args:
        dtype: Type of a row, with its shape.
    """

    GROWTH, MOST_NEW = 1.25, 1000
    """Factor by which the memory grows, and number of new rows that are kept in a list at most (assumed)."""

    def __init__(self, dtype: str) -> None:
        self._type = np.dtype(dtype).base
        self._values = np.empty(0, self._type)
        self._size = 0
        self._new: list[Any] = []

    def __len__(self) -> int:
        return self._size + len(self._new)

    def __getitem__(self, rows: Any) -> NDArray[Any]:  # noqa: ANN401 - an integer or a slice
        self._take_new()
        return self._values[: self._size][rows]

    def extend(self, values: Sequence[Any] | NDArray[Any]) -> None:
        """Append rows, which all have one shape."""
        self._new.extend(values)
        if len(self._new) >= self.MOST_NEW:
            self._take_new()

    def _take_new(self) -> None:
        """Move the new rows into the array."""
        if not self._new:
            return
        rows, start = np.array(self._new, dtype=self._type), self._size
        self._new, self._size = [], start + len(rows)
        if self._size > len(self._values):
            values = np.empty((max(self._size, int(self.GROWTH * start)), *rows.shape[1:]), self._type)
            values[:start] = self._values[:start] if start else rows[:0]
            self._values = values
        self._values[start : self._size] = rows


class MissionLog:
    """Tables that grow row by row, and metadata.

    Args:
        meta: JSON-serialisable metadata: seed, policy, scenario as read, solids, nominal array, and `truth` for
            simulated data; at the end `calibration` and `array_estimate` if the array was estimated.
    """

    def __init__(self, meta: Mapping[str, Any]) -> None:
        self.meta: dict[str, Any] = {"schema": SCHEMA, **meta}
        self._rows: dict[str, dict[str, list[Any] | NumberColumn]] = {
            table: {column: [] if dtype == "U" else NumberColumn(dtype) for column, dtype in columns.items()}
            for table, columns in TABLES.items()
        }
        self._written: dict[str, int] = {}

    @property
    def last_step(self) -> int:
        """Row of the last step; 0 before the first."""
        return max(self.n_rows("step") - 1, 0)

    def append(self, table: str, **row: Any) -> None:  # noqa: ANN401 - a row's values are of many types
        """Add one row, with all columns of the table."""
        self.extend(table, **{column: [value] for column, value in row.items()})

    def extend(self, table: str, **columns: Sequence[Any] | NDArray[Any]) -> None:
        """Add rows, given by all columns of the table.

        Raises:
            ValueError: If the table has other columns, or the columns have different lengths.
        """
        rows = self._rows[table]
        if columns.keys() != rows.keys():
            raise ValueError(f"a row of `{table}` has the columns {', '.join(rows)}; got {', '.join(columns)}")
        if len({len(values) for values in columns.values()}) != 1:
            raise ValueError(f"the columns of table {table} have different lengths")
        for column, values in columns.items():
            rows[column].extend(values)

    def replace(self, table: str, **columns: Sequence[Any] | NDArray[Any]) -> None:
        """Replace all values of some columns of a table; each must have a value for every row."""
        for column, values in columns.items():
            if len(values) != self.n_rows(table):
                raise ValueError(f"table {table} has {self.n_rows(table)} rows, got {len(values)} values of {column}")
            self._rows[table][column] = list(values)

    def event(self, kind: EventKind, text: str, number: int = 0, subject: str = "") -> None:
        """Add something that happened in the last step.

        Args:
            kind: Kind of the event.
            text: One sentence for people, which can be understood without the other arguments.
            number: Number of the waypoint or channel, from 1, or id of the finding; 0 for other events.
            subject: Name of the touched object, or the reason for the end of the mission; empty for other events.
        """
        self.append("event", step=self.last_step, kind=kind, number=number, subject=subject, text=text)

    def n_rows(self, table: str) -> int:
        """Return the number of rows in a table."""
        return len(next(iter(self._rows[table].values())))

    def rows_before(self, table: str, step: int) -> int:
        """Return the number of rows of a table that belong to steps before `step`."""
        if table == "step":
            return min(step, self.n_rows("step"))
        if table == "bearing":
            return bisect_left(self._rows["bearing"]["pulse"], self.rows_before("pulse", step))
        return bisect_left(self._rows[table]["step"], step)

    def column(self, table: str, column: str, start: int = 0, stop: int | None = None) -> NDArray[Any]:
        """Return the rows from `start` up to `stop` of one column as an array, rows on the first axis."""
        dtype = np.dtype(TABLES[table][column])
        shape = (self.meta["n_elements"],) if column in ("strengths_v", "std_v") else dtype.shape
        rows = self._rows[table][column][start:stop]
        return np.array(rows if len(rows) else np.empty((0, *shape)), dtype=dtype.base)

    def table(self, table: str, start: int = 0, stop: int | None = None) -> dict[str, NDArray[Any]]:
        """Return the rows from `start` up to `stop` of all columns of a table."""
        return {column: self.column(table, column, start, stop) for column in TABLES[table]}

    def _write(self, path: Path, start: Mapping[str, int]) -> None:
        """Write the rows from `start` on, by table; from 0 for tables that it does not contain."""
        arrays = {
            f"{table}.{name}": column
            for table in TABLES
            for name, column in self.table(table, start.get(table, 0)).items()
        }
        with atomic_file(path) as temporary, temporary.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, meta=np.array(json.dumps(self.meta)), **arrays)

    def write_part(self, folder: Path) -> None:
        """Write the rows since the last part, so that a killed mission keeps them."""
        parts = folder / "log.parts"
        parts.mkdir(exist_ok=True)
        self._write(parts / f"part-{self.n_rows('step'):08d}.npz", self._written)
        self._written = {table: self.n_rows(table) for table in TABLES}

    def save(self, folder: Path) -> None:
        """Write `log.npz` and remove the parts."""
        self._write(folder / "log.npz", {})
        shutil.rmtree(folder / "log.parts", ignore_errors=True)

    @classmethod
    def load(cls, folder: Path) -> MissionLog:
        """Read `log.npz` in a mission's folder, or the parts of a killed mission.

        Raises:
            InputFileError: If the folder contains neither, or a file is damaged, is not a log, or has another schema.
        """
        files = [folder / "log.npz"]
        if not files[0].exists():
            files = sorted((folder / "log.parts").glob("part-*.npz"))
        if not files:
            raise InputFileError([f"{folder}: holds no log.npz and no log.parts; give the folder of a mission"])
        log: MissionLog | None = None
        for file in files:
            try:
                with file.open("rb") as opened, np.load(opened, allow_pickle=False) as archive:
                    n_bytes = sum(member.file_size for member in archive.zip.infolist())
                    if n_bytes > 4e9:  # assumed; ten million pulses fit
                        raise ValueError(f"{n_bytes / 1e9:.1f} GB after decompression, the limit is 4 GB")
                    meta = json.loads(str(archive["meta"]))
                    if meta.get("schema") != SCHEMA:
                        raise ValueError(f"no metadata of schema {SCHEMA}, which this version reads")
                    log = log or cls(meta)
                    log._add(archive)
            except Exception as error:  # damaged archives and array headers raise many types
                reason = " ".join(str(error).split())
                text = f"is not the log of a mission ({reason:.200}); give a folder that `pdpatrol run` wrote"
                raise InputFileError([f"{file}: {text}"]) from None
        assert log is not None
        return log

    def _add(self, archive: Mapping[str, NDArray[Any]]) -> None:
        """Add the rows of a file.

        Raises:
            Exception: If the file does not have all tables, with the right types and references to existing rows.
        """
        for table, columns in TABLES.items():
            arrays = {column: archive[f"{table}.{column}"] for column in columns}
            for column, values in arrays.items():
                dtype = np.dtype(columns[column])
                is_right = values.ndim == 2 if dtype.shape == (0,) else values.shape[1:] == dtype.shape
                if values.dtype.kind != dtype.base.kind or (len(values) and not is_right):
                    raise ValueError(f"{table}.{column} holds {values.dtype} in rows of shape {values.shape[1:]}")
            self.extend(table, **arrays)
        for table in TABLES.keys() - {"event"}:  # rows before the first step refer to step 0
            for other in TABLES.keys() & TABLES[table].keys() - {"finding"}:  # `association.finding` is an id
                rows = self.column(table, other)
                if not np.all((rows >= 0) & (rows < self.n_rows(other))):
                    raise ValueError(f"{table}.{other}: refers to missing rows of table {other}")
