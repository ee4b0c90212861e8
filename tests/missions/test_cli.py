"""The command line as a user meets it: real processes, real files."""

import json
import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.report_file import read_report
from tests.processes import assert_times_add_up

pytestmark = pytest.mark.whole

PDPATROL = str(Path(sys.executable).with_name("pdpatrol"))
HEAVY = ("mujoco", "rerun", "scipy.signal", "scipy.optimize", "matplotlib")


def pdpatrol(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([PDPATROL, *arguments], cwd=cwd, capture_output=True, text=True, timeout=120)


def refused(done: subprocess.CompletedProcess[str]) -> list[str]:
    assert done.returncode == 2, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""
    return done.stderr.strip().splitlines()


@pytest.fixture
def short(tmp_path: Path) -> Path:
    """A scenario that lasts four seconds."""
    from pdpatrol.envs.scenario import SHIPPED

    text = (SHIPPED / "one_source.toml").read_text(encoding="utf-8")
    path = tmp_path / "short.toml"
    path.write_text(text + "\n[task]\ntime_limit_s = 4.0\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "arguments",
    [["--help"], ["run", "--help"], ["replay", "--help"], ["scenarios", "--help"],
     ["reproduce", "--help"], ["locate", "--help"], ["report", "--help"]],
)  # fmt: skip
def test_every_verb_has_help(arguments: list[str], tmp_path: Path) -> None:
    done = pdpatrol(*arguments, cwd=tmp_path)
    assert done.returncode == 0
    assert "usage: pdpatrol" in done.stdout


@pytest.mark.parametrize(
    "arguments",
    [["--help"], ["run", "--help"], ["run", "nowhere"], ["run", "bad.toml"], ["scenarios", "bad.toml"], ["scenarios"],
     ["reproduce", "--help"], ["reproduce", "--trials", "5"], ["reproduce", "--out", "."], ["locate", "--help"],
     ["locate", "none.csv"], ["locate", "bad.toml"],
     ["run", "--seed", "-1"], ["run", "--out", "."], ["run", "--policy", "magic"],
     ["run", "--policy", "none.py:MyPolicy"], ["replay", "nowhere"],
     ["report", "nowhere"]],
)  # fmt: skip
def test_help_and_refusals_load_nothing_heavy(arguments: list[str], tmp_path: Path) -> None:
    (tmp_path / "bad.toml").write_text("[yard]\nsize_m = 3\n", encoding="utf-8")
    code = (
        "import sys\nfrom missions.cli import main\n"
        f"sys.argv = ['pdpatrol', *{arguments!r}]\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        f"loaded = [name for name in {HEAVY!r} if name in sys.modules]\n"
        "assert not loaded, loaded\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr


def test_a_run_writes_log_report_and_recording_and_prints_what_was_found(short: Path, tmp_path: Path) -> None:
    done = pdpatrol("run", str(short), "--seed", "3", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "runs" / "short-3"
    assert {path.name for path in folder.iterdir()} == {"log.npz", "report.json", "report.html", "mission.rrd"}
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    assert (report["scenario"], report["seed"], report["policy"]) == ("short", 3, "seek")
    assert f"No discharge found. {report['pulses']['detected']} pulses: " in done.stdout
    assert "time limit after 4 s" in done.stdout


def test_what_is_to_be_typed_next_works_as_it_is_printed(short: Path, tmp_path: Path) -> None:
    for by_uv, start in (({}, "pdpatrol"), ({"UV_RUN_RECURSION_DEPTH": "1"}, "uv run pdpatrol")):
        folder = "a folder" + "2" * len(by_uv)
        environment = {key: value for key, value in os.environ.items() if key != "UV_RUN_RECURSION_DEPTH"} | by_uv
        arguments = [PDPATROL, "run", str(short), "--out", folder]
        done = subprocess.run(arguments, cwd=tmp_path, capture_output=True, text=True, env=environment, check=True)
        (hint,) = [line for line in done.stdout.splitlines() if line.startswith("Look at it with: ")]
        assert shlex.split(hint.partition(": ")[2]) == [*start.split(), "replay", folder]


def test_json_prints_the_report_and_nothing_else(short: Path, tmp_path: Path) -> None:
    done = pdpatrol("run", str(short), "--json", "--timing", "--out", "here", cwd=tmp_path)
    written = json.loads((tmp_path / "here" / "report.json").read_text(encoding="utf-8"))
    assert json.loads(done.stdout) == written
    assert_times_add_up(done.stderr, "policy", "environment", "locating", "log, report and recording")


def test_two_runs_of_one_seed_differ_in_wall_time_alone(short: Path, tmp_path: Path) -> None:
    for out in ("a", "b"):
        assert pdpatrol("run", str(short), "--seed", "9", "--out", out, cwd=tmp_path).returncode == 0
    reports = [json.loads((tmp_path / out / "report.json").read_text(encoding="utf-8")) for out in ("a", "b")]
    for report in reports:
        report.pop("wall_time_s")
    assert reports[0] == reports[1]
    with np.load(tmp_path / "a" / "log.npz") as first, np.load(tmp_path / "b" / "log.npz") as second:
        assert first.files == second.files
        assert all(first[name].tobytes() == second[name].tobytes() for name in first.files)


def test_a_default_folder_is_never_written_twice(short: Path, tmp_path: Path) -> None:
    for name in ("short-0", "short-0-2", "short-0-3"):
        assert pdpatrol("run", str(short), cwd=tmp_path).returncode == 0
        assert (tmp_path / "runs" / name / "report.json").exists()


def test_a_given_folder_that_holds_something_is_refused_and_left_alone(short: Path, tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("keep", encoding="utf-8")
    (line,) = refused(pdpatrol("run", str(short), "--out", "mine", cwd=tmp_path))
    assert "not empty" in line
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["notes.txt"]
    (line,) = refused(pdpatrol("run", str(short), "--out", str(short), cwd=tmp_path))
    assert "is a file" in line


def test_a_folder_that_cannot_be_made_is_refused(short: Path, tmp_path: Path) -> None:
    (line,) = refused(pdpatrol("run", str(short), "--out", f"{short}/below", cwd=tmp_path))
    assert line.startswith("--out: ")


def test_a_log_that_is_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "log.npz").write_bytes(b"PK\x03\x04 not a log")
    for verb in ("replay", "report"):
        (line,) = refused(pdpatrol(verb, ".", cwd=tmp_path))
        assert "is not the log of a mission" in line
    assert [path.name for path in tmp_path.iterdir()] == ["log.npz"]


def test_a_faulty_scenario_is_refused_line_by_line_and_nothing_is_written(short: Path, tmp_path: Path) -> None:
    text = short.read_text(encoding="utf-8").replace("gain_error = 0.05", "gain_error = -0.05\ncolour = 1")
    short.write_text(text, encoding="utf-8")
    for verb in ("run", "scenarios"):
        lines = refused(pdpatrol(verb, "short.toml", cwd=tmp_path))
        assert len(lines) == 2
        assert all(line.startswith("short.toml: array.") for line in lines)
    assert [path.name for path in tmp_path.iterdir()] == ["short.toml"]


def test_a_good_file_is_said_to_have_no_fault(short: Path, tmp_path: Path) -> None:
    done = pdpatrol("scenarios", "short.toml", cwd=tmp_path)
    assert done.returncode == 0
    assert "no fault" in done.stdout


def test_what_is_hardly_meant_is_noted_and_the_mission_goes_on(short: Path, tmp_path: Path) -> None:
    text = short.read_text(encoding="utf-8").replace("gain_error = 0.05", "gain_error = 0.9")
    short.write_text(text, encoding="utf-8")
    for arguments in (["scenarios", "short.toml"], ["run", "short.toml"]):
        done = pdpatrol(*arguments, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        (note,) = [line for line in done.stderr.splitlines() if line.startswith("note: ")]
        assert note.startswith("note: array: with gain_error 0.9")


def test_scenarios_are_listed_as_json_too(tmp_path: Path) -> None:
    listed = json.loads(pdpatrol("scenarios", "--json", cwd=tmp_path).stdout)
    assert {"one_source", "two_sources", "quiet_yard"} <= listed.keys()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_ctrl_c_leaves_a_valid_partial_log_report_and_recording(number: signal.Signals, tmp_path: Path) -> None:
    process = subprocess.Popen(
        [PDPATROL, "run", "one_source", "--out", "cut"], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    parts = tmp_path / "cut" / "log.parts"
    deadline = time.monotonic() + 60
    while not (parts.exists() and list(parts.glob("*.npz"))) and time.monotonic() < deadline:
        time.sleep(0.02)
    process.send_signal(number)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 128 + number, errors
    assert b"Traceback" not in errors
    log = MissionLog.load(tmp_path / "cut")
    assert log.column("event", "subject")[-1] == "interrupted"
    assert {path.name for path in (tmp_path / "cut").iterdir()} == {
        "log.npz",
        "report.json",
        "report.html",
        "mission.rrd",
    }
    json.loads((tmp_path / "cut" / "report.json").read_text(encoding="utf-8"))
    verify = [sys.executable, "-m", "rerun", "rrd", "verify", str(tmp_path / "cut" / "mission.rrd")]
    assert subprocess.run(verify, capture_output=True, timeout=60).returncode == 0


def test_a_killed_mission_keeps_its_parts_and_a_folder_without_any_is_refused(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [PDPATROL, "run", "one_source", "--out", "cut"], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    parts = tmp_path / "cut" / "log.parts"
    deadline = time.monotonic() + 60
    while not (parts.exists() and list(parts.glob("*.npz"))) and time.monotonic() < deadline:
        time.sleep(0.02)
    process.kill()
    process.communicate(timeout=60)
    assert MissionLog.load(tmp_path / "cut").n_rows("step") >= 300
    done = pdpatrol("report", "cut", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert read_report((tmp_path / "cut" / "report.json").read_text(encoding="utf-8")).ending is None
    assert "cut off without warning" in (tmp_path / "cut" / "report.html").read_text(encoding="utf-8")
    (tmp_path / "empty").mkdir()
    (line,) = refused(pdpatrol("replay", "empty", cwd=tmp_path))
    assert "holds no log.npz" in line


def test_reproduce_writes_numbers_and_pictures_and_refuses_what_is_no_number_of_trials(tmp_path: Path) -> None:
    done = pdpatrol("reproduce", "--trials", "100", "--seed", "4", "--json", "--timing", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert_times_add_up(done.stderr, "trials", "pictures and page")
    folder = tmp_path / "runs" / "reproduction-4"
    data = json.loads((folder / "reproduction.json").read_text())
    assert json.loads(done.stdout) == data
    assert (data["trials"], data["seed"]) == (100, 4)
    assert len(list(folder.glob("*.png"))) == 12
    told = refused(pdpatrol("reproduce", "--trials", "99", "--seed", "-1", cwd=tmp_path))
    assert told == [
        "--trials: got 99; allowed is 100 to 1000000",
        "--seed: got -1; allowed is 0 or more",
    ]
    assert refused(pdpatrol("reproduce", "--out", str(folder), cwd=tmp_path))
