"""A mission in a worker: what it came to is a row, whatever went wrong."""

from __future__ import annotations

import os
import resource
import sys
import time
import traceback

from missions.runner import Mission
from missions.sweep.mission_row import MissionRow
from missions.sweep.plan import MissionJob

MEGABYTE = 1e6

RETIRED = 75
"""Exit code of a worker that has run out of memory once, and leaves its next mission to another."""

_has_run_out = False


def limit_memory(most_bytes: int) -> None:
    """Let this process take no more memory of its own than that: what asks for more raises `MemoryError`."""
    resource.setrlimit(resource.RLIMIT_DATA, (most_bytes, most_bytes))


def run_job(job: MissionJob) -> MissionRow:
    """Run one mission. A process that has run out of memory ends before it runs another: nobody gives it all back."""
    global _has_run_out
    if _has_run_out:
        os._exit(RETIRED)
    start_s = time.perf_counter()
    try:
        mission = Mission(job.scenario, job.policy, job.seed)
        log = mission.run()
        if mission.error is not None:
            raise mission.error
        return MissionRow.of_log(job, log, time.perf_counter() - start_s, peak_memory_mb())
    except Exception as error:
        _has_run_out = is_out_of_memory(error)
        return MissionRow.of_failure(job, "out of memory" if _has_run_out else "failed", traceback.format_exc())


def is_out_of_memory(error: BaseException) -> bool:
    """Whether an exception, or the one that caused it, says that there was no memory left."""
    cause = error.__cause__
    return (
        isinstance(error, MemoryError)
        or "Could not allocate memory" in str(error)  # MuJoCo
        or (cause is not None and is_out_of_memory(cause))
    )


def peak_memory_mb() -> float:
    """Largest resident memory of this process so far."""
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / MEGABYTE
