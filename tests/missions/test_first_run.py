"""Missions without compilation, and compilation at the first run."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from pdpatrol.envs import load_scenario
from pdpatrol.missions.first_run import TIME_LIMIT_S
from pdpatrol.missions.runner import run_mission

MISSION = """
import sys
from pdpatrol.envs import load_scenario
from pdpatrol.missions.runner import run_mission
log = run_mission(load_scenario(sys.argv[1], {"task.time_limit_s": float(sys.argv[2])}))
print(log.n_rows("step"), log.n_rows("pulse"), log.column("pulse", "strengths_v").sum())
"""


@pytest.mark.whole
def test_mission_runs_without_compilation() -> None:
    """The Python functions detect the same pulses as the compiled ones, with the same strengths."""
    log = run_mission(load_scenario("two_sources", {"task.time_limit_s": 4.0}))
    assert log.n_rows("pulse")
    done = subprocess.run(
        [sys.executable, "-c", MISSION, "two_sources", "4"],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    expected = log.n_rows("step"), log.n_rows("pulse"), log.column("pulse", "strengths_v").sum()
    assert [float(value) for value in done.stdout.split()] == pytest.approx(expected, rel=1e-9)


@pytest.mark.slow
def test_mission_at_first_run_compiles_what_others_need(tmp_path: Path) -> None:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    environment["XDG_CACHE_HOME"] = str(tmp_path)

    def files(scenario: str, time_s: float) -> set[Path]:
        subprocess.run([sys.executable, "-c", MISSION, scenario, str(time_s)], env=environment, check=True)
        return set(tmp_path.rglob("*.nb?"))

    kept = files("two_sources", TIME_LIMIT_S)
    assert kept
    for scenario in ("transformer_bay", "gis_hall", "paper_field"):
        new = files(scenario, 120.0) - kept
        assert len(new) <= 4, new  # kernels for rare cases such as a fault
