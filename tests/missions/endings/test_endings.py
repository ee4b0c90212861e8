"""Exit of commands after signals, on a full disk, with closed output, and without optional libraries."""

import signal
import subprocess
import sys
from pathlib import Path

import psutil
import pytest

from pdpatrol.missions.record.mission_log import MissionLog
from tests.missions.replay.short_mission import short_mission
from tests.processes import PDPATROL, run_on_full_disk, start_python

pytestmark = pytest.mark.whole

WAITS = """
import subprocess, sys, time
from pathlib import Path
from pdpatrol.missions.atomic_file import atomic_file
from pdpatrol.missions.cli.process import command_process, deferred_signals
from pdpatrol.missions.cli.terminal import output_folder
child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600.0)"])
with command_process(), output_folder(Path("folder"), "") as folder:
    (folder / "complete").touch()
    with atomic_file(folder / "half") as half:
        half.touch()
        if sys.argv[1] == "deferred":
            with deferred_signals() as received:
                print("ready", flush=True)
                while not received:
                    time.sleep(0.01)
                print("deferred", flush=True)
                time.sleep(600.0)
        print("ready", flush=True)
        time.sleep(float(sys.argv[1]))
"""


def wait(seconds: str, tmp_path: Path, prefix: str = "") -> subprocess.Popen[str]:
    """Start a process that waits with a half-written file, and return when it is ready."""
    process = start_python(prefix + WAITS, seconds, cwd=tmp_path)
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    return process


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signal_ends_a_command_and_its_children(number: signal.Signals, tmp_path: Path) -> None:
    process = wait("600", tmp_path)
    children = psutil.Process(process.pid).children()
    assert len(children) == 1
    process.send_signal(number)
    _, errors = process.communicate(timeout=120)
    assert (process.returncode, errors) == (128 + number, "Interrupted\n")
    assert [path.name for path in (tmp_path / "folder").iterdir()] == ["complete"]
    assert not psutil.wait_procs(children, timeout=5.0)[1]


def test_second_signal_interrupts_what_the_first_did_not(tmp_path: Path) -> None:
    process = wait("deferred", tmp_path)
    process.send_signal(signal.SIGTERM)
    assert process.stdout is not None
    assert process.stdout.readline() == "deferred\n"
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=120)
    assert (process.returncode, errors) == (128 + signal.SIGTERM, "Interrupted\n")


def test_ignored_signal_stays_ignored(tmp_path: Path) -> None:
    process = wait("0.5", tmp_path, "import signal\nsignal.signal(signal.SIGHUP, signal.SIG_IGN)\n")
    process.send_signal(signal.SIGHUP)
    (child,) = psutil.Process(process.pid).children()
    process.wait(timeout=120)
    child.kill()
    process.communicate()
    assert process.returncode == 0
    assert {path.name for path in (tmp_path / "folder").iterdir()} == {"complete", "half"}


@pytest.fixture(scope="module")
def mission(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the log of a mission and no recording."""
    folder = tmp_path_factory.mktemp("mission")
    short_mission(4.0).save(folder)
    return folder


WRITES = """
import sys
from pathlib import Path
from pdpatrol.missions.cli.mission_files import write_mission
from pdpatrol.missions.cli.process import command_process
from pdpatrol.missions.cli.terminal import output_folder
from pdpatrol.missions.record.mission_log import MissionLog
log = MissionLog.load(Path(sys.argv[1]))
with command_process(), output_folder(Path(sys.argv[2]), "") as folder:
    write_mission(log, 1.0, folder)
"""


@pytest.mark.parametrize(
    "limit_kb", [40, *(pytest.param(kb, marks=pytest.mark.slow) for kb in (0, 1, 8, 16, 80, 160, 320, 640))]
)
def test_full_disk_is_one_line_and_files_are_complete(limit_kb: int, mission: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    done = run_on_full_disk([sys.executable, "-c", WRITES, str(mission), str(folder)], 1024 * limit_kb, tmp_path)
    files = {path.name for path in folder.iterdir()} if folder.exists() else set[str]()
    if "log.npz" in files:
        assert MissionLog.load(folder).n_rows("step") == MissionLog.load(mission).n_rows("step")
    if done.returncode == 0:
        assert files == {"log.npz", "report.json", "report.html", "mission.rrd"}
        return
    (line,) = done.stderr.splitlines()
    assert "File too large" in line
    assert done.returncode == 1
    assert "mission.rrd" not in files


@pytest.mark.parametrize("arguments", ["scenarios --json", "--help"])
def test_full_device_for_the_output_is_one_line(arguments: str) -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run([PDPATROL, *arguments.split()], stdout=full, stderr=subprocess.PIPE, text=True)
    assert (done.returncode, done.stderr) == (1, "No space left on device\n")


@pytest.mark.parametrize("tail", [">&- 2>&-", "| true"])
def test_closed_output_prints_nothing(tail: str) -> None:
    done = subprocess.run(["sh", "-c", f"{PDPATROL} scenarios {tail}"], capture_output=True, text=True)
    assert done.stderr == ""


@pytest.mark.parametrize(("library", "extra"), [("rerun", "viewer"), ("tyro", "missions")])
def test_missing_library_names_its_extra(library: str, extra: str, mission: Path) -> None:
    code = f"import sys; sys.modules[{library!r}] = None; from pdpatrol.missions.cli import main; main()"
    process = start_python(code, "replay", ".", cwd=mission)
    output, errors = process.communicate()
    expected = f'pdpatrol: {library} is not installed; run: pip install "pdpatrol[{extra}]"\n'
    assert (process.returncode, output, errors) == (1, "", expected)
