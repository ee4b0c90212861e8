"""`pdpatrol sweep`: many missions in parallel."""

from __future__ import annotations

import os
import re
import sys
import time
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Literal

import tyro
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from dirmusic import InputFileError
from pdpatrol.missions.cli.process import FAILED, one_line
from pdpatrol.missions.cli.terminal import err, out, refuse
from pdpatrol.missions.first_run import compile_at_first_run
from pdpatrol.missions.sweep.analysis import summarise_groups
from pdpatrol.missions.sweep.dataset import Dataset, MissionRow
from pdpatrol.missions.sweep.plan import make_plan, parse_grid
from pdpatrol.missions.sweep.pool import EngineError, MissionLimits, run_in_processes
from pdpatrol.missions.sweep.ray_engine import run_in_ray
from pdpatrol.missions.sweep.tables import terminal_table


def sweep(
    scenario: tyro.conf.Positional[tuple[str, ...]] = ("one_source",),
    *,
    policy: tuple[str, ...] = ("seek",),
    seeds: str | None = None,
    settings: Annotated[
        tyro.conf.UseAppendAction[tuple[str, ...]], tyro.conf.arg(name="set", metavar="KEY=VALUES")
    ] = (),
    out_dir: Annotated[Path | None, tyro.conf.arg(name="out", metavar="DIR")] = None,
    workers: int | None = None,
    shard: Annotated[str, tyro.conf.arg(metavar="I/N")] = "1/1",
    wall_limit_s: float = 900.0,
    memory_gb: float = 2.0,
    engine: Literal["pool", "ray"] = "pool",
    ray_address: Annotated[str | None, tyro.conf.arg(metavar="ADDRESS")] = None,
) -> None:
    """Run scenarios times settings times policies times seeds, and store a row for each mission.

    If the command is killed, the same command continues. The rows depend neither on the number of workers nor on the
    order in which missions end. `pdpatrol results` shows them.

    Args:
        scenario: Names of shipped scenarios, paths of TOML files, or parts of the frozen suite: suite, suite/LEVEL,
            suite/test, suite/test/LEVEL, or a yard such as suite/weak_03.
        policy: seek, active, patrol, random, oracle, or your own as my_file.py:MyPolicy.
        seeds: First and last seed such as 0-19, or one seed. Default: those of the suite; 0-19 in other scenarios.
        settings: Values of a key of the scenario, such as receiver.noise_v=5e-4,1e-3,2e-3; may be given several times,
            for all combinations.
        out_dir: Folder of the dataset; one that the same command has begun is completed. Default: a folder in runs/,
            named after the sweep.
        workers: Number of missions at a time. Default: the number of cores of the machine, or of the Ray cluster.
        shard: Part of the missions, from 1/N to N/N, for job arrays; all parts may share one folder.
        wall_limit_s: Longest computing time of a mission; a mission that exceeds it is stored as hung.
        memory_gb: Largest private memory of a worker.
        engine: pool, for processes on this machine; or ray, for a Ray cluster.
        ray_address: Address of the cluster: HOST:PORT, or auto for the one that this machine is a node of. Default: the
            environment variable RAY_ADDRESS; without it, Ray is started on this machine and ended with the sweep.
    """
    seeds_match, shard_match = re.fullmatch(r"(\d+)(?:-(\d+))?", seeds or "0"), re.fullmatch(r"(\d+)/(\d+)", shard)
    first, last = (int(seeds_match[1]), int(seeds_match[2] or seeds_match[1])) if seeds_match else (0, -1)
    part, n_parts = (int(shard_match[1]), int(shard_match[2])) if shard_match else (0, 0)
    requirements = {
        "--policy: at least one policy must be given, got none": bool(policy),
        f"--seeds: must be one seed, or the first and the last such as 0-19, got {seeds}": first <= last,
        f"--shard: must be 1/N to N/N, got {shard}": 1 <= part <= n_parts,
        f"--workers: must be at least 1, got {workers}": workers is None or workers >= 1,
        f"--wall-limit-s: must be above 0, got {wall_limit_s:g}": wall_limit_s > 0,
        f"--memory-gb: must be above 0, got {memory_gb:g}": memory_gb > 0,
        '--engine ray: needs Ray; install it with: pip install "pdpatrol[ray]"': engine == "pool" or find_spec("ray"),
    }
    if broken := [text for text, is_met in requirements.items() if not is_met]:
        refuse(*broken)
    try:
        chosen_seeds = range(first, last + 1) if seeds else None
        plan = make_plan(scenario, policy, parse_grid(settings), chosen_seeds)
        name = scenario[0].replace("/", "-") if plan.jobs[0].suite else plan.jobs[0].scenario.name
        folder = out_dir or Path("runs") / f"sweep-{name}-{plan.digest[:8]}"
        dataset = Dataset.open_or_make(folder, plan, sys.argv[1:])
    except InputFileError as error:
        refuse(*error.faults)
    except OSError as error:
        refuse(f"--out: must be a folder that can be written, got {error.filename} ({error.strerror})")
    limits = MissionLimits(wall_limit_s, int(memory_gb * 1e9))
    before = dataset.read().to_pylist()
    n_found, n_sources = (sum(row[column] for row in before) for column in ("n_found", "n_sources"))
    done = {row["key"] for row in before}
    shard_jobs = plan.shard(part, n_parts)
    jobs = [job for job in shard_jobs if job.key not in done]
    if jobs:
        compile_at_first_run(err)  # or every worker would compile the same
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    start_s = time.perf_counter()
    try:
        with Progress(*columns, console=err, transient=True) as progress:
            bar = progress.add_task("starting", total=len(shard_jobs), completed=len(shard_jobs) - len(jobs))

            def finish(row: MissionRow) -> None:
                nonlocal n_found, n_sources
                dataset.write(row)
                n_found, n_sources = n_found + row.n_found, n_sources + row.n_sources
                progress.update(bar, advance=1, description=f"{n_found} of {n_sources} sources found")
                if row.status != "finished":
                    text = f"{row.scenario}, {row.policy}, seed {row.seed}: {row.status}"
                    progress.console.print(text, soft_wrap=True)

            if engine == "ray":
                run_in_ray(jobs, workers, limits, finish, address=ray_address)
            else:
                run_in_processes(jobs, workers or os.cpu_count() or 1, limits, finish)
        if dataset.is_complete:
            dataset.compact()
    except KeyboardInterrupt:
        err.print(f"The same command continues in {one_line(str(folder))}", soft_wrap=True)
        raise
    except EngineError as error:
        err.print(str(error), soft_wrap=True)
        raise SystemExit(FAILED) from None
    except OSError as error:
        err.print(f"{folder}: a row could not be written ({error.strerror}); finished rows are kept", soft_wrap=True)
        raise SystemExit(FAILED) from None
    out.print(terminal_table(summarise_groups(dataset.read()), f"{folder}, 95 % intervals"))
    if jobs:
        elapsed_s = time.perf_counter() - start_s
        rate = 3600 * len(jobs) / elapsed_s
        out.print(f"{len(jobs)} missions in {elapsed_s:.0f} s, {rate:.0f} an hour", soft_wrap=True)
    out.print(f"Show the results with: pdpatrol results {folder}", soft_wrap=True)
