"""Missions on a Ray cluster: each is a task, and runs again if its node is lost.

A Ray worker keeps one process for missions and runs them as on a single machine, so that a mission that hangs, dies or
runs out of memory gives the same row and does not affect Ray.
"""

import logging
import os
import socket
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from functools import cache

from pebble import ProcessPool

from pdpatrol.missions.sweep.dataset import MissionRow
from pdpatrol.missions.sweep.plan import MissionJob, digest_of_code
from pdpatrol.missions.sweep.pool import (
    ATTEMPTS,
    EngineError,
    MissionLimits,
    open_pool,
    run_in_pool,
    run_missions,
)


def run_in_ray(
    jobs: Sequence[MissionJob],
    n_workers: int | None,
    limits: MissionLimits,
    finish: Callable[[MissionRow], None],
    *,
    address: str | None = None,
) -> None:
    """Run missions on a Ray cluster, and pass on each row when it is complete.

    Args:
        jobs: The missions.
        n_workers: Largest number of missions at a time; None for the number of cores of the cluster.
        limits: Limits of each mission.
        finish: Called with each row, in the order in which missions end.
        address: Address of the cluster: HOST:PORT, or `auto` for the one that this machine is a node of. Default: the
            environment variable `RAY_ADDRESS`; without it, Ray is started on this machine and ended with the missions.

    Raises:
        EngineError: If the cluster cannot be joined, or one of its nodes cannot run this code.
    """
    address = address or os.environ.get("RAY_ADDRESS") or "local"
    started = {}
    if address == "local":
        os.environ["RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"] = "0"  # servers listen on 127.0.0.1 only
        # Missions and rows are kilobytes and do not use the object store.
        started = {"num_cpus": n_workers, "include_dashboard": False, "object_store_memory": 100_000_000}
    os.environ.setdefault(
        "RAY_DEDUP_LOGS_SKIP_REGEX", "."
    )  # prints no logs: `log_to_driver` lets errors of nodes through
    os.environ.setdefault("RAY_ENABLE_UV_RUN_RUNTIME_ENV", "0")  # no copy of the working directory for each worker
    import ray  # an optional dependency, which reads the environment when it is imported
    from ray import exceptions

    def explain(error: Exception) -> tuple[str, str]:
        if isinstance(error, (exceptions.NodeDiedError, exceptions.WorkerCrashedError, exceptions.OutOfMemoryError)):
            return "died", f"its Ray worker or node ended {ATTEMPTS} times: {error}"
        cause = str(getattr(error, "cause", error)).partition("\n")[0]
        raise EngineError(f"--engine ray: a node cannot run missions: {cause}") from error

    _check_address(address)
    try:
        ray.init(address, log_to_driver=False, logging_level=logging.CRITICAL, **started)
    except (OSError, RuntimeError, ValueError) as error:
        reason = f"{' '.join(str(error).split())}; if the cluster asks for a token, set RAY_AUTH_MODE=token"
        raise EngineError(f"--ray-address: {address} cannot be joined: {reason}") from error
    try:
        task = ray.remote(num_cpus=1, max_retries=0)(run_on_node)
        code, folder = digest_of_code(), os.getcwd()

        def schedule(job: MissionJob) -> Future[MissionRow]:
            return task.remote(job, limits, code, folder).future()

        n_scheduled = n_workers or max(1, int(ray.cluster_resources().get("CPU", 1)))
        run_missions(jobs, n_scheduled, schedule, explain, finish)
    finally:
        ray.shutdown()


def _check_address(address: str) -> None:
    """Check that a server answers at HOST:PORT; Ray itself would keep trying for a quarter of an hour."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    try:
        if host:
            socket.create_connection((host.strip("[]"), int(port)), timeout=10.0).close()
    except (OSError, ValueError):
        raise EngineError(f"--ray-address: must be HOST:PORT or auto, got {address}, where nothing answers") from None


def run_on_node(job: MissionJob, limits: MissionLimits, code: str, folder: str) -> MissionRow:
    """Run one mission in the process that this Ray worker keeps for missions.

    Args:
        job: The mission.
        limits: Limits of the mission.
        code: `digest_of_code` where the sweep was started.
        folder: Working directory there; used here too if it exists, for the user's files.

    Raises:
        EngineError: If the code on this node is different.
    """
    if digest_of_code() != code:
        raise EngineError("it has another version of pdpatrol; install the same on all nodes")
    rows: list[MissionRow] = []
    run_in_pool(_own_pool(limits, folder), [job], 1, limits, rows.append)
    return rows[0]


@cache
def _own_pool(limits: MissionLimits, folder: str) -> ProcessPool:
    if os.path.isdir(folder):
        os.chdir(folder)
    return open_pool(1, limits)
