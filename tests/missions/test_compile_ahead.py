"""A second process compiles what a first mission comes to last: the very functions, and it ends with the first."""

import os
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from missions.compile_ahead import second_process

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
AHEAD = "from missions.compile_ahead import compile_ahead; compile_ahead()"
MISSION = """from envs import load_scenario
    from missions.runner import run_mission
    run_mission(load_scenario("one_source", {"task.time_limit_s": 60.0}))"""
SAMPLING, LOCATING = "sensing.receiver.sampling", "dirmusic.locating"


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
    assert any(name.startswith(SAMPLING) for name in ahead)
    assert any(name.startswith(LOCATING) for name in ahead)
    assert not any(name.startswith((SAMPLING, LOCATING)) for name in mission)
    assert len(ahead) > 0.6 * len(mission) > 0


def test_the_second_process_starts_once_and_ends_with_the_block() -> None:
    with second_process() as start:
        assert psutil.Process().children() == []
        start()
        start()
        (child,) = psutil.Process().children()
    assert not child.is_running()


def test_the_second_process_ends_with_the_first_even_if_that_is_killed() -> None:
    script = """
import psutil, time
from missions.compile_ahead import second_process
with second_process() as start:
    start()
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
