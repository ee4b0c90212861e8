"""A small fixed sweep of the public suite is at least as good as the stored one."""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from pdpatrol.envs.scenario.suite import load_suite
from pdpatrol.missions.sweep.analysis import pair_up
from pdpatrol.missions.sweep.dataset import Dataset
from tests.processes import PDPATROL

ROOT = Path(__file__).parents[3]
BANDS = {"n_found": -4, "false_findings": 2, "touches": 2}
"""Largest change of the totals over 48 missions. By chance, one change of the code in a thousand exceeds these bands or
that of the error. `touches` is 1 for a mission with contacts: a robot whose map lacks a transformer touches its
radiators, which are above the lidar's plane, several times or not at all."""

MAX_ERROR_RATIO = 1.55


@pytest.mark.slow
def test_missions_are_no_worse_than_the_stored_ones(tmp_path: Path) -> None:
    suite = load_suite()
    yards = [f"suite/{level}_01" for level in suite.levels if level not in suite.sites]
    subprocess.run([PDPATROL, "sweep", *yards, "--seeds", "0-2", "--out", "guard"], cwd=tmp_path, check=True)
    rows = Dataset(tmp_path / "guard").read()
    before, now = pair_up(rows, str(ROOT / "docs" / "results" / "public"), str(tmp_path / "guard"))
    assert len(now) == len(rows) == 3 * len(yards)
    for missions in (before, now):
        missions["touches"] = missions["contacts"] > 0
    change = {column: now[column].sum() - before[column].sum() for column in ("n_sources", *BANDS)}
    assert change["n_sources"] == 0
    assert change["n_found"] >= BANDS["n_found"], change
    assert change["false_findings"] <= BANDS["false_findings"], change
    assert change["touches"] <= BANDS["touches"], change
    log_errors = [
        [np.mean(np.log(errors_m)) for errors_m in pair]
        for pair in zip(before["errors_m"], now["errors_m"], strict=True)
        if all(map(len, pair))
    ]
    assert np.exp(np.diff(log_errors).mean()) <= MAX_ERROR_RATIO
