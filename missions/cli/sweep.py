"""`pdpatrol sweep`: many missions in parallel."""

import os
import re
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Literal

import tyro
from pydantic import Field, PositiveFloat, PositiveInt

from pdpatrol.missions.cli.arguments import OutFolder, Settings, optional
from pdpatrol.missions.cli.process import one_line
from pdpatrol.missions.cli.terminal import err, fail, out, progress_bar, refuse, say
from pdpatrol.missions.first_run import compile_at_first_run
from pdpatrol.missions.record.words import counted
from pdpatrol.missions.sweep.analysis import summarise_groups
from pdpatrol.missions.sweep.dataset import Dataset, MissionRow
from pdpatrol.missions.sweep.plan import make_plan, parse_grid
from pdpatrol.missions.sweep.pool import EngineError, MissionLimits, run_in_processes
from pdpatrol.missions.sweep.ray_engine import run_in_ray
from pdpatrol.missions.sweep.tables import terminal_table


def sweep(
    scenario: Annotated[tuple[str, ...], tyro.conf.arg(metavar="[SCENARIO ...]")] = ("one_source",),
    /,
    *,
    policy: Annotated[tuple[str, ...], tyro.conf.arg(metavar="POLICY [POLICY ...]"), Field(min_length=1)] = ("seek",),
    seeds: Annotated[str | None, optional("FIRST-LAST")] = None,
    settings: Settings = (),
    out_dir: OutFolder = None,
    workers: Annotated[PositiveInt | None, optional("NUMBER")] = None,
    shard: Annotated[str, tyro.conf.arg(metavar="I/N")] = "1/1",
    wall_limit_s: Annotated[PositiveFloat, tyro.conf.arg(metavar="SECONDS")] = 900.0,
    memory_gb: Annotated[PositiveFloat, tyro.conf.arg(metavar="GB")] = 2.0,
    engine: Literal["pool", "ray"] = "pool",
    ray_address: Annotated[str | None, optional("ADDRESS")] = None,
) -> None:
    """Run a mission for each combination of scenario, settings, policy and seed, and store a row for each.

    If the sweep is killed, the same command continues it. The rows depend neither on the number of workers nor on the
    order in which missions end. `pdpatrol results` summarises them.

    Args:
        scenario: Names of shipped scenarios, paths of TOML files, or parts of the frozen suite: suite, suite/LEVEL,
            suite/test, suite/test/LEVEL, or a yard such as suite/weak_03.
        policy: seek, active, patrol, random, oracle, or your own as my_file.py:MyPolicy.
        seeds: First and last seed such as 0-19, or one seed. Default: those of the suite; 0-19 in other scenarios.
        settings: Values of a key of the scenario, such as receiver.noise_v=5e-4,1e-3,2e-3; may be given several times,
            for all combinations.
        out_dir: Folder of the dataset; a dataset that the same command has begun is completed. Default: a folder in
            runs/, named after the sweep.
        workers: Number of missions at a time. Default: the number of cores of the machine, or of the Ray cluster.
        shard: Part of the missions, from 1/N to N/N, for job arrays; all parts may share one folder.
        wall_limit_s: Longest computing time of a mission; a mission that exceeds it is stored as hung.
        memory_gb: Largest private memory of a worker.
        engine: pool, for processes on this machine; or ray, for a Ray cluster.
        ray_address: Address of the cluster: HOST:PORT, or auto for the one that this machine is a node of. Default: the
            environment variable RAY_ADDRESS; without it, Ray is started on this machine and ended with the sweep.
    """
    chosen_seeds = None
    if seeds is not None:
        expected = "one seed, or the first and the last such as 0-19"
        first, last = _ascending("--seeds", seeds, r"(\d+)(?:-(\d+))?", expected)
        chosen_seeds = range(first, last + 1)
    part, n_parts = _ascending("--shard", shard, r"(0*[1-9]\d*)/(\d+)", "1/N to N/N")
    if engine == "ray" and not find_spec("ray"):
        refuse('--engine ray: needs Ray; install it with: pip install "pdpatrol[ray]"')
    plan = make_plan(scenario, policy, parse_grid(settings), chosen_seeds)
    name = scenario[0].replace("/", "-") if plan.jobs[0].suite else plan.jobs[0].scenario.name
    folder = out_dir or Path("runs") / f"sweep-{name}-{plan.digest[:8]}"
    try:
        dataset = Dataset.open_or_make(folder, plan, sys.argv[1:])
    except OSError as error:
        refuse(f"--out: must be a folder that can be written, got {error.filename} ({error.strerror})")
    done = set(dataset.read()["key"])
    shard_jobs = plan.jobs[part - 1 :: n_parts]
    jobs = [job for job in shard_jobs if job.key not in done]
    n_missions = len(shard_jobs)
    if jobs:
        compile_at_first_run(err)  # otherwise every worker would compile the same code
    limits = MissionLimits(wall_limit_s, int(memory_gb * 1e9))
    try:
        with progress_bar() as progress:
            bar = progress.add_task(counted(n_missions, "mission"), total=n_missions, completed=n_missions - len(jobs))

            def finish(row: MissionRow) -> None:
                dataset.write(row)
                progress.advance(bar)
                if row.status != "finished":
                    text = f"{row.scenario}, {row.policy}, seed {row.seed}: {row.status}"
                    say(text, progress.console)

            if engine == "ray":
                run_in_ray(jobs, workers, limits, finish, address=ray_address)
            else:
                run_in_processes(jobs, workers or os.cpu_count() or 1, limits, finish)
        dataset.compact()
    except KeyboardInterrupt:
        say(f"The same command continues in {one_line(str(folder))}", err)
        raise
    except EngineError as error:
        fail(str(error))
    except OSError as error:
        fail(f"{folder}: a row could not be written ({error.strerror}); finished rows are kept")
    out.print(terminal_table(summarise_groups(dataset.read()), str(folder)))
    say(f"Show the results with: pdpatrol results {folder}")


def _ascending(option: str, text: str, pattern: str, expected: str) -> tuple[int, int]:
    """Parse one or two integers, of which the second must not be less than the first, or refuse the option."""
    match = re.fullmatch(pattern, text)
    first, last = (int(match[1]), int(match[2] or match[1])) if match else (0, -1)
    if last < first:
        refuse(f"{option}: must be {expected}, got {text}")
    return first, last
