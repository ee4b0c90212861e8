"""A small fixed sweep of the public suite against the stored one: a change that makes missions worse is noticed."""

import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pdpatrol.envs.scenario.suite import load_suite
from pdpatrol.missions.sweep.dataset import Dataset

ROOT = Path(__file__).parents[3]
STORED = ROOT / "docs" / "results" / "public"
PDPATROL = Path(sys.executable).parent / "pdpatrol"

SEEDS = range(3)
YARDS = tuple(f"{level}_01" for level in load_suite().levels)

FEWER_FOUND, MORE_FALSE, MORE_CONTACTS, LARGER_ERROR = 4, 2, 2, 1.55
"""Bands: so many sources fewer may be found, so many findings more may be false, so many contacts more, and errors may
be so many times as large. Missions are chaotic: by chance alone, one change of the code in a thousand does more."""


def total(rows: Sequence[Mapping[str, Any]], name: str) -> int:
    return sum(row[name] for row in rows)


@pytest.mark.slow
def test_missions_are_no_worse_than_the_stored_ones(tmp_path: Path) -> None:
    names = [f"suite/{yard}" for yard in YARDS]
    seeds = f"{SEEDS[0]}-{SEEDS[-1]}"
    done = subprocess.run(
        [PDPATROL, "sweep", *names, "--seeds", seeds, "--out", "guard"], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    now, before = Dataset(tmp_path / "guard").read().to_pylist(), Dataset(STORED).read().to_pylist()
    assert {row["status"] for row in now} == {"finished"}
    met = {(row["scenario"], row["seed"]): row for row in now}
    before = [row for row in before if (row["scenario"], row["seed"]) in met]
    assert len(before) == len(now) == len(SEEDS) * len(YARDS)
    assert total(now, "n_sources") == total(before, "n_sources")
    ratios = [
        np.mean(np.log(met[row["scenario"], row["seed"]]["errors_m"])) - np.mean(np.log(row["errors_m"]))
        for row in before
        if row["errors_m"] and met[row["scenario"], row["seed"]]["errors_m"]
    ]
    changes = {
        "found": total(now, "n_found") - total(before, "n_found"),
        "false": total(now, "false_findings") - total(before, "false_findings"),
        "contacts": total(now, "contacts") - total(before, "contacts"),
        "error": float(np.exp(np.mean(ratios))),
    }
    assert changes["found"] >= -FEWER_FOUND, changes
    assert changes["false"] <= MORE_FALSE, changes
    assert changes["contacts"] <= MORE_CONTACTS, changes
    assert changes["error"] <= LARGER_ERROR, changes
