"""A machine compiles once, whoever is first, and what is compiled is all that missions need."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from pdpatrol.missions.sweep.engines import compile_once as module

COMPILE = "from pdpatrol.missions.sweep.engines.compile_once import compile_once; compile_once()"
MISSIONS = """
from pdpatrol.envs import load_scenario
from pdpatrol.missions.runner import run_mission
for name in ("suite/cluttered_05", "suite/faulty_01", "suite/interference_01", "suite/wrong_map_01"):
    run_mission(load_scenario(name, {"task.time_limit_s": 90.0}))
"""


def test_only_the_first_one_compiles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    missions: list[str] = []
    monkeypatch.setattr(module, "gettempdir", lambda: str(tmp_path))
    monkeypatch.setattr(module, "run_mission", lambda scenario: missions.append(scenario.name))
    assert not module.is_compiled()
    module.compile_once()
    assert module.is_compiled()
    module.compile_once()
    assert missions == ["two_sources"]


def test_one_that_was_stopped_has_not_compiled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(module, "gettempdir", lambda: str(tmp_path))
    monkeypatch.setattr(module, "run_mission", stop)
    with pytest.raises(KeyboardInterrupt):
        module.compile_once()
    assert not module.is_compiled()


@pytest.mark.slow
def test_two_at_once_leave_a_cache_to_which_missions_add_nothing(tmp_path: Path) -> None:
    cache, marks = tmp_path / "cache", tmp_path / "marks"
    marks.mkdir()
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache), "TMPDIR": str(marks)}
    both = [subprocess.Popen([sys.executable, "-c", COMPILE], env=environment) for _ in range(2)]
    assert [process.wait(timeout=300) for process in both] == [0, 0]
    compiled = {path: path.stat().st_mtime_ns for path in cache.rglob("*.nb?")}
    assert compiled
    subprocess.run([sys.executable, "-c", MISSIONS], env=environment, check=True, timeout=300)
    assert {path: path.stat().st_mtime_ns for path in cache.rglob("*.nb?")} == compiled


def test_what_one_process_has_compiled_no_other_one_compiles_again() -> None:
    script = """
from dirmusic.compiled import watch_compiler
with watch_compiler(lambda _: None) as compiling:
    import gymnasium
    env = gymnasium.make("pdpatrol:PDPatrol-v0", scenario="one_source")
    env.reset(seed=0)
    for _ in range(30):
        env.step(env.action_space.sample() * 0.0)
print(compiling.n_functions)
"""
    counted = [subprocess.run([sys.executable, "-c", script], capture_output=True, text=True) for _ in range(2)]
    assert counted[1].stdout.strip() == "0", counted[1].stderr
