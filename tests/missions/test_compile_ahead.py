"""A second process compiles what a first mission comes to last: the very functions, and it ends with the first."""

import os
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from pdpatrol.missions import second_process
from pdpatrol.missions.second_process import SecondProcess, nothing_is_kept

COMPILED = """
from numba.core import event
compiled = []
class Listener(event.Listener):
    def on_start(self, event):
        compiled.append(str(event.data["dispatcher"].py_func.__module__))
    def on_end(self, event):
        pass
with event.install_listener("numba:compile", Listener()):
    {}
print(*compiled)
"""
AHEAD = "from pdpatrol.missions.compile_ahead import compile_ahead; compile_ahead()"
MISSION = """from pdpatrol.envs import load_scenario
    from pdpatrol.missions.runner import run_mission
    run_mission(load_scenario("one_source", {"task.time_limit_s": 60.0}))"""
ALL_AHEAD = ("pdpatrol.sensing.receiver.sampling", "pdpatrol.sensing.radio.diffraction", "dirmusic.locating")
"""Where all that a mission compiles is compiled ahead."""


@pytest.mark.slow
def test_what_is_compiled_ahead_is_what_a_mission_needs(tmp_path: Path) -> None:
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    compiled = [
        subprocess.run(
            [sys.executable, "-c", COMPILED.format(script)], env=environment, capture_output=True, text=True, check=True
        ).stdout.split()
        for script in (AHEAD, MISSION)
    ]
    ahead, mission = compiled
    for package in ALL_AHEAD:
        assert any(name.startswith(package) for name in ahead)
    assert not any(name.startswith(ALL_AHEAD) for name in mission)
    assert len(ahead) > 0.6 * len(mission) > 0


def keep_something(folder: Path) -> None:
    (folder / "of_a_package").mkdir(parents=True)
    (folder / "of_a_package" / "module.function-1.py311.nbi").touch()


def test_the_second_process_starts_once_when_told_and_ends_with_the_block(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    keep_something(tmp_path)
    with SecondProcess() as second:
        assert psutil.Process().children() == []
        second.start()
        second.start()
        (child,) = psutil.Process().children()
    assert not child.is_running()


def test_the_second_process_starts_at_once_where_nothing_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "not_there_yet"))
    with SecondProcess() as second:
        (child,) = psutil.Process().children()
        second.start()
        assert psutil.Process().children() == [child]
    assert not child.is_running()


@pytest.mark.parametrize("is_told", [True, False])
def test_what_is_kept_is_seen(is_told: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = tmp_path / "told" if is_told else tmp_path / "package" / "__pycache__"
    monkeypatch.setattr(second_process, "PACKAGE", tmp_path / "package")
    (tmp_path / "package").mkdir()
    if is_told:
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(kept))
    else:
        monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    assert nothing_is_kept()
    keep_something(kept)
    assert not nothing_is_kept()


def test_where_nothing_can_be_kept_nothing_is_compiled_ahead(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(second_process, "PACKAGE", tmp_path / "denied")
    assert not nothing_is_kept()


def test_the_second_process_ends_with_the_first_even_if_that_is_killed() -> None:
    script = """
import psutil, time
from pdpatrol.missions.second_process import SecondProcess
with SecondProcess() as second:
    second.start()
    print(psutil.Process().children()[0].pid, flush=True)
    time.sleep(600.0)
"""
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True) as first:
        assert first.stdout is not None
        second = psutil.Process(int(first.stdout.readline()))
        first.kill()
    for _ in range(300):
        if not second.is_running():
            break
        time.sleep(0.1)
    assert not second.is_running()
