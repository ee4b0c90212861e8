"""Missions side by side in processes of one machine; what hangs or dies is replaced and stops nothing."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import resource_tracker

from pebble import ProcessExpired, ProcessPool

from pdpatrol.missions.sweep.engines.engine import ATTEMPTS, EngineError, Limits, Loss, run_missions
from pdpatrol.missions.sweep.engines.worker import RETIRED, run_job, set_up_worker
from pdpatrol.missions.sweep.mission_row import MissionRow
from pdpatrol.missions.sweep.plan import MissionJob


def run_in_processes(
    jobs: Sequence[MissionJob], n_workers: int, limits: Limits, finish: Callable[[MissionRow], None]
) -> None:
    """Run missions, and hand over each row when it is there.

    Args:
        jobs: The missions.
        n_workers: Processes side by side.
        limits: Of each mission.
        finish: Called with each row, in the order in which they are finished.
    """
    pool = open_pool(n_workers, limits)
    try:
        run_in_pool(pool, jobs, 2 * n_workers, limits, finish)  # two each, so that no worker waits for its next
    finally:
        pool.stop()
        pool.join()


def open_pool(n_workers: int, limits: Limits) -> ProcessPool:
    """Processes for missions, forked from a server that has imported everything once."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(
        ["pdpatrol.missions.sweep.engines.worker", "pdpatrol.missions.sweep.engines.fork_server"]
    )
    with _warnings_of_new_processes("ignore:resource_tracker:UserWarning"):
        resource_tracker.ensure_running()  # it tidies up after an end by force, and need not tell users of it
    return ProcessPool(
        max_workers=n_workers, initializer=set_up_worker, initargs=[limits.memory_bytes], context=context
    )


@contextmanager
def _warnings_of_new_processes(rule: str) -> Iterator[None]:
    """Add a rule for warnings to those of the processes that are started in the block."""
    before = os.environ.get("PYTHONWARNINGS")
    os.environ["PYTHONWARNINGS"] = f"{before},{rule}" if before else rule
    try:
        yield
    finally:
        del os.environ["PYTHONWARNINGS"]
        if before is not None:
            os.environ["PYTHONWARNINGS"] = before


def run_in_pool(
    pool: ProcessPool,
    jobs: Sequence[MissionJob],
    n_scheduled: int,
    limits: Limits,
    finish: Callable[[MissionRow], None],
) -> None:
    """Run missions in a pool that is open, and stays so.

    Args:
        pool: As of `open_pool`.
        jobs: The missions.
        n_scheduled: Most missions that the pool has at any time, running or waiting.
        limits: Of each mission.
        finish: Called with each row, in the order in which they are finished.
    """

    def schedule(job: MissionJob) -> Future[MissionRow]:
        return pool.schedule(run_job, args=[job], timeout=limits.wall_time_s)

    def explain(error: Exception) -> Loss:
        if isinstance(error, TimeoutError):
            return Loss("hung", f"took longer than the {limits.wall_time_s:g} s that are allowed", ATTEMPTS)
        if isinstance(error, ProcessExpired):
            text = f"its process ended {ATTEMPTS} times, with exit code {error.exitcode}"
            return Loss("died", text, 0 if error.exitcode == RETIRED else 1)
        if isinstance(error, BrokenProcessPool):
            raise EngineError(
                "the workers end before they run anything; one mission by `pdpatrol run` tells why"
            ) from None
        raise error

    run_missions(jobs, n_scheduled, schedule, explain, finish)
