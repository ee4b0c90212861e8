"""Missions side by side in processes of one machine; what hangs or dies is replaced and stops nothing."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from typing import NamedTuple

from pebble import ProcessExpired, ProcessPool

from missions.sweep.mission_row import MissionRow
from missions.sweep.plan import MissionJob
from missions.sweep.worker import RETIRED, limit_memory, run_job

ATTEMPTS = 3
"""How often a mission is started whose process dies, before its row says so (assumed)."""


class Limits(NamedTuple):
    """What one mission may take.

    Attributes:
        wall_time_s: Longest time that it may run.
        memory_bytes: Most memory that its process may take of its own.
    """

    wall_time_s: float
    memory_bytes: int


def run_in_processes(
    jobs: Sequence[MissionJob], n_workers: int, limits: Limits, finish: Callable[[MissionRow], None]
) -> None:
    """Run missions, and hand over each row when it is there.

    Workers are forked from a server that has imported everything once. The first mission runs alone: on a new machine
    it compiles, and all that follow read what it has compiled.

    Args:
        jobs: The missions.
        n_workers: Processes side by side.
        limits: Of each mission.
        finish: Called with each row, in the order in which they are finished.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["missions.sweep.worker"])
    pool = ProcessPool(max_workers=n_workers, initializer=limit_memory, initargs=[limits.memory_bytes], context=context)
    waiting: Iterator[tuple[MissionJob, int]] = ((job, 1) for job in jobs)
    again: list[tuple[MissionJob, int]] = []
    running: dict[Future[MissionRow], tuple[MissionJob, int]] = {}
    n_side_by_side = 1
    try:
        while True:
            while len(running) < n_side_by_side and (job := again.pop() if again else next(waiting, None)):
                running[pool.schedule(run_job, args=[job[0]], timeout=limits.wall_time_s)] = job
            if not running:
                break
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                job, attempt = running.pop(future)
                try:
                    finish(future.result())
                except TimeoutError:
                    text = f"took longer than the {limits.wall_time_s:g} s that are allowed"
                    finish(MissionRow.of_failure(job, "hung", text))
                except ProcessExpired as error:
                    if error.exitcode == RETIRED:
                        again.append((job, attempt))
                    elif attempt < ATTEMPTS:
                        again.append((job, attempt + 1))
                    else:
                        text = f"its process ended {ATTEMPTS} times, with exit code {error.exitcode}"
                        finish(MissionRow.of_failure(job, "died", text))
            n_side_by_side = 2 * n_workers  # so that no worker waits for its next
    finally:
        pool.stop()
        pool.join()
