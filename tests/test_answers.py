"""What README and docs/answers.md show is what the stored sweeps came to, and the commands beside it made them."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from pdpatrol.envs.scenario.suite import load_suite
from pdpatrol.missions.sweep.dataset import Dataset

ROOT = Path(__file__).parents[1]
STORED = ROOT / "docs" / "results"
MOST_BYTES = 5_000_000


def stored() -> list[Path]:
    return sorted(folder for folder in STORED.iterdir() if folder.is_dir())


def test_tables_are_those_of_the_stored_rows() -> None:
    done = subprocess.run(
        [sys.executable, "docs/make_answers.py", "--check"], cwd=ROOT, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr


def test_each_dataset_was_made_by_a_command_that_is_shown() -> None:
    shown = "".join((ROOT / name).read_text(encoding="utf-8") for name in ("README.md", "docs/answers.md"))
    blocks = "\n".join(re.findall(r"```sh\n(.*?)```", shown, flags=re.DOTALL)).replace("\\\n", " ")
    commands = [shlex.split(text) for text in re.findall(r"pdpatrol (sweep (?:[^\n']|'[^']*')*)", blocks)]
    for folder in stored():
        assert Dataset(folder).manifest["command"] in commands, folder.name


@pytest.mark.parametrize("folder", stored(), ids=lambda folder: folder.name)
def test_stored_sweeps_are_whole_of_this_suite_and_small(folder: Path) -> None:
    dataset = Dataset(folder)
    assert dataset.is_complete
    assert dataset.manifest["suite"].split(":")[0] == str(load_suite().version)
    assert not dataset.manifest["commit"].endswith("+")
    assert set(dataset.read()["status"].to_pylist()) == {"finished"}
    assert sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) < MOST_BYTES


def test_the_public_suite_is_a_thousand_missions_of_seek() -> None:
    rows = Dataset(STORED / "public").read()
    assert rows.num_rows == 1000
    assert set(rows["policy"].to_pylist()) == {"seek"}
