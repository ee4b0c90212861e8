"""The tables of README and docs/answers.md are made from the stored sweeps, which can still be read."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.mark.whole
def test_tables_are_those_of_the_stored_rows() -> None:
    done = subprocess.run(
        [sys.executable, "docs/make_answers.py", "--check"], cwd=ROOT, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
