"""A sweep loses no row, and its rows do not depend on how it is run."""

import json
import os
import random
import signal
import subprocess
import time
from importlib.util import find_spec
from pathlib import Path

import pytest
from pandas.testing import assert_frame_equal

from pdpatrol.missions.sweep.dataset import Dataset, Frame, MissionRow
from pdpatrol.missions.sweep.plan import make_plan
from pdpatrol.missions.sweep.pool import ATTEMPTS, run_job
from tests.missions.conftest import Refused
from tests.processes import PDPATROL, pdpatrol, run_on_full_disk

pytestmark = pytest.mark.whole


def sweep(folder: Path, *words: str, workers: int = 2) -> subprocess.CompletedProcess[str]:
    return pdpatrol("sweep", "short.toml", "--workers", workers, *words, cwd=folder)


def rows(folder: Path) -> Frame:
    """Return the columns that do not differ between two runs."""
    return Dataset(folder).read().drop(columns=["wall_time_s", "peak_memory_mb"])


def test_rows_do_not_depend_on_workers_or_shards(folder: Path) -> None:
    words = "--seeds", "0-1", "--policy", "seek", "patrol"
    done = sweep(folder, *words, "--out", "two", workers=2)
    assert done.returncode == 0, done.stderr
    for shard in ("2/2", "1/2"):
        assert sweep(folder, *words, "--out", "parts", "--shard", shard, workers=1).returncode == 0
    assert rows(folder / "two")["status"].to_list() == ["finished"] * 4
    assert_frame_equal(rows(folder / "parts"), rows(folder / "two"))
    assert sorted(path.name for path in (folder / "parts").rglob("*.parquet")) == ["rows.parquet", "scenarios.parquet"]
    table = pdpatrol("results", "two", "--csv", cwd=folder)
    assert table.stdout.splitlines()[1].startswith("short,seek,{},2,0,")


needs_ray = pytest.mark.skipif(find_spec("ray") is None, reason="the extra `ray` is not installed")


@pytest.mark.parametrize(
    ("engine", "n_missions", "n_kills"),
    [
        ("pool", 6, 1),
        pytest.param("pool", 100, 20, marks=pytest.mark.slow),
        pytest.param("ray", 100, 20, marks=[pytest.mark.slow, needs_ray]),
    ],
)
def test_killed_sweep_continues_to_the_same_rows(engine: str, n_missions: int, n_kills: int, folder: Path) -> None:
    words = ["--seeds", f"0-{n_missions - 1}", "--engine", engine, "--out"]
    rng = random.Random(0)
    for kill in range(n_kills):
        process = subprocess.Popen(
            [PDPATROL, "sweep", "short.toml", "--workers", "2", *words, "killed"],
            cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
        )  # fmt: skip
        wanted = n_missions * (kill + 1) // (n_kills + 4)  # so that some remain at the last kill
        while len(list((folder / "killed" / "rows").glob("*.parquet"))) < wanted and process.poll() is None:
            time.sleep(0.01)
        time.sleep(rng.uniform(0.0, 0.5))
        assert process.poll() is None
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    assert 0 < len(rows(folder / "killed")) < n_missions
    assert sweep(folder, *words, "killed").returncode == 0
    assert sweep(folder, "--seeds", f"0-{n_missions - 1}", "--out", "whole").returncode == 0
    assert_frame_equal(rows(folder / "killed"), rows(folder / "whole"))
    assert len(rows(folder / "killed")) == n_missions


@pytest.mark.parametrize("engine", ["pool", pytest.param("ray", marks=[pytest.mark.slow, needs_ray])])
def test_mission_that_fails_hangs_or_dies_is_a_row(engine: str, folder: Path) -> None:
    """Ray gives the same rows and the same output as the pool."""
    policies = [f"own.py:{name}" for name in ("Stands", "Raises", "Hangs", "Eats", "Dies")]
    limits = "--wall-limit-s", "30" if engine == "ray" else "10", "--memory-gb", "1"
    words = ["--seeds", "0", "--policy", *policies, *limits]
    done = sweep(folder, *words, "--out", "out")
    assert done.returncode == 0, done.stderr
    table = rows(folder / "out").to_dict("records")
    assert [row["status"] for row in table] == ["finished", "failed", "hung", "out of memory", "died"]
    assert table[0]["error"] == ""
    assert "own.py:9: RuntimeError: out of ideas" in table[1]["error"]
    assert f"took longer than the limit of {limits[1]} s" in table[2]["error"]
    assert "exit code 7" in table[4]["error"]
    assert (folder / "deaths").read_text().split() == ["died"] * ATTEMPTS
    if engine == "ray":
        ray = sweep(folder, *words, "--out", "ray", "--engine", "ray")
        assert_frame_equal(rows(folder / "ray"), rows(folder / "out"))
        assert sorted(ray.stderr.split()) == sorted(done.stderr.split())  # Ray prints nothing


def begun(folder: Path, n_missions: int, n_rows: int) -> Dataset:
    """Begin the dataset of a sweep, with rows of failed missions."""
    plan = make_plan([str(folder / "short.toml")], ["seek"], {}, range(n_missions))
    dataset = Dataset.open_or_make(folder / "out", plan)
    for job in plan.jobs[:n_rows]:
        dataset.write(MissionRow.of_failure(job, "failed", "for a test"))
    return dataset


def test_full_disk_is_reported_and_loses_no_row(folder: Path) -> None:
    begun(folder, 2, 1)
    kept = rows(folder / "out")
    words = [PDPATROL, "sweep", "short.toml", "--workers", "1", "--seeds", "0-1", "--out", "out"]
    done = run_on_full_disk(words, 2000, folder)
    assert done.returncode == 1
    assert "a row could not be written" in done.stderr
    assert "Traceback" not in done.stderr
    assert_frame_equal(rows(folder / "out"), kept)
    assert [path.name for path in (folder / "out").rglob("*.tmp")] == []


def test_crash_during_compaction_duplicates_no_row(folder: Path) -> None:
    dataset = begun(folder, 3, 3)
    before = dataset.read()
    single = {path: path.read_bytes() for path in (folder / "out" / "rows").iterdir()}
    dataset.compact()
    for path, content in list(single.items())[:2]:  # as if they had not been removed yet
        path.write_bytes(content)
    (folder / "out" / "rows" / ".x.parquet.tmp").write_bytes(b"half a row")
    assert_frame_equal(dataset.read(), before)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--seeds", "3-1"], "--seeds: must be one seed, or the first and the last such as 0-19, got 3-1"),
        (["--shard", "3/2"], "--shard: must be 1/N to N/N, got 3/2"),
        (["--set", "receiver.noise_v=-1"], "short.toml: receiver.noise_v: must be"),
        (["--policy", "own.py:None_"], "own.py: must define `None_`"),
        (["--out", "own.py"], "--out: must be a new or empty folder"),
        (["--out", "/proc/none"], "--out: must be a folder that can be written, got /proc/none"),
    ],
)
def test_invalid_input_is_one_line_and_writes_nothing(
    words: list[str], message: str, folder: Path, refused: Refused
) -> None:
    before = sorted(folder.rglob("*"))
    (line,) = refused("sweep", "short.toml", *words, cwd=folder)
    assert line.startswith(message)
    assert [path for path in sorted(folder.rglob("*")) if "__pycache__" not in str(path)] == before


def test_options_out_of_range_are_one_line_each(folder: Path, refused: Refused) -> None:
    lines = refused("sweep", "--workers", "0", "--wall-limit-s", "0", "--policy", cwd=folder)
    assert {line.partition(", got")[0] for line in lines} == {
        "--workers: must be greater than 0",
        "--wall-limit-s: must be greater than 0",
        "--policy: must have at least 1 item after validation, not 0",
    }


def test_dataset_of_another_plan_or_version_is_refused(folder: Path, refused: Refused) -> None:
    begun(folder, 1, 1)
    before = rows(folder / "out")
    (line,) = refused("sweep", "short.toml", "--seeds", "1", "--out", "out", cwd=folder)
    assert "out has other missions" in line
    manifest = folder / "out" / "sweep.json"
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | {"code": "another"}))
    (line,) = refused("sweep", "short.toml", "--seeds", "0", "--out", "out", cwd=folder)
    assert "out was begun by another version of the code" in line
    assert_frame_equal(rows(folder / "out"), before)
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | {"version": 1}))
    (line,) = refused("results", "out", cwd=folder)
    assert line == "out: must be of format 2, got 1, whose scores differ; run its sweep again"
    (line,) = refused("results", "own.py", cwd=folder)
    assert "own.py: must be the folder of a sweep" in line


def test_mission_run_again_gives_the_same_row(folder: Path, refused: Refused) -> None:
    plan = make_plan([str(folder / "short.toml")], ["seek"], {"receiver.noise_v": [1e-3, 2e-3]}, range(2))
    dataset = Dataset.open_or_make(folder / "out", plan)
    dataset.write(run_job(plan.jobs[3]))
    before = rows(folder / "out")
    assert (before["seed"][0], json.loads(before["settings"][0])) == (1, {"receiver.noise_v": 2e-3})
    dataset.write(run_job(dataset.job(3)))
    assert_frame_equal(rows(folder / "out"), before)
    (line,) = refused("replay", "out", "--row", "9", cwd=folder)
    assert line == "--row: must be the number of a row, 0 to 3, got 9"
