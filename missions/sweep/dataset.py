"""Rows of a sweep on disk: each mission is written at once and whole, so that no crash loses a finished one."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from dirmusic import InputFileError
from pdpatrol.envs.scenario import restore_scenario
from pdpatrol.missions.atomic_file import atomic_file, write_text
from pdpatrol.missions.sweep.code_version import commit
from pdpatrol.missions.sweep.mission_row import SCHEMA, MissionRow
from pdpatrol.missions.sweep.plan import MissionJob, SweepPlan

VERSION = 1
MANIFEST, SCENARIOS, ROWS, ALL_ROWS = "sweep.json", "scenarios.parquet", "rows", "rows.parquet"


class Dataset:
    """A folder with a manifest, the scenarios, a file for each new row, and one for all rows once they are complete.

    Args:
        folder: Where it is.

    Attributes:
        folder: As given.
        manifest: What the sweep consists of, and which code it is of.

    Raises:
        InputFileError: If the folder holds no dataset.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError) as error:
            why = error.strerror if isinstance(error, OSError) else f"{MANIFEST}: no JSON"
            raise InputFileError([f"{folder}: not the dataset of a sweep ({why}); give its folder"]) from None
        kinds = {"version": int, "plan": str, "code": str, "n_missions": int, "suite": str}
        if not isinstance(manifest, dict) or any(not isinstance(manifest.get(k), kind) for k, kind in kinds.items()):
            raise InputFileError([f"{folder}: not the dataset of a sweep ({MANIFEST} is damaged); give its folder"])
        if manifest["version"] != VERSION:
            raise InputFileError(
                [f"{folder}: a dataset of version {manifest['version']!s:.20}; this program reads version {VERSION}"]
            )
        self.manifest: dict[str, Any] = manifest

    @classmethod
    def open_or_make(cls, folder: Path, plan: SweepPlan, command: Sequence[str] = ()) -> Dataset:
        """The dataset of a plan: a new one, or one that was begun and is to be completed.

        Args:
            folder: Where it is, or is to be.
            plan: All missions.
            command: Words of the command that runs them; a new dataset notes it.

        Raises:
            InputFileError: If the folder holds anything else, or a dataset of other missions or other code.
            OSError: If it cannot be written.
        """
        if folder.is_file() or (folder.is_dir() and not (folder / MANIFEST).exists() and any(folder.iterdir())):
            raise InputFileError([f"--out: {folder} is no sweep; allowed is a new or empty folder, or that of a sweep"])
        if not (folder / MANIFEST).exists():
            (folder / ROWS).mkdir(parents=True, exist_ok=True)
            scenarios = {job.scenario_digest: job.scenario.model_dump_json() for job in plan.jobs}
            columns = {"scenario_digest": list(scenarios), "scenario": list(scenarios.values())}
            _write_table(folder / SCENARIOS, pa.table(columns))
            manifest = {
                "version": VERSION,
                "command": list(command),
                "plan": plan.digest,
                "code": plan.code,
                "commit": commit(),
                "n_missions": len(plan.jobs),
                "suite": max(job.suite for job in plan.jobs),
                "versions": {name: version(name) for name in ("pdpatrol", "mujoco", "numpy", "scipy", "numba")},
            }
            write_text(folder / MANIFEST, json.dumps(manifest, indent=2) + "\n")
        dataset, faults = cls(folder), list[str]()
        if dataset.manifest["plan"] != plan.digest:
            faults.append(
                f"--out: {folder} holds other missions; allowed is a new folder, or the command of that sweep"
            )
        if dataset.manifest["code"] != plan.code:
            faults.append(f"--out: {folder} was begun by other code; allowed is a new folder: then compare the two")
        if faults:
            raise InputFileError(faults)
        return dataset

    @property
    def is_complete(self) -> bool:
        """Whether all missions have a row."""
        return len(self.keys()) == self.manifest["n_missions"]

    def keys(self) -> set[str]:
        """Keys of the missions that have a row."""
        single = {path.stem for path in (self.folder / ROWS).glob("*.parquet")}
        if (self.folder / ALL_ROWS).exists():
            single |= set(_rows(self.folder / ALL_ROWS, columns=["key"])["key"].to_pylist())
        return single

    def write(self, row: MissionRow) -> None:
        """Keep one row, whole or not at all.

        Raises:
            OSError: If it cannot be written; the rows before it stay.
        """
        _write_table(self.folder / ROWS / f"{row.key}.parquet", _as_table([row]))

    def read(self) -> pa.Table:
        """All rows, in the order of the plan; no mission comes twice."""
        rows: dict[str, dict[str, Any]] = {}
        # the common file last: what another shard takes from the single ones meanwhile is in it by then
        for path in [*(self.folder / ROWS).glob("*.parquet"), self.folder / ALL_ROWS]:
            with suppress(FileNotFoundError):
                rows |= {row["key"]: row for row in _rows(path, schema=SCHEMA).to_pylist()}
        return pa.Table.from_pylist(sorted(rows.values(), key=lambda row: row["order"]), schema=SCHEMA)

    def job(self, number: int) -> MissionJob:
        """The mission of a row, to be run again.

        Raises:
            InputFileError: If there is no such row.
        """
        rows = {row["order"]: row for row in self.read().to_pylist()}
        if number not in rows:
            raise InputFileError([f"--row: got {number}; allowed is the number of a row, 0 to {max(rows, default=0)}"])
        row = rows[number]
        try:
            scenario = restore_scenario(json.loads(self._scenarios()[row["scenario_digest"]]))
            settings = json.loads(row["settings"])
        except (LookupError, ValueError, TypeError, RecursionError) as error:
            if isinstance(error, InputFileError):
                raise
            raise InputFileError([f"{self.folder / SCENARIOS}: is damaged: no scenario of row {number}"]) from None
        return MissionJob(
            order=number,
            key=row["key"],
            level=row["level"],
            suite=row["suite"],
            scenario=scenario,
            scenario_digest=row["scenario_digest"],
            policy=row["policy"],
            settings=settings,
            seed=row["seed"],
        )

    def _scenarios(self) -> dict[str, str]:
        """Each scenario whole, as JSON, by its digest."""
        table = _rows(self.folder / SCENARIOS, columns=["scenario_digest", "scenario"]).to_pydict()
        return dict(zip(table["scenario_digest"], table["scenario"], strict=True))

    def compact(self) -> None:
        """Put all rows into one file; at any moment each is in that file or in its own."""
        _write_table(self.folder / ALL_ROWS, self.read())
        for path in (self.folder / ROWS).glob("*.parquet"):
            path.unlink(missing_ok=True)


def read_all(datasets: Sequence[Dataset]) -> pa.Table:
    """The rows of several datasets, one after the other; no mission comes twice."""
    rows: dict[str, dict[str, Any]] = {}
    for dataset in datasets:
        for row in dataset.read().to_pylist():
            rows.setdefault(row["key"], row)
    return pa.Table.from_pylist(list(rows.values()), schema=SCHEMA)


def _rows(path: Path, **wanted: Any) -> pa.Table:  # noqa: ANN401 - options of pyarrow
    """A file of rows, or some of its columns.

    Raises:
        FileNotFoundError: If it is not there.
        InputFileError: If it is damaged, or of other rows.
    """
    try:
        table = pq.read_table(path, **wanted)
        table.validate(full=True)
    except FileNotFoundError:
        raise
    except (pa.ArrowException, OSError, LookupError) as error:
        why = error.strerror if isinstance(error, OSError) and error.strerror else "damaged, or of another sweep"
        raise InputFileError([f"{path}: cannot be read ({why})"]) from None
    return table


def _as_table(rows: Sequence[MissionRow]) -> pa.Table:
    return pa.Table.from_pylist([row._asdict() for row in rows], schema=SCHEMA)


def _write_table(path: Path, table: pa.Table) -> None:
    with atomic_file(path) as temporary:
        pq.write_table(table, temporary, compression="zstd")
