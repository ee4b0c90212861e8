"""Missions side by side on a Ray cluster: each is a task that Ray gives to a node, and runs again if the node is lost.

A Ray worker keeps one process for missions, with the code that runs them on a single machine: what hangs, dies or eats
its memory is the same row here as there, and never harms Ray's own threads.
"""

from __future__ import annotations

import logging
import os
import socket
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from functools import cache

from pebble import ProcessPool

from pdpatrol.missions.sweep.code_version import digest_of_code
from pdpatrol.missions.sweep.engines.engine import ATTEMPTS, EngineError, Limits, Loss, run_missions
from pdpatrol.missions.sweep.engines.process_pool import open_pool, run_in_pool
from pdpatrol.missions.sweep.mission_row import MissionRow
from pdpatrol.missions.sweep.plan import MissionJob

OBJECT_STORE_BYTES = 100_000_000
"""Of a Ray that is started here: missions and rows are kilobytes, and pass it by."""

SETTINGS = {
    "RAY_DEDUP_LOGS_SKIP_REGEX": ".",  # prints nothing of its logs: `log_to_driver` lets errors of nodes through
    "RAY_ENABLE_UV_RUN_RUNTIME_ENV": "0",  # does not copy the working directory to each worker if uv runs the command
}
"""What Ray reads from the environment when it is imported, unless the user has set it."""

ALONE = {"RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0"}
"""Ray's own switch for machines that are part of no cluster: all its servers listen on 127.0.0.1 alone."""

CONNECT_S = 10.0
"""Longest wait for an answer from the address of a cluster (assumed)."""


def run_in_ray(
    jobs: Sequence[MissionJob],
    n_workers: int | None,
    limits: Limits,
    finish: Callable[[MissionRow], None],
    *,
    address: str | None = None,
) -> None:
    """Run missions on a Ray cluster, and hand over each row when it is there.

    Args:
        jobs: The missions.
        n_workers: Most missions side by side; None for as many as the cluster has cores.
        limits: Of each mission.
        finish: Called with each row, in the order in which they are finished.
        address: Of the cluster: HOST:PORT, or auto for the one that this machine is a node of. Default: the environment
            variable `RAY_ADDRESS`; without it, Ray is started on this machine and ended with the missions.

    Raises:
        EngineError: If the cluster cannot be joined, or one of its nodes cannot run this code.
    """
    with _ray(address, n_workers):
        import ray

        run = ray.remote(num_cpus=1, max_retries=0)(run_on_node)
        code, folder = digest_of_code(), os.getcwd()

        def schedule(job: MissionJob) -> Future[MissionRow]:
            return run.remote(job, limits, code, folder).future()

        n_scheduled = n_workers or max(1, int(ray.cluster_resources().get("CPU", 1)))
        run_missions(jobs, n_scheduled, schedule, _explain, finish)


def run_on_node(job: MissionJob, limits: Limits, code: str, folder: str) -> MissionRow:
    """Run one mission, in the process that this Ray worker keeps for missions.

    Args:
        job: The mission.
        limits: Of it.
        code: `digest_of_code` where the sweep was started.
        folder: Working directory there; used here too if there is one, for the user's own files.

    Raises:
        EngineError: If this node has other code.
    """
    if digest_of_code() != code:
        raise EngineError("it has other code of pdpatrol; install the same on all nodes")
    rows: list[MissionRow] = []
    run_in_pool(_own_pool(limits, folder), [job], 1, limits, rows.append)
    return rows[0]


@cache
def _own_pool(limits: Limits, folder: str) -> ProcessPool:
    if os.path.isdir(folder):
        os.chdir(folder)
    return open_pool(1, limits)


@contextmanager
def _ray(address: str | None, n_workers: int | None) -> Iterator[None]:
    """A connection to Ray; at its end, a Ray that was started for it ends too."""
    address = address or os.environ.get("RAY_ADDRESS") or "local"
    started = {}
    if address == "local":
        os.environ.update(ALONE)
        started = {"num_cpus": n_workers, "include_dashboard": False, "object_store_memory": OBJECT_STORE_BYTES}
    os.environ.update(SETTINGS | os.environ)
    import ray

    host, _, port = address.removeprefix("ray://").rpartition(":")
    try:
        if host:  # Ray would try for a quarter of an hour
            socket.create_connection((host.strip("[]"), int(port)), CONNECT_S).close()
    except (OSError, ValueError):
        raise EngineError(
            f"--ray-address: got {address}, where nothing answers; allowed is HOST:PORT or auto"
        ) from None
    try:
        ray.init(address, log_to_driver=False, logging_level=logging.CRITICAL, **started)
    except (OSError, RuntimeError, ValueError) as error:
        fault = f"{' '.join(str(error).split())}; if the cluster asks for a token, set RAY_AUTH_MODE=token"
        raise EngineError(f"--ray-address: {address} cannot be joined: {fault}") from error
    try:
        yield
    finally:
        ray.shutdown()


def _explain(error: Exception) -> Loss:
    from ray.exceptions import NodeDiedError, OutOfMemoryError, RayTaskError, WorkerCrashedError

    if isinstance(error, NodeDiedError):
        return Loss("died", str(error), 0)
    if isinstance(error, (WorkerCrashedError, OutOfMemoryError)):
        return Loss("died", f"its Ray worker ended {ATTEMPTS} times: {error}")
    cause = str(error.cause if isinstance(error, RayTaskError) else error).partition("\n")[0]
    raise EngineError(f"--engine ray: a node cannot run missions: {cause}") from error
