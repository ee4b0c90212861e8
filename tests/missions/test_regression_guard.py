"""A small fixed sweep of the public suite against the stored one: a change that makes missions worse is noticed."""

import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from envs.scenario.suite import load_suite
from missions.sweep.dataset import Dataset

ROOT = Path(__file__).parents[2]
STORED = ROOT / "docs" / "results" / "public"
PDPATROL = Path(sys.executable).parent / "pdpatrol"

SEEDS = "0-1"
YARDS = tuple(f"{level}_01" for level in load_suite().levels)

FEWER_FOUND, MORE_FALSE, MORE_CONTACTS, LARGER_ERROR = 2, 1, 1, 1.25
"""Bands: so many sources fewer may be found, so many findings more may be false, so many contacts more, and the median
error may be so many times as large."""


def totals(rows: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    names = "n_sources", "n_found", "false_findings", "contacts"
    return {name: sum(row[name] for row in rows) for name in names} | {
        "error_m": float(np.median([error for row in rows for error in row["errors_m"]]))
    }


@pytest.mark.slow
def test_missions_are_no_worse_than_the_stored_ones(tmp_path: Path) -> None:
    names = [f"suite/{yard}" for yard in YARDS]
    done = subprocess.run(
        [PDPATROL, "sweep", *names, "--seeds", SEEDS, "--out", "guard"], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    rows = Dataset(tmp_path / "guard").read().to_pylist()
    assert {row["status"] for row in rows} == {"finished"}
    met = {(row["scenario"], row["seed"]) for row in rows}
    stored = [row for row in Dataset(STORED).read().to_pylist() if (row["scenario"], row["seed"]) in met]
    assert len(stored) == len(rows) == 2 * len(YARDS)
    now, before = totals(rows), totals(stored)
    assert now["n_sources"] == before["n_sources"]
    assert now["n_found"] >= before["n_found"] - FEWER_FOUND
    assert now["false_findings"] <= before["false_findings"] + MORE_FALSE
    assert now["contacts"] <= before["contacts"] + MORE_CONTACTS
    assert now["error_m"] <= before["error_m"] * LARGER_ERROR
