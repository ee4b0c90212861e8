"""A sweep on Ray gives the same rows as in local processes, even if a node is killed."""

import os
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest

from pdpatrol.missions.sweep.plan import make_plan
from pdpatrol.missions.sweep.pool import EngineError, MissionLimits
from pdpatrol.missions.sweep.ray_engine import run_on_node
from tests.missions.sweep.test_sweep import needs_ray, rows, sweep
from tests.processes import PDPATROL, below, listening, start_python, title

pytestmark = [pytest.mark.whole, needs_ray]

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


@pytest.mark.slow
def test_missions_of_killed_node_run_again(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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

        def n_rows() -> int:
            return len(list((folder / "robbed" / "rows").glob("*.parquet")))

        wait_for(lambda: n_rows() > 3)
        wait_for(lambda: any(title(pid).startswith("ray::run_on_node") for pid in below(raylet)))
        n_left = N_MISSIONS - n_rows()
        for pid in [raylet, *sorted(below(raylet))]:
            os.kill(pid, signal.SIGKILL)
        printed, warned = sweeping.communicate(timeout=300)
        assert sweeping.returncode == 0, warned
        assert n_left > 2
        assert "raylet" not in printed + warned
    finally:
        cluster.shutdown()
    assert sweep(folder, *words, "whole").returncode == 0
    assert rows(folder / "robbed").equals(rows(folder / "whole"))
    assert rows(folder / "robbed")["status"].to_list() == ["finished"] * N_MISSIONS


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
    code = "import sys; sys.modules['ray'] = None; from pdpatrol.missions.cli import main; main()"
    process = start_python(code, "sweep", "short.toml", "--engine", "ray", "--out", "out", cwd=folder)
    _, errors = process.communicate(timeout=120)
    assert (process.returncode, (folder / "out").exists()) == (2, False)
    assert errors == '--engine ray: needs Ray; install it with: pip install "pdpatrol[ray]"\n'
