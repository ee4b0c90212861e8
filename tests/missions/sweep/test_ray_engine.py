"""A sweep on Ray gives the same rows as on local processes, also if nodes or workers are killed."""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import psutil
import pytest

from pdpatrol.missions.sweep.plan import make_plan
from pdpatrol.missions.sweep.pool import EngineError, MissionLimits
from pdpatrol.missions.sweep.ray_engine import run_on_node
from tests.missions.sweep.test_sweep import rows, sweep
from tests.processes import PDPATROL, below, listening, title

pytestmark = [
    pytest.mark.whole,
    pytest.mark.skipif(find_spec("ray") is None, reason="the extra `ray` is not installed"),
]

LOOPBACK = {"127.0.0.1", "::ffff:127.0.0.1"}
WAIT_S = 300.0
N_MISSIONS = 30


def command(*words: str, engine: str = "ray") -> list[str]:
    return [PDPATROL, "sweep", "short.toml", "--workers", "2", "--engine", engine, *words]


def wait_for(is_so: Callable[[], object]) -> None:
    deadline = time.monotonic() + WAIT_S
    while not is_so():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def n_rows(folder: Path) -> int:
    return len(list((folder / "rows").glob("*.parquet")))


@pytest.mark.slow
def test_ray_gives_the_rows_of_the_pool(folder: Path) -> None:
    policies = "seek", *(f"own.py:{name}" for name in ("Raises", "Hangs", "Eats", "Dies"))
    words = ["--seeds", "0", "--policy", *policies, "--wall-limit-s", "30", "--memory-gb", "1", "--out"]
    pool, ray = (sweep(folder, *words, name, "--engine", engine) for name, engine in (("one", "pool"), ("two", "ray")))
    assert (pool.returncode, ray.returncode) == (0, 0), ray.stderr
    statuses = ["finished", "failed", "hung", "out of memory", "died"]
    assert rows(folder / "two")["status"].to_pylist() == statuses
    assert rows(folder / "two").equals(rows(folder / "one"))
    printed = [re.sub(r"missions in .*", "", done.stdout) for done in (pool, ray)]  # without the computing time
    assert printed[1].replace("two", "one") == printed[0]
    assert sorted(ray.stderr.split()) == sorted(pool.stderr.split())  # Ray prints nothing


@pytest.mark.slow
@pytest.mark.parametrize("victim", ["node", "worker"])
def test_missions_of_killed_node_or_worker_run_again(
    victim: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER", "0")
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    try:
        node = cluster.add_node(num_cpus=1)
        raylet = node.all_processes["raylet"][0].process.pid
        words = ["--seeds", f"0-{N_MISSIONS - 1}", "--policy", "own.py:Stands", "--out"]
        sweeping = subprocess.Popen(
            command(*words, "robbed", "--ray-address", str(cluster.address)),
            cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip

        def busy() -> list[int]:
            return [pid for pid in below(raylet) if title(pid).startswith("ray::run_on_node")]

        wait_for(lambda: n_rows(folder / "robbed") > 3)
        wait_for(busy)
        n_left = N_MISSIONS - n_rows(folder / "robbed")
        for pid in [raylet, *sorted(below(raylet))] if victim == "node" else busy():
            os.kill(pid, signal.SIGKILL)
        printed, warned = sweeping.communicate(timeout=300)
        assert sweeping.returncode == 0, warned
        assert n_left > 2
        assert "raylet" not in printed + warned
    finally:
        cluster.shutdown()
    assert sweep(folder, *words, "whole").returncode == 0
    assert rows(folder / "robbed").equals(rows(folder / "whole"))
    assert rows(folder / "robbed")["status"].to_pylist() == ["finished"] * N_MISSIONS


@pytest.mark.parametrize("engine", ["pool", pytest.param("ray", marks=pytest.mark.slow)])  # Ray takes a minute to end
def test_killed_command_leaves_no_process_and_listens_locally(engine: str, folder: Path) -> None:
    words = command("--seeds", "0-1", "--policy", "own.py:Hangs", "--out", "out", engine=engine)
    sweeping = subprocess.Popen(words, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        wait_for((folder / "hanging").exists)
        started = below(sweeping.pid)
        assert len(started) > 1
        addresses = listening({sweeping.pid, *started})
        assert addresses <= LOOPBACK
        assert bool(addresses) == (engine == "ray")
    finally:
        sweeping.kill()
        sweeping.wait()
    wait_for(lambda: not any(psutil.pid_exists(pid) for pid in started))


def test_node_with_another_version_is_refused(folder: Path) -> None:
    job = make_plan([str(folder / "short.toml")], ["seek"], {}, [0]).jobs[0]
    with pytest.raises(EngineError, match="another version of pdpatrol"):
        run_on_node(job, MissionLimits(900.0, 2_000_000_000), "other", str(folder))


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("127.0.0.1:1", "--ray-address: must be HOST:PORT or auto, got 127.0.0.1:1, where nothing answers"),
        ("nowhere", "--ray-address: nowhere cannot be joined: Invalid address format: nowhere"),
    ],
)
def test_address_without_cluster_is_one_line(address: str, message: str, folder: Path) -> None:
    done = sweep(folder, "--engine", "ray", "--seeds", "0", "--ray-address", address, "--out", "out")
    assert (done.returncode, done.stdout) == (1, "")
    (line,) = done.stderr.strip().splitlines()
    assert line.startswith(message)


def test_without_ray_its_engine_is_refused(folder: Path) -> None:
    lines = "import sys; sys.modules['ray'] = None; from pdpatrol.missions.cli import main; main()"
    words = [sys.executable, "-c", lines, *command("--out", "out")[1:]]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=120)
    assert (done.returncode, (folder / "out").exists()) == (2, False)
    assert done.stderr == '--engine ray: needs Ray; install it with: pip install "pdpatrol[ray]"\n'
