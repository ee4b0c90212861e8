"""What the engines of a sweep share: the limits of a mission, and what becomes of one that has given no row."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from typing import NamedTuple

from pdpatrol.missions.sweep.mission_row import MissionRow, Status
from pdpatrol.missions.sweep.plan import MissionJob

ATTEMPTS = 3
"""How often a mission is started whose process dies, before its row says so (assumed)."""


class EngineError(Exception):
    """An engine cannot run any mission at all; the message is one line for the user."""


class Limits(NamedTuple):
    """What one mission may take.

    Attributes:
        wall_time_s: Longest time that it may run.
        memory_bytes: Most memory that its process may take of its own.
    """

    wall_time_s: float
    memory_bytes: int


class Loss(NamedTuple):
    """Why a mission that was started has given no row.

    Attributes:
        status: Of its row, if it is not started again.
        error: Of its row, likewise.
        n_attempts: How many of its `ATTEMPTS` this uses up: 1 if the mission may be to blame, 0 if something else is,
            all of them if starting it again is of no use.
    """

    status: Status
    error: str
    n_attempts: int = 1


def run_missions(
    jobs: Sequence[MissionJob],
    n_scheduled: int,
    schedule: Callable[[MissionJob], Future[MissionRow]],
    explain: Callable[[Exception], Loss],
    finish: Callable[[MissionRow], None],
) -> None:
    """Run missions on an engine, and hand over each row when it is there.

    Args:
        jobs: The missions.
        n_scheduled: Most missions that the engine has at any time, so that no queue grows with their number.
        schedule: Starts a mission on the engine.
        explain: Says of an exception that a mission ended with what is to become of the mission, or raises.
        finish: Called with each row, in the order in which they are finished.

    Raises:
        Exception: Whatever `explain` or `finish` raises.
    """
    waiting: Iterator[tuple[MissionJob, int]] = ((job, 0) for job in jobs)
    again: list[tuple[MissionJob, int]] = []
    running: dict[Future[MissionRow], tuple[MissionJob, int]] = {}
    while True:
        while len(running) < n_scheduled and (started := again.pop() if again else next(waiting, None)):
            running[schedule(started[0])] = started
        if not running:
            break
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            job, n_attempts = running.pop(future)
            error = future.exception()
            if not isinstance(error, Exception):
                finish(future.result())
                continue
            loss = explain(error)
            if n_attempts + loss.n_attempts < ATTEMPTS:
                again.append((job, n_attempts + loss.n_attempts))
            else:
                finish(MissionRow.of_failure(job, loss.status, loss.error))
