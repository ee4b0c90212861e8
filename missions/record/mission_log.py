"""MissionLog: the neutral record of a mission, from which report, recording and plots are made.

Flat tables of equal-length columns, and `meta`, one JSON text. A log can be rendered again years later; a
recording cannot. Nothing in it needs the simulator: data from the field fits as well, without the columns that
only a simulator knows.
"""

from __future__ import annotations

import json
import math
from bisect import bisect_left
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdpatrol.missions.atomic_file import atomic_file

SCHEMA = 5

TABLES: dict[str, dict[str, np.dtype[Any]]] = {
    "step": {
        "time_s": np.dtype("f8"),
        "pose": np.dtype(("f8", 3)),  # believed x m, y m, yaw rad, world frame, at the end of the step
        "true_pose": np.dtype(("f8", 3)),  # NaN in field data
        "odometry": np.dtype(("f8", 3)),  # by wheels and gyro alone, from the first believed pose on; NaN in field data
        "battery": np.dtype("f8"),  # share that is left; NaN in field data
        "command": np.dtype(("f8", 2)),  # speed m/s and yaw rate rad/s asked for during the step
        "phase": np.dtype("U"),  # `record.events.Phase`: what the policy was doing
        "phase_target": np.dtype("i8"),  # waypoint that it drove to, or finding that it viewed; 0 for neither
    },
    "pulse": {
        "step": np.dtype("i8"),
        "strengths_v": np.dtype("f8"),  # one value per element: (n, n_elements)
        "mains_phase_rad": np.dtype("f8"),
        "is_clipped": np.dtype("?"),  # met the end of the converter's scale; not used for locating
        "is_credible": np.dtype("?"),  # looks like one plane wave from one direction
    },
    "bearing": {
        "pulse": np.dtype("i8"),  # row in the pulse table
        "azimuth_rad": np.dtype("f8"),  # array frame
        "bearing_rad": np.dtype("f8"),  # world frame, with the believed heading
        "std_rad": np.dtype("f8"),  # from noise alone; the manifold's common error comes on top
    },
    "scan": {  # of the lidar; none in field data
        "step": np.dtype("i8"),
        "range_m": np.dtype("f4"),  # one value per beam: (n, n_beams), the first ahead, counter-clockwise; see `meta`
    },
    "finding": {
        "step": np.dtype("i8"),
        "id": np.dtype("i8"),
        "position_m": np.dtype(("f8", 3)),
        "covariance_m2": np.dtype(("f8", (3, 3))),
        "state": np.dtype("U"),  # candidate, confirmed, outside, ghost; dropped, once, when it is no more
        "n_bearings": np.dtype("i8"),
        "first_detected_s": np.dtype("f8"),
        "confirmed_s": np.dtype("f8"),  # when it was first confirmed; NaN until then
        "aperture_rad": np.dtype("f8"),  # angle over which the lines of sight spread, seen from the finding
    },
    "likelihood": {  # over the yard, by all credible pulses so far
        "step": np.dtype("i8"),
        "log_likelihood": np.dtype("f4"),  # one value per cell of the grid in `meta`: (n, n_cells)
    },
    "association": {  # written at the end; empty where a mission was killed
        "pulse": np.dtype("i8"),  # row in the pulse table
        "finding": np.dtype("i8"),  # id, or a code of `dirmusic.locating.association.Unassociated`
    },
    "event": {  # `record.events.Event`
        "step": np.dtype("i8"),
        "kind": np.dtype("U"),
        "number": np.dtype("i8"),
        "subject": np.dtype("U"),
        "text": np.dtype("U"),
    },
}
"""Every table and its columns. Step i covers the time up to `step.time_s[i]`; other tables refer to a step by its row.

Text columns have no width: NumPy chooses the width of the longest text, so nothing is cut.
"""


class MissionLog:
    """Tables that grow row by row, and the facts about the mission that do not change.

    Args:
        meta: JSON-serialisable facts: seed, policy, scenario as read, solids, nominal array, and `truth` where the
            data come from a simulator; at the end `calibration`, what was learned of the array, if anything was.
    """

    def __init__(self, meta: Mapping[str, Any]) -> None:
        self.meta: dict[str, Any] = {"schema": SCHEMA, **meta}
        self._rows: dict[str, dict[str, list[Any]]] = {
            table: {column: [] for column in columns} for table, columns in TABLES.items()
        }
        self._written: dict[str, int] = dict.fromkeys(TABLES, 0)

    def append(self, table: str, **row: Any) -> int:  # noqa: ANN401 - a row's values are of many types
        """Add one row to a table and return its number. Every column of the table must be given."""
        columns = self._rows[table]
        if row.keys() != columns.keys():
            raise ValueError(f"a row of `{table}` has the columns {', '.join(columns)}; got {', '.join(row)}")
        for column, value in row.items():
            columns[column].append(value)
        return self.n_rows(table) - 1

    def n_rows(self, table: str) -> int:
        """Rows in a table so far."""
        return len(next(iter(self._rows[table].values())))

    def rows_before(self, table: str, step: int) -> int:
        """How many rows of a table belong to steps before one; rows are in order of time."""
        if table == "step":
            return min(step, self.n_rows("step"))
        if table == "bearing":
            return bisect_left(self._rows["bearing"]["pulse"], self.rows_before("pulse", step))
        return bisect_left(self._rows[table]["step"], step)

    def column(self, table: str, column: str, start: int = 0, stop: int | None = None) -> NDArray[Any]:
        """One column from row `start` up to `stop`, as an array of its declared type; row number first."""
        dtype = TABLES[table][column]
        values = self._rows[table][column][start:stop]
        if not values:
            widths = {
                "strengths_v": self.meta.get("n_elements", 0),
                "log_likelihood": self.n_cells,
                "range_m": self.meta.get("lidar", {}).get("n_beams", 0),
            }
            width = widths.get(column)
            return np.empty((0, width) if width else (0, *dtype.shape), dtype=dtype.base)
        return np.array(values, dtype=dtype.base)

    @property
    def n_cells(self) -> int:
        """Of the grid of the likelihood over the yard; none where the log has no grid."""
        return math.prod(self.meta["grid"]["shape"]) if "grid" in self.meta else 0

    def table(self, table: str, start: int = 0, stop: int | None = None) -> dict[str, NDArray[Any]]:
        """All columns of a table from row `start` up to `stop`."""
        return {column: self.column(table, column, start, stop) for column in TABLES[table]}

    def _arrays(self, start: Mapping[str, int]) -> dict[str, NDArray[Any]]:
        return {
            f"{table}.{column}": self.column(table, column, start[table])
            for table in TABLES
            for column in TABLES[table]
        }

    def write_part(self, folder: Path) -> None:
        """Write the rows since the last part, so that a killed mission keeps what it had."""
        parts = folder / "log.parts"
        parts.mkdir(exist_ok=True)
        _save(parts / f"part-{len(list(parts.glob('part-*.npz'))):05d}.npz", self.meta, self._arrays(self._written))
        self._written = {table: self.n_rows(table) for table in TABLES}

    def save(self, folder: Path) -> Path:
        """Write `log.npz` whole (under a temporary name, then renamed) and remove the parts."""
        path = folder / "log.npz"
        _save(path, self.meta, self._arrays(dict.fromkeys(TABLES, 0)))
        for part in (folder / "log.parts").glob("part-*.npz"):
            part.unlink()
        if (folder / "log.parts").exists():
            (folder / "log.parts").rmdir()
        return path

    @classmethod
    def load(cls, folder: Path) -> MissionLog:
        """Read `log.npz` of a mission's folder, or the parts that a killed mission left.

        Raises:
            FileNotFoundError: If the folder holds neither.
            ValueError: If a file is damaged or no log, or was written under another schema.
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
                log._take_up(tables)
            except ValueError as error:
                fault = str(error).removeprefix(f"{file}: ")
                raise ValueError(
                    f"{file}: is not the log of a mission ({fault}); give the folder that `pdpatrol run` wrote"
                ) from None
        assert log is not None
        return log

    def _take_up(self, tables: Mapping[str, Mapping[str, NDArray[Any]]]) -> None:
        """Add the rows of a file; raises ValueError where a table points beyond another."""
        for table, columns in tables.items():
            for column, values in columns.items():
                self._rows[table][column].extend(values)
        for table, column, other in POINTERS:
            numbers = self.column(table, column)
            if numbers.size and not (numbers.min() >= 0 and numbers.max() < self.n_rows(other)):
                raise ValueError(f"{table}.{column}: damaged, for it points beyond the table {other}")


POINTERS = (
    ("pulse", "step", "step"),
    ("bearing", "pulse", "pulse"),
    ("scan", "step", "step"),
    ("finding", "step", "step"),
    ("likelihood", "step", "step"),
    ("association", "pulse", "pulse"),
)
"""Columns that hold numbers of rows, and the tables that these are of."""

MAX_BYTES = 4 * 10**9
"""Size limit of a log after decompression. Assumed; ten million pulses fit."""


def _read(path: Path) -> tuple[dict[str, Any], dict[str, dict[str, NDArray[Any]]]]:
    """Read metadata and tables of one file.

    Raises:
        ValueError: If they are not those of a log; the message does not name the file.
    """
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            n_bytes = sum(member.file_size for member in archive.zip.infolist())
            arrays = dict(archive) if n_bytes <= MAX_BYTES else {}
        meta = json.loads(str(arrays["meta"])) if arrays else None
    except Exception as error:  # each part of the archive and each array header fails in its own way
        reason = " ".join(str(error).split())
        raise ValueError(f"damaged or incomplete archive: {reason:.200}") from None
    if n_bytes > MAX_BYTES:
        raise ValueError(f"{n_bytes / 1e9:.1f} GB, the limit is {MAX_BYTES / 1e9:g} GB")
    if not isinstance(meta, dict) or "schema" not in meta:
        raise ValueError("missing metadata")
    if meta["schema"] != SCHEMA:
        raise ValueError(f"log schema {meta['schema']!s:.20}, this version reads schema {SCHEMA}")
    missing = [
        name for table, columns in TABLES.items() for column in columns if (name := f"{table}.{column}") not in arrays
    ]
    if missing:
        raise ValueError(f"missing arrays {', '.join(missing):.200}")
    tables = {table: {column: arrays[f"{table}.{column}"] for column in columns} for table, columns in TABLES.items()}
    for table, columns in TABLES.items():
        lengths = {len(values) if values.ndim else -1 for values in tables[table].values()}
        kinds = all(tables[table][column].dtype.kind == dtype.base.kind for column, dtype in columns.items())
        if len(lengths) != 1 or -1 in lengths or not kinds:
            raise ValueError(f"the columns of table {table} do not match")
        for column, dtype in columns.items():
            shape = tables[table][column].shape[1:]
            is_right = len(shape) == 1 if column in WIDE else shape == dtype.shape
            if not is_right and lengths != {0}:
                raise ValueError(f"{table}.{column} has rows of shape {shape}")
    return meta, tables


WIDE = ("strengths_v", "log_likelihood", "range_m")
"""Columns with a row for each element, cell or beam."""


def _save(path: Path, meta: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> None:
    with atomic_file(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, meta=np.array(json.dumps(meta)), **arrays)
