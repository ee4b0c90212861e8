"""Missions in local processes: one that hangs, dies or runs out of memory becomes a row and does not stop the rest."""

import multiprocessing
import os
import resource
import sys
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from typing import NamedTuple

from pebble import ProcessExpired, ProcessPool

from pdpatrol.missions.runner import Mission
from pdpatrol.missions.sweep.dataset import MissionRow
from pdpatrol.missions.sweep.plan import MissionJob

ATTEMPTS = 3
"""Number of times a mission is started before a process that dies is recorded as its result. Assumed; the first
processes may have been killed for reasons other than the mission."""


OUT_OF_MEMORY = 75
"""Exit code of a worker whose mission ran out of memory."""


class EngineError(Exception):
    """Raised if no mission can be run at all; the message is one line for the user."""


class MissionLimits(NamedTuple):
    """Resources that one mission may use.

    Attributes:
        wall_time_s: Longest computing time.
        memory_bytes: Largest private memory of its process.
    """

    wall_time_s: float
    memory_bytes: int


def run_missions(
    jobs: Sequence[MissionJob],
    n_scheduled: int,
    schedule: Callable[[MissionJob], Future[MissionRow]],
    explain: Callable[[Exception], tuple[str, str]],
    finish: Callable[[MissionRow], None],
) -> None:
    """Run missions on an engine, and pass on each row when it is complete.

    Args:
        jobs: The missions.
        n_scheduled: Largest number of missions that the engine has at any time, running or waiting.
        schedule: Starts a mission on the engine.
        explain: Returns the status and error of a mission that ended with an exception, or raises. A mission that died
            is started again, up to `ATTEMPTS` times in all.
        finish: Called with each row, in the order in which missions end.

    Raises:
        Exception: Whatever `explain` or `finish` raises.
    """
    waiting = [(job, 1) for job in reversed(jobs)]
    running: dict[Future[MissionRow], tuple[MissionJob, int]] = {}
    while waiting or running:
        while waiting and len(running) < n_scheduled:
            started = waiting.pop()
            running[schedule(started[0])] = started
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            job, attempt = running.pop(future)
            error = future.exception()
            if not isinstance(error, Exception):
                finish(future.result())
                continue
            status, text = explain(error)
            if status == "died" and attempt < ATTEMPTS:
                waiting.append((job, attempt + 1))
            else:
                finish(MissionRow.of_failure(job, status, text))


def run_in_processes(
    jobs: Sequence[MissionJob], n_workers: int, limits: MissionLimits, finish: Callable[[MissionRow], None]
) -> None:
    """Run missions on this machine, and pass on each row when it is complete.

    Args:
        jobs: The missions.
        n_workers: Number of processes.
        limits: Limits of each mission.
        finish: Called with each row, in the order in which missions end.
    """
    pool = open_pool(n_workers, limits)
    try:
        run_in_pool(pool, jobs, 2 * n_workers, limits, finish)  # two each, so that no worker waits for its next mission
    finally:
        pool.stop()
        pool.join()


def open_pool(n_workers: int, limits: MissionLimits) -> ProcessPool:
    """Open a pool whose workers are forked from a server that has imported this module once."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([__name__])
    return ProcessPool(n_workers, initializer=set_up_worker, initargs=[limits.memory_bytes], context=context)


def run_in_pool(
    pool: ProcessPool,
    jobs: Sequence[MissionJob],
    n_scheduled: int,
    limits: MissionLimits,
    finish: Callable[[MissionRow], None],
) -> None:
    """Run missions in an open pool, which stays open; see `run_missions`."""

    def schedule(job: MissionJob) -> Future[MissionRow]:
        return pool.schedule(run_job, args=[job], timeout=limits.wall_time_s)

    def explain(error: Exception) -> tuple[str, str]:
        if isinstance(error, TimeoutError):
            return "hung", f"took longer than the limit of {limits.wall_time_s:g} s"
        if isinstance(error, ProcessExpired) and error.exitcode == OUT_OF_MEMORY:
            return "out of memory", f"needed more than {limits.memory_bytes / 1e9:g} GB"
        if isinstance(error, ProcessExpired):
            return "died", f"its process ended {ATTEMPTS} times, last with exit code {error.exitcode}"
        if isinstance(error, BrokenProcessPool):
            raise EngineError("workers end before they run a mission; try one with `pdpatrol run`") from None
        raise error

    run_missions(jobs, n_scheduled, schedule, explain, finish)


def set_up_worker(memory_bytes: int) -> None:
    """Make this process end when its parent ends, and raise `MemoryError` beyond a limit of private memory."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    resource.setrlimit(resource.RLIMIT_DATA, (memory_bytes, memory_bytes))


def _end_with_parent() -> None:
    if parent := multiprocessing.parent_process():
        parent.join()
        os._exit(1)


def run_job(job: MissionJob) -> MissionRow:
    """Run one mission in a worker and return its row, even if it raises; end the worker if memory runs out."""
    start_s = time.perf_counter()
    try:
        mission = Mission(job.scenario, job.policy, job.seed)
        log = mission.run()
        if mission.error is not None:
            raise mission.error
        peak_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1024 if sys.platform == "darwin" else 1)
        return MissionRow.of_log(job, log, time.perf_counter() - start_s, peak_kib * 1024 / 1e6)
    except Exception as error:
        if is_out_of_memory(error):
            os._exit(OUT_OF_MEMORY)  # the memory is not reliably freed for the next mission
        return MissionRow.of_failure(job, "failed", traceback.format_exc())


def is_out_of_memory(error: BaseException) -> bool:
    """Return whether an exception, or one that caused it, reports that memory ran out."""
    cause = error.__cause__
    return (
        isinstance(error, MemoryError)
        or "Could not allocate memory" in str(error)  # MuJoCo
        or (cause is not None and is_out_of_memory(cause))
    )
