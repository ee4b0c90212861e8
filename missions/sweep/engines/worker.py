"""A mission in a worker: what it came to is a row, whatever went wrong."""

from __future__ import annotations

import multiprocessing
import os
import resource
import sys
import threading
import time
import traceback

from pdpatrol.missions.runner import Mission
from pdpatrol.missions.sweep.mission_row import MissionRow
from pdpatrol.missions.sweep.plan import MissionJob

MEGABYTE = 1e6

RETIRED = 75
"""Exit code of a worker that has run out of memory once, and leaves its next mission to another."""

ORPHANED = 76
"""Exit code of a worker whose parent process has ended: nobody waits for its mission."""

_has_run_out = False


def set_up_worker(most_bytes: int) -> None:
    """Make this process end with its parent, however that ends, and take no more memory of its own than given.

    What asks for more raises `MemoryError`.

    Args:
        most_bytes: Most memory of its own.
    """
    sys.excepthook = sys.__excepthook__  # the server's own is silent
    threading.Thread(target=_end_with_parent, daemon=True).start()
    resource.setrlimit(resource.RLIMIT_DATA, (most_bytes, most_bytes))


def _end_with_parent() -> None:
    if parent := multiprocessing.parent_process():
        parent.join()
        os._exit(ORPHANED)


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
