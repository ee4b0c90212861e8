"""MissionLog: the record of a mission from which report, recording and plots are made.

It consists of flat tables with columns of equal length and `meta`, a JSON text. It does not need the simulator: field
data have the same tables, with NaN in the columns that only a simulator knows.
"""

from __future__ import annotations

import json
import shutil
from bisect import bisect_left
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdpatrol.missions.atomic_file import atomic_file
from pdpatrol.missions.record.events import EventKind

SCHEMA = 5

_COLUMNS: dict[str, dict[str, str]] = {
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
        "strengths_v": "f8",  # one value per element: (n, n_elements)
        "mains_phase_rad": "f8",
        "is_clipped": "?",  # exceeded the ADC's full scale; not used for locating
        "is_credible": "?",  # consistent with a single plane wave
    },
    "bearing": {
        "pulse": "i8",  # row in the pulse table
        "azimuth_rad": "f8",  # array frame
        "bearing_rad": "f8",  # world frame, with the estimated heading
        "std_rad": "f8",  # from noise only, without the error of the manifold
    },
    "scan": {  # lidar; empty for field data
        "step": "i8",
        "range_m": "f4",  # one value per beam: (n, n_beams), first ahead, then counter-clockwise; see `meta`
    },
    "finding": {
        "step": "i8",
        "id": "i8",
        "position_m": "3f8",
        "covariance_m2": "(3,3)f8",
        "state": "U",  # candidate, confirmed, outside, ghost; dropped once when it is removed
        "n_bearings": "i8",
        "first_detected_s": "f8",
        "confirmed_s": "f8",  # time of the first confirmation; NaN before
        "aperture_rad": "f8",  # angle between the outermost lines of sight, seen from the finding
    },
    "likelihood": {  # likelihood over the yard by all credible pulses so far
        "step": "i8",
        "log_likelihood": "f4",  # one value per cell of `log_contents.grid_of`: (n, n_cells)
    },
    "association": {  # written at the end; empty for a killed mission
        "pulse": "i8",  # row in the pulse table
        "finding": "i8",  # id, or a code of `dirmusic.locating.association.Unassociated`
    },
    "event": {
        "step": "i8",
        "kind": "U",  # `record.events.EventKind`
        "number": "i8",  # waypoint, from 1, or id of the finding; 0 for other events
        "subject": "U",  # touched object, or reason for the end; empty for other events
        "text": "U",  # one sentence for people
    },
}

TABLES = {table: {column: np.dtype(spec) for column, spec in columns.items()} for table, columns in _COLUMNS.items()}
"""Every table and its columns. Step i covers the time up to `step.time_s[i]`; other tables refer to a step by its row.

Text columns have no width: NumPy chooses the width of the longest text, so nothing is cut.
"""


class MissionLog:
    """Tables that grow row by row, and metadata.

    Args:
        meta: JSON-serialisable metadata: seed, policy, scenario as read, solids, nominal array, and `truth` for
            simulated data; at the end `calibration` if the array's errors were estimated.
    """

    def __init__(self, meta: Mapping[str, Any]) -> None:
        self.meta: dict[str, Any] = {"schema": SCHEMA, **meta}
        self._rows: dict[str, dict[str, list[Any]]] = {
            table: {column: [] for column in columns} for table, columns in TABLES.items()
        }
        self._written: dict[str, int] = dict.fromkeys(TABLES, 0)

    @property
    def last_step(self) -> int:
        """Row of the last step; 0 before the first."""
        return max(self.n_rows("step") - 1, 0)

    def append(self, table: str, **row: Any) -> int:  # noqa: ANN401 - a row's values are of many types
        """Add one row, with all columns of the table, and return its number."""
        columns = self._rows[table]
        if row.keys() != columns.keys():
            raise ValueError(f"a row of `{table}` has the columns {', '.join(columns)}; got {', '.join(row)}")
        for column, value in row.items():
            columns[column].append(value)
        return self.n_rows(table) - 1

    def event(self, kind: EventKind, text: str, number: int = 0, subject: str = "") -> None:
        """Add something that happened in the last step.

        Args:
            kind: Kind of the event.
            text: One sentence for people, which can be understood without the other arguments.
            number: Number of the waypoint, from 1, or id of the finding; 0 for other events.
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
        dtype = TABLES[table][column]
        values = self._rows[table][column][start:stop]
        if not values:
            shape = (self.meta.get("n_elements", 0),) if column == "strengths_v" else dtype.shape
            return np.empty((0, *shape), dtype=dtype.base)
        return np.array(values, dtype=dtype.base)

    def table(self, table: str, start: int = 0, stop: int | None = None) -> dict[str, NDArray[Any]]:
        """Return the rows from `start` up to `stop` of all columns of a table."""
        return {column: self.column(table, column, start, stop) for column in TABLES[table]}

    def _write(self, path: Path, start: Mapping[str, int]) -> None:
        """Write the rows from `start` on, by table."""
        arrays = {
            f"{table}.{name}": column for table in TABLES for name, column in self.table(table, start[table]).items()
        }
        with atomic_file(path) as temporary, temporary.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, meta=np.array(json.dumps(self.meta)), **arrays)

    def write_part(self, folder: Path) -> None:
        """Write the rows since the last part, so that a killed mission keeps them."""
        parts = folder / "log.parts"
        parts.mkdir(exist_ok=True)
        self._write(parts / f"part-{len(list(parts.glob('part-*.npz'))):05d}.npz", self._written)
        self._written = {table: self.n_rows(table) for table in TABLES}

    def save(self, folder: Path) -> None:
        """Write `log.npz` and remove the parts."""
        self._write(folder / "log.npz", dict.fromkeys(TABLES, 0))
        shutil.rmtree(folder / "log.parts", ignore_errors=True)

    @classmethod
    def load(cls, folder: Path) -> MissionLog:
        """Read `log.npz` in a mission's folder, or the parts of a killed mission.

        Raises:
            FileNotFoundError: If the folder contains neither.
            ValueError: If a file is damaged, is not a log, or has another schema.
        """
        files = [folder / "log.npz"]
        if not files[0].exists():
            files = sorted((folder / "log.parts").glob("part-*.npz"))
        if not files:
            raise FileNotFoundError(f"{folder}: holds no log.npz and no log.parts; give the folder of a mission")
        log: MissionLog | None = None
        for file in files:
            try:
                meta, tables = _read(file)
                log = log or cls(meta)
                log._extend(tables)
            except Exception as error:  # damaged archives and array headers raise many types
                reason = " ".join(str(error).split())
                raise ValueError(
                    f"{file}: is not the log of a mission ({reason:.200}); give a folder that `pdpatrol run` wrote"
                ) from None
        assert log is not None
        return log

    def _extend(self, tables: Mapping[str, Mapping[str, NDArray[Any]]]) -> None:
        """Add the rows of a file.

        Raises:
            ValueError: If a row refers to a missing row of another table.
        """
        for table, columns in tables.items():
            for column, values in columns.items():
                self._rows[table][column].extend(values)
        for table in tables.keys() - {"event"}:  # rows before the first step refer to step 0
            for other in tables.keys() & TABLES[table].keys() - {"finding"}:  # `association.finding` is an id
                rows = self.column(table, other)
                if rows.size and not (rows.min() >= 0 and rows.max() < self.n_rows(other)):
                    raise ValueError(f"{table}.{other}: refers to missing rows of table {other}")


def _read(path: Path) -> tuple[dict[str, Any], dict[str, dict[str, NDArray[Any]]]]:
    """Read metadata and tables of one file.

    Raises:
        Exception: If they are not those of a log.
    """
    with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
        n_bytes = sum(member.file_size for member in archive.zip.infolist())
        if n_bytes > 4e9:  # assumed; ten million pulses fit
            raise ValueError(f"{n_bytes / 1e9:.1f} GB after decompression, the limit is 4 GB")
        meta = json.loads(str(archive["meta"]))
        if not isinstance(meta, dict) or meta.get("schema") != SCHEMA:
            raise ValueError(f"no metadata of schema {SCHEMA}, which this version reads")
        tables = {table: {column: archive[f"{table}.{column}"] for column in TABLES[table]} for table in TABLES}
    for table, columns in tables.items():
        n_rows = {values.shape[:1] for values in columns.values()}
        if len(n_rows) != 1 or () in n_rows:
            raise ValueError(f"the columns of table {table} have different lengths")
        for column, values in columns.items():
            dtype = TABLES[table][column]
            is_right = values.ndim == 2 if column in WIDE else values.shape[1:] == dtype.shape
            if values.dtype.kind != dtype.base.kind or not (is_right or n_rows == {(0,)}):
                raise ValueError(f"{table}.{column} holds {values.dtype} in rows of shape {values.shape[1:]}")
    return meta, tables


WIDE = ("strengths_v", "log_likelihood", "range_m")
"""Columns with one value per element, cell or beam in each row."""
