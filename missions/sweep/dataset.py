"""Dataset of a sweep: a folder with one row for each mission, written as soon as the mission ends."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_type_hints

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from pydantic import BaseModel, ConfigDict, ValidationError

from dirmusic import InputFileError
from pdpatrol.envs.scenario import restore_scenario
from pdpatrol.missions.atomic_file import atomic_file, write_text
from pdpatrol.missions.driving.site_map import SiteMap, distances_along
from pdpatrol.missions.record.log_contents import bearing_rmse
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.inspection import inspect_sites
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.sweep.plan import MissionJob, SweepPlan, commit, digest_of_code

MANIFEST, SCENARIOS, ROWS, ALL_ROWS = "sweep.json", "scenarios.parquet", "rows", "rows.parquet"
FORMAT = 2
"""Version of the columns. Datasets of other versions are refused, because their scores have other meanings."""

Frame = Any
"""A `pandas.DataFrame`, which has no type annotations."""


class MissionRow(NamedTuple):
    """Row of the dataset: one mission of a sweep.

    Attributes:
        order: Number of the mission in the sweep.
        key: See `MissionJob`.
        suite: See `MissionJob`.
        level: See `MissionJob`.
        scenario: Name of the scenario.
        scenario_digest: SHA-256 of the scenario with its settings; `scenarios.parquet` holds the full scenario.
        policy: Name of the policy.
        settings: Values that the sweep set in the scenario, as JSON.
        seed: Seed of the mission.
        status: `finished`; `failed` if the mission raised an exception; `hung` if it took too long; `out of memory`; or
            `died` if its process ended repeatedly. All numbers below are null or 0 unless the mission finished.
        error: Traceback or reason; empty if finished.
        n_sources: Number of sources in the yard.
        n_found: Number of sources that are paired with a finding, see `pdpatrol.missions.report.records.Scores` for
            this and all other scores.
        false_findings: Number of confirmed findings without a source.
        errors_m: Horizontal distances between found sources and their findings.
        height_errors_m: Heights of these findings relative to their sources, positive above.
        true_heights_m: Heights of the found sources.
        mahalanobis2_2d: Squared Mahalanobis distances of the found sources from their findings, horizontally.
        mahalanobis2_3d: The same in three dimensions.
        log_scores: Minus the logarithms of the stated densities at the found sources.
        site_log_scores: Minus the logarithms of the stated probabilities of the sites of the found sources.
        n_right_site: Number of found sources whose finding names the right site first.
        n_possibly_two: Number of found sources whose finding states that it is possibly two.
        confirmed_s: Time of the first right confirmation of each source that ever had one, found at the end or not.
        ospa_m: OSPA distance between findings and sources.
        n_confirmations: Number of findings that were confirmed at any time.
        n_wrong_confirmations: Number of those that were shown at a wrong place for more than 2 s.
        wrong_s: Total time for which findings were shown so.
        n_certified: Number of sites that the report lists as inspected; 0 without a map of sites.
        n_false_all_clear: Number of those with a source of the stated level and rate that was not found.
        bearing_rmse_rad: Root mean square error of the bearings in line of sight of exactly one source; null without
            such bearings.
        distance_m: Path length.
        found_all_m: Path length until the first right confirmation of the last source; null without sources, or if a
            source had none or was not found at the end.
        shortest_m: Length of the shortest path from the dock to within the scenario's `standoff_m` of every source;
            null without sources, or if a source cannot be approached.
        sim_time_s: Simulated time.
        contacts: Number of collisions.
        waypoints_missed: Number of waypoints that were not visited.
        wall_time_s: Computing time.
        peak_memory_mb: Largest resident memory of the process up to the end of the mission.
    """

    order: int
    key: str
    suite: str
    level: str
    scenario: str
    scenario_digest: str
    policy: str
    settings: str
    seed: int
    status: str
    error: str
    n_sources: int = 0
    n_found: int = 0
    false_findings: int = 0
    errors_m: tuple[float, ...] = ()
    height_errors_m: tuple[float, ...] = ()
    true_heights_m: tuple[float, ...] = ()
    mahalanobis2_2d: tuple[float, ...] = ()
    mahalanobis2_3d: tuple[float, ...] = ()
    log_scores: tuple[float, ...] = ()
    site_log_scores: tuple[float, ...] = ()
    n_right_site: int = 0
    n_possibly_two: int = 0
    confirmed_s: tuple[float, ...] = ()
    ospa_m: float | None = None
    n_confirmations: int = 0
    n_wrong_confirmations: int = 0
    wrong_s: float | None = None
    n_certified: int = 0
    n_false_all_clear: int = 0
    bearing_rmse_rad: float | None = None
    distance_m: float | None = None
    found_all_m: float | None = None
    shortest_m: float | None = None
    sim_time_s: float | None = None
    contacts: int = 0
    waypoints_missed: int = 0
    wall_time_s: float | None = None
    peak_memory_mb: float | None = None

    @classmethod
    def of_failure(cls, job: MissionJob, status: str, error: str) -> MissionRow:
        """Make the row of a mission without results."""
        columns = {name: getattr(job, name) for name in MissionJob._fields if name not in ("scenario", "settings")}
        settings = json.dumps(dict(job.settings), sort_keys=True)
        return cls(**columns, scenario=job.scenario.name, settings=settings, status=status, error=error)

    @classmethod
    def of_log(cls, job: MissionJob, log: MissionLog, wall_time_s: float, peak_memory_mb: float) -> MissionRow:
        """Make the row of a finished mission."""
        report = make_report(log, wall_time_s, inspect_sites(log))
        scores, step = report.scores, log.table("step")
        sources, matches = scores.sources, scores.matches
        possibly_two = {finding.id for finding in report.findings if finding.possibly_two}
        confirmed_s = tuple(source.confirmed_s for source in sources if source.confirmed_s is not None)
        driven_m, found_all_m = distances_along(step["true_pose"]), None
        if sources and len(matches) == len(confirmed_s) == len(sources):
            found_all_m = float(np.interp(max(confirmed_s), step["time_s"], driven_m))
        sources_m = [np.array(source.true_position_m[:2]) for source in sources]
        shortest_m = SiteMap(job.scenario, job.scenario.yard).shortest_tour(sources_m, job.scenario.task.standoff_m)
        bearing_rmse_rad = bearing_rmse(log, job.scenario)
        return cls.of_failure(job, "finished", "")._replace(
            n_sources=len(sources),
            n_found=len(matches),
            false_findings=scores.false_findings,
            errors_m=tuple(match.error_m for match in matches),
            height_errors_m=tuple(match.height_error_m for match in matches),
            true_heights_m=tuple(source.true_position_m[2] for source in sources if source.found),
            mahalanobis2_2d=tuple(match.mahalanobis2_2d for match in matches),
            mahalanobis2_3d=tuple(match.mahalanobis2_3d for match in matches),
            log_scores=tuple(match.log_score for match in matches),
            site_log_scores=tuple(match.site_log_score for match in matches),
            n_right_site=sum(match.right_site for match in matches),
            n_possibly_two=sum(match.finding_id in possibly_two for match in matches),
            confirmed_s=confirmed_s,
            ospa_m=scores.ospa_m,
            n_confirmations=scores.confirmations,
            n_wrong_confirmations=scores.wrong_confirmations,
            wrong_s=scores.wrong_s,
            n_certified=len(report.inspection.names("inspected")) if report.inspection else 0,
            n_false_all_clear=len(scores.false_all_clears or ()),
            bearing_rmse_rad=bearing_rmse_rad if np.isfinite(bearing_rmse_rad) else None,
            distance_m=float(driven_m[-1]),
            found_all_m=found_all_m,
            shortest_m=shortest_m if sources and np.isfinite(shortest_m) else None,
            sim_time_s=report.sim_time_s,
            contacts=report.collisions,
            waypoints_missed=len(report.waypoints.missed),
            wall_time_s=wall_time_s,
            peak_memory_mb=peak_memory_mb,
        )


_TYPES = {str: pa.string(), int: pa.int64(), tuple[float, ...]: pa.list_(pa.float64())}
SCHEMA = pa.schema({name: _TYPES.get(kind, pa.float64()) for name, kind in get_type_hints(MissionRow).items()})
"""Columns of a dataset: the fields of `MissionRow`."""


class Manifest(BaseModel):
    """Contents of `sweep.json`.

    Attributes:
        version: `FORMAT`.
        command: Words of the command line.
        plan: Digest of all missions.
        code: Digest of the code of this project.
        commit: Commit of the code, followed by `+` if files were changed since.
        n_missions: Number of missions in the plan.
        suite: Version and checksum of the suite; empty if no mission is from the suite.
        versions: Versions of libraries.
    """

    model_config = ConfigDict(strict=True, frozen=True)

    version: Literal[2] = FORMAT
    command: list[str] = []
    plan: str
    code: str
    commit: str = ""
    n_missions: int
    suite: str
    versions: dict[str, str] = {}


class Dataset:
    """Folder with a manifest, the scenarios, and one file per row, or a single file once all rows are complete.

    Args:
        folder: Folder of an existing dataset.

    Attributes:
        folder: Folder of the dataset.
        manifest: Command, digests of missions and code, and versions.

    Raises:
        InputFileError: If the folder does not hold a dataset of this format.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            self.manifest = Manifest.model_validate_json((folder / MANIFEST).read_bytes())
        except ValidationError as error:
            first = error.errors()[0]
            if first["loc"] == ("version",):
                text = f"must be of format {FORMAT}, got {first['input']!r}, whose scores differ; run its sweep again"
                raise InputFileError([f"{folder}: {text}"]) from None
            key = "".join(f"{part}: " for part in first["loc"])
            raise InputFileError([f"{folder / MANIFEST}: {key}{first['msg']}"]) from None
        except OSError:
            raise InputFileError([f"{folder}: must be the folder of a sweep, but {MANIFEST} cannot be read"]) from None

    @classmethod
    def open_or_make(cls, folder: Path, plan: SweepPlan, command: Sequence[str] = ()) -> Dataset:
        """Make the dataset of a plan, or open a dataset that the same sweep has begun.

        Args:
            folder: Folder of the dataset.
            plan: All missions.
            command: Words of the command line, stored in a new dataset.

        Raises:
            InputFileError: If the folder holds anything else, or a dataset of other missions or of other code.
            OSError: If the dataset cannot be written.
        """
        if not (folder / MANIFEST).exists():
            if folder.is_file() or (folder.is_dir() and any(folder.iterdir())):
                raise InputFileError([f"--out: must be a new or empty folder, or that of a sweep, got {folder}"])
            (folder / ROWS).mkdir(parents=True, exist_ok=True)
            scenarios = {job.scenario_digest: job.scenario.model_dump_json() for job in plan.jobs}
            columns = {"scenario_digest": list(scenarios), "scenario": list(scenarios.values())}
            _write_table(folder / SCENARIOS, pa.table(columns))
            manifest = Manifest(
                command=list(command),
                plan=plan.digest,
                code=digest_of_code(),
                commit=commit(),
                n_missions=len(plan.jobs),
                suite=max(job.suite for job in plan.jobs),
                versions={name: version(name) for name in ("pdpatrol", "mujoco-core", "numpy", "scipy", "numba")},
            )
            write_text(folder / MANIFEST, manifest.model_dump_json(indent=2) + "\n")
        dataset = cls(folder)
        if dataset.manifest.plan != plan.digest:
            raise InputFileError([f"--out: {folder} has other missions; use a new folder or the command of that sweep"])
        if dataset.manifest.code != digest_of_code():
            raise InputFileError([f"--out: {folder} was begun by another version of the code; use a new folder"])
        return dataset

    def write(self, row: MissionRow) -> None:
        """Write one row atomically.

        Raises:
            OSError: If the row cannot be written; earlier rows are kept.
        """
        _write_table(self.folder / ROWS / f"{row.key}.parquet", pa.Table.from_pylist([row._asdict()], schema=SCHEMA))

    def read(self) -> Frame:
        """Return all rows in the order of the plan, each mission once."""
        tables = [SCHEMA.empty_table()]
        # The common file is read last: it contains the rows whose single files another shard may delete meanwhile.
        for path in [*(self.folder / ROWS).glob("*.parquet"), self.folder / ALL_ROWS]:
            with suppress(FileNotFoundError):
                tables.append(_read_table(path, SCHEMA))
        rows: Frame = pa.concat_tables(tables).to_pandas()
        return rows.drop_duplicates("key", keep="last").sort_values("order", ignore_index=True)

    def job(self, number: int) -> MissionJob:
        """Return the job of a row, to run the mission again.

        Raises:
            InputFileError: If the row does not exist, or its scenario is damaged.
        """
        rows = {row["order"]: row for row in self.read().to_dict("records")}
        if number not in rows:
            raise InputFileError([f"--row: must be the number of a row, 0 to {max(rows, default=0)}, got {number}"])
        row = rows[number]
        scenarios: Frame = _read_table(self.folder / SCENARIOS).to_pandas()
        try:
            text = scenarios.set_index("scenario_digest")["scenario"][row["scenario_digest"]]
            scenario, settings = restore_scenario(json.loads(text)), json.loads(row["settings"])
        except (LookupError, ValueError, RecursionError) as error:
            if isinstance(error, InputFileError):
                raise
            raise InputFileError([f"{self.folder / SCENARIOS}: must hold the scenario of row {number}"]) from None
        columns = {name: row[name] for name in MissionJob._fields}
        return MissionJob(**columns | {"scenario": scenario, "settings": settings})

    def compact(self) -> None:
        """Move all rows into one file if they are complete; at any time each row is in that file or in its own file."""
        rows = self.read()
        if len(rows) == self.manifest.n_missions:
            _write_table(self.folder / ALL_ROWS, pa.Table.from_pandas(rows, SCHEMA))
            for path in (self.folder / ROWS).glob("*.parquet"):
                path.unlink(missing_ok=True)


def read_all(datasets: Sequence[Dataset]) -> Frame:
    """Return the rows of several datasets in order, each mission once, from the first that has it."""
    return pd.concat([each.read() for each in datasets]).drop_duplicates("key", ignore_index=True)


def _read_table(path: Path, schema: pa.Schema | None = None) -> pa.Table:
    try:
        table = pq.read_table(path, schema=schema)
        table.validate(full=True)
    except FileNotFoundError:
        raise
    except (pa.ArrowException, OSError, LookupError):
        raise InputFileError([f"{path}: cannot be read; it is damaged or belongs to another sweep"]) from None
    return table


def _write_table(path: Path, table: pa.Table) -> None:
    with atomic_file(path) as temporary:
        pq.write_table(table, temporary, compression="zstd")
