"""`pdpatrol sweep`: many missions side by side, none lost."""

from __future__ import annotations

import os
import re
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from pdpatrol.missions.cli.process import FAILED, one_line
from pdpatrol.missions.cli.terminal import err, out, refuse

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pdpatrol.missions.sweep.dataset import Dataset
    from pdpatrol.missions.sweep.mission_row import MissionRow
    from pdpatrol.missions.sweep.plan import MissionJob

SEEDS = re.compile(r"(\d+)(?:-(\d+))?")
SHARD = re.compile(r"(\d+)/(\d+)")


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
    """Run scenarios times settings times policies times seeds, and keep a row of each mission.

    Killed at any moment, the same command goes on where it stopped. What each mission comes to depends neither on the
    number of workers nor on the order in which they finish. Look at it with `pdpatrol results`.

    Args:
        scenario: Names of shipped scenarios, paths of TOML files, or parts of the frozen suite: suite, suite/LEVEL,
            suite/test, suite/test/LEVEL, or a yard as suite/weak_03.
        policy: seek, active, patrol, random, oracle, or own ones as my_file.py:MyPolicy.
        seeds: First and last seed, as 0-19, or one. Default: those of the suite, 0-19 in any other scenario.
        settings: Values that a key of the scenario takes, as receiver.noise_v=5e-4,1e-3,2e-3; may be given several
            times, for all combinations.
        out_dir: Folder of the dataset; one that was begun by the same command is completed. Default: under runs/, named
            after what is run.
        workers: Missions side by side. Default: as many as the machine, or the Ray cluster, has cores.
        shard: Part of the missions, from 1/N to N/N, for job arrays; all parts may share one folder.
        wall_limit_s: Longest time for one mission; one that takes longer is a row that says so.
        memory_gb: Most memory that a worker may take of its own.
        engine: pool, for processes on this machine; or ray, for a Ray cluster.
        ray_address: Of the cluster, as HOST:PORT, or auto for the one that this machine is a node of. Default: the
            environment variable RAY_ADDRESS; without it, Ray is started on this machine and ended with the sweep.
    """
    faults: list[str] = []
    seeds_match, shard_match = SEEDS.fullmatch(seeds or "0"), SHARD.fullmatch(shard)
    first, last = (int(seeds_match[1]), int(seeds_match[2] or seeds_match[1])) if seeds_match else (0, -1)
    part, n_parts = (int(shard_match[1]), int(shard_match[2])) if shard_match else (0, 0)
    if not policy:
        faults.append("--policy: at least one policy must be given, got none")
    if first > last:
        faults.append(f"--seeds: got {seeds}; allowed is one seed, or the first and the last as 0-19")
    if not 1 <= part <= n_parts:
        faults.append(f"--shard: got {shard}; allowed are 1/N to N/N")
    if workers is not None and workers < 1:
        faults.append(f"--workers: got {workers}; allowed is 1 or more")
    if not wall_limit_s > 0:
        faults.append(f"--wall-limit-s: got {wall_limit_s:g}; allowed is more than 0")
    if not memory_gb > 0:
        faults.append(f"--memory-gb: got {memory_gb:g}; allowed is more than 0")
    if engine == "ray" and find_spec("ray") is None:
        faults.append('--engine ray: needs Ray; install it with: pip install "pdpatrol[ray]"')
    if faults:
        refuse(*faults)
    from dirmusic import InputFileError
    from pdpatrol.envs.user_code import UserCodeError
    from pdpatrol.missions.policies.own_policy import BUILT_IN, load_maker
    from pdpatrol.missions.sweep.dataset import Dataset
    from pdpatrol.missions.sweep.engines.engine import Limits
    from pdpatrol.missions.sweep.engines.process_pool import run_in_processes
    from pdpatrol.missions.sweep.engines.ray_engine import run_in_ray
    from pdpatrol.missions.sweep.plan import make_plan, parse_grid

    try:
        for own in set(policy) - set(BUILT_IN):
            load_maker(own)
        plan = make_plan(scenario, policy, parse_grid(settings), range(first, last + 1) if seeds else None)
        name = scenario[0].replace("/", "-") if plan.jobs[0].suite else plan.jobs[0].scenario.name
        folder = out_dir or Path("runs") / f"sweep-{name}-{plan.digest[:8]}"
        dataset = Dataset.open_or_make(folder, plan, sys.argv[1:])
    except InputFileError as error:
        refuse(*error.faults)
    except UserCodeError as error:
        refuse(str(error))
    except OSError as error:
        refuse(f"--out: {error.filename} cannot be written ({error.strerror}); allowed is a folder that can be")
    limits = Limits(wall_limit_s, int(memory_gb * 1e9))

    def run(jobs: Sequence[MissionJob], finish: Callable[[MissionRow], None]) -> None:
        if engine == "ray":
            run_in_ray(jobs, workers, limits, finish, address=ray_address)
        else:
            run_in_processes(jobs, workers or os.cpu_count() or 1, limits, finish)

    _complete(dataset, plan.shard(part, n_parts), run)


def _complete(
    dataset: Dataset,
    shard: Sequence[MissionJob],
    run: Callable[[Sequence[MissionJob], Callable[[MissionRow], None]], None],
) -> None:
    """Run the missions of a shard that have no row yet, tell how it goes, and print what all rows came to."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from pdpatrol.missions.first_run import compile_at_first_run
    from pdpatrol.missions.sweep.analysis import summarise_groups
    from pdpatrol.missions.sweep.engines.engine import EngineError
    from pdpatrol.missions.sweep.tables import terminal_table
    from pdpatrol.missions.sweep.tally import Tally

    folder, before = dataset.folder, dataset.read().to_pylist()
    done = {row["key"] for row in before}
    jobs, tally = [job for job in shard if job.key not in done], Tally(before)
    if jobs:
        compile_at_first_run(err)  # or every worker would compile the same
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    try:
        with Progress(*columns, console=err, transient=True) as progress:
            bar = progress.add_task(tally.found(), total=len(shard), completed=len(shard) - len(jobs))

            def finish(row: MissionRow) -> None:
                dataset.write(row)
                tally.add(row)
                progress.update(bar, advance=1, description=tally.found())
                if row.status != "finished":
                    progress.console.print(
                        f"{row.scenario}, {row.policy}, seed {row.seed}: {row.status}", soft_wrap=True
                    )

            run(jobs, finish)
        if dataset.is_complete:
            dataset.compact()
    except KeyboardInterrupt:
        err.print(f"The same command goes on from {one_line(str(folder))}", soft_wrap=True)
        raise
    except EngineError as error:
        err.print(str(error), soft_wrap=True)
        raise SystemExit(FAILED) from None
    except OSError as error:
        err.print(f"{folder}: a row could not be written ({error.strerror}); finished rows are kept", soft_wrap=True)
        raise SystemExit(FAILED) from None
    out.print(terminal_table(summarise_groups(dataset.read()), f"{folder}, 95 % intervals"))
    if jobs:
        out.print(tally.cost(), soft_wrap=True)
    out.print(f"Look at it with: pdpatrol results {folder}", soft_wrap=True)
