"""Tests of the command line as users run it, with real processes and files."""

import json
import signal
import subprocess
import sys
import time
from importlib.metadata import version
from pathlib import Path

import pytest

from pdpatrol.missions.cli import COMMANDS
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.records import Report
from tests.envs.helpers import write_yard
from tests.missions.conftest import Refused, call
from tests.processes import PDPATROL, assert_times_add_up, pdpatrol, refusal

pytestmark = pytest.mark.whole

HEAVY = ("mujoco", "numba", "rerun", "rich", "scipy", "tyro")


@pytest.fixture
def short(tmp_path: Path) -> Path:
    """Write a scenario that ends after four seconds, and return its path."""
    return write_yard(tmp_path, "[task]\ntime_limit_s = 4.0", to="short")


def test_help_lists_the_commands(tmp_path: Path) -> None:
    done = pdpatrol("--help", cwd=tmp_path)
    assert done.returncode == 0
    assert "usage: pdpatrol COMMAND" in done.stdout
    assert all(f"\n  {command} " in done.stdout for command in COMMANDS)


def test_version_is_that_of_the_package(tmp_path: Path) -> None:
    assert pdpatrol("--version", cwd=tmp_path).stdout == f"pdpatrol {version('pdpatrol')}\n"


def test_unknown_verb_is_refused_with_a_suggestion(tmp_path: Path) -> None:
    (line,) = refusal(pdpatrol("rnu", cwd=tmp_path))
    assert line.endswith("got 'rnu'; did you mean run?")


@pytest.mark.parametrize("argument", ["--help", "--version", "rnu"])
def test_help_and_version_load_nothing_heavy(argument: str, tmp_path: Path) -> None:
    code = (
        "import sys\nfrom pdpatrol.missions.cli import main\n"
        f"before = set(sys.modules)\nsys.argv = ['pdpatrol', {argument!r}]\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        f"loaded = [name for name in {HEAVY!r} if name in sys.modules and name not in before]\n"
        "assert not loaded, loaded\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("run nowhere", "nowhere"),
        ("run --seed -1", "--seed: must be greater than or equal to 0, got -1"),
        ("reproduce --trials 99", "--trials: must be greater than or equal to 100, got 99"),
        ("replay", "DIR: at least one folder must be given, got none"),
        ("replay nowhere", "nowhere: holds no log.npz"),
        ("report nowhere", "nowhere: holds no log.npz"),
        ("export nowhere", "nowhere: holds no log.npz"),
    ],
)
def test_wrong_argument_is_refused_in_one_line(arguments: str, message: str, tmp_path: Path, refused: Refused) -> None:
    (line,) = refused(*arguments.split(), cwd=tmp_path)
    assert message in line
    assert list(tmp_path.iterdir()) == []


FILES = {"log.npz", "report.json", "report.html", "mission.rrd"}


def test_run_writes_all_files_and_prints_the_outcome(short: Path, tmp_path: Path) -> None:
    done = pdpatrol("run", short, "--seed", 3, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "runs" / "short-3"
    assert {path.name for path in folder.iterdir()} == FILES
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    assert (report["scenario"], report["seed"], report["policy"]) == ("short", 3, "seek")
    assert "No discharge was located." in done.stdout
    assert "time limit after 4 s" in done.stdout


def test_json_is_the_report_and_nothing_else(short: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    call("run", short, "--json", "--timing", "--out", tmp_path / "here")
    written = json.loads((tmp_path / "here" / "report.json").read_text(encoding="utf-8"))
    printed = capsys.readouterr()
    assert json.loads(printed.out) == written
    assert_times_add_up(printed.err, "policy", "environment", "locating", "log, report and recording")


@pytest.mark.parametrize("command", ["run", "scenarios"])
def test_errors_of_a_scenario_are_one_line_each(command: str, short: Path, tmp_path: Path, refused: Refused) -> None:
    text = short.read_text(encoding="utf-8").replace("gain_error = 0.05", "gain_error = -0.05\ncolour = 1")
    short.write_text(text, encoding="utf-8")
    lines = refused(command, "short.toml", cwd=tmp_path)
    assert len(lines) == 2
    assert all(line.startswith("short.toml: array.") for line in lines)
    assert [path.name for path in tmp_path.iterdir()] == ["short.toml"]


def test_implausible_scenario_is_noted_and_used(
    short: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    call("scenarios", "short.toml")
    assert "no errors" in capsys.readouterr().out
    text = short.read_text(encoding="utf-8").replace("[[sources]]", "[[sources]]\nactive_s = [100.0, 200.0]")
    short.write_text(text, encoding="utf-8")
    for command in ("run", "scenarios"):
        call(command, "short.toml")
        (note,) = [line for line in capsys.readouterr().err.splitlines() if line.startswith("note: ")]
        assert note.endswith("does not discharge within the mission")


def run_until_parts(folder: Path) -> subprocess.Popen[str]:
    """Start a mission that writes to `folder`, and wait until a part of its log is written."""
    process = subprocess.Popen(
        [PDPATROL, "run", "one_source", "--out", str(folder)],
        cwd=folder.parent,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline_s = time.monotonic() + 60
    while not list((folder / "log.parts").glob("*.npz")) and time.monotonic() < deadline_s:
        time.sleep(0.02)
    return process


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signal_ends_a_mission_with_complete_files(number: signal.Signals, tmp_path: Path) -> None:
    folder = tmp_path / "cut"
    process = run_until_parts(folder)
    process.send_signal(number)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 128 + number, errors
    assert "Traceback" not in errors
    log = MissionLog.load(folder)
    assert log.column("event", "subject")[-1] == "interrupted"
    assert {path.name for path in folder.iterdir()} == FILES
    assert Report.model_validate_json((folder / "report.json").read_text(encoding="utf-8")).ending == "interrupted"


def test_killed_mission_can_still_be_reported(tmp_path: Path) -> None:
    folder = tmp_path / "cut"
    process = run_until_parts(folder)
    process.kill()
    process.communicate(timeout=60)
    assert MissionLog.load(folder).n_rows("step") >= 300
    done = pdpatrol("report", folder, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert Report.model_validate_json((folder / "report.json").read_text(encoding="utf-8")).ending is None
    assert (folder / "report.html").exists()


def test_reproduce_writes_numbers_and_pictures(tmp_path: Path) -> None:
    done = pdpatrol("reproduce", "--trials", 100, "--seed", 4, "--json", "--timing", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert_times_add_up(done.stderr, "trials", "pictures and page")
    folder = tmp_path / "runs" / "reproduction-4"
    data = json.loads((folder / "reproduction.json").read_text())
    assert json.loads(done.stdout) == data
    assert (data["trials"], data["seed"]) == (100, 4)
    assert len(list(folder.glob("*.png"))) == 10
