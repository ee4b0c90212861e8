"""Signals: at any moment, within two seconds, with whole files and no child left."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pytest

from pdpatrol.envs import load_scenario
from pdpatrol.missions.cli.endings.interrupts import SIGNALS
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.recording.viewer import supervisor
from pdpatrol.missions.recording.viewer.supervisor import LEAVE_OPEN
from pdpatrol.missions.runner import run_mission

pytestmark = pytest.mark.whole

EXAMPLE = Path(__file__).parents[3] / "examples" / "locate" / "strengths.csv"
PDPATROL = str(Path(sys.executable).with_name("pdpatrol"))
ENVIRONMENT = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}

ENDLESS = """
import sys, time
from pathlib import Path
from pdpatrol.missions.cli.endings.command_line import command_line
from pdpatrol.missions.cli.output.folders import output_folder
from pdpatrol.missions.atomic_file import atomic_file
import numpy as np
with command_line(), output_folder(Path("folder"), "") as folder:
    (folder / "whole").touch()
    with atomic_file(folder / "half") as half:
        half.touch()
        print("ready", flush=True)
        if sys.argv[1] == "compiled":
            import numba
            @numba.njit(nogil=True)
            def spin(n):
                x = 0.0
                for i in range(n):
                    x += i % 7
                return x
            spin(10)
            print("ready", flush=True)
            spin(10**13)
        time.sleep(600.0)
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("where", ["python", "compiled"])
def test_signals_end_a_command_wherever_it_is_and_leave_whole_files(
    where: str, number: signal.Signals, tmp_path: Path
) -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", ENDLESS, where],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    for _ in range(2 if where == "compiled" else 1):
        assert process.stdout.readline() == "ready\n"
    time.sleep(0.1)
    process.send_signal(number)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == 128 + number
    assert errors.strip() == "Interrupted"
    assert [path.name for path in (tmp_path / "folder").glob("[!.]*")] == ["whole"]


def test_a_second_signal_ends_a_command_at_once(tmp_path: Path) -> None:
    code = ENDLESS.replace("time.sleep(600.0)", "stuck()").replace(
        "with command_line()",
        """
def stuck():
    while True:
        try:
            print("stuck", flush=True)
            time.sleep(600.0)
        except BaseException:
            pass

with command_line()""",
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code, "python"], cwd=tmp_path, env=ENVIRONMENT, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert [process.stdout.readline() for _ in range(2)] == ["ready\n", "stuck\n"]
    process.send_signal(signal.SIGTERM)
    assert process.stdout.readline() == "stuck\n"
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=30)
    assert process.returncode == 128 + signal.SIGTERM
    assert [path.name for path in (tmp_path / "folder").glob("[!.]*")] == ["whole"]


TIDIES = """
        try:
            print("waits", flush=True)
            time.sleep(600.0)
        finally:
            print("tidies", flush=True)
            until = time.monotonic() + 60.0
            while time.monotonic() < until:  # in which a signal would raise at once
                sum(range(100))
"""
STUCK = """
        while True:
            try:
                time.sleep(600.0)
            except BaseException:
                pass
"""
STARTS = """
import subprocess, sys, time
subprocess.Popen(["sleep", "600"])
time.sleep(600.0)
"""


@pytest.mark.parametrize("is_forced", [False, True])
def test_processes_that_were_just_starting_end_too(is_forced: bool, tmp_path: Path) -> None:
    begin = f"import subprocess; child = subprocess.Popen([sys.executable, '-c', {STARTS!r}])"
    wait = STUCK if is_forced else "time.sleep(600.0)"
    code = ENDLESS.replace("time.sleep(600.0)", f"{begin}\n        {wait}")
    process = subprocess.Popen(
        [sys.executable, "-c", code, "python"], cwd=tmp_path, env=ENVIRONMENT, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    while len(started := psutil.Process(process.pid).children(recursive=True)) < 2:
        time.sleep(0.02)
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=30)  # to the end of whoever could still write
    assert process.returncode == 128 + signal.SIGTERM
    assert not psutil.wait_procs(started, timeout=5.0)[1]


def test_a_second_signal_while_the_first_is_seen_to_leaves_no_traceback(tmp_path: Path) -> None:
    tidies = ENDLESS.replace("time.sleep(600.0)", TIDIES)
    process = subprocess.Popen(
        [sys.executable, "-c", tidies, "python"],
        cwd=tmp_path,
        env=ENVIRONMENT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert [process.stdout.readline() for _ in range(2)] == ["ready\n", "waits\n"]
    process.send_signal(signal.SIGTERM)
    assert process.stdout.readline() == "tidies\n"
    process.send_signal(signal.SIGTERM)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == 128 + signal.SIGTERM
    assert errors.strip() == "Interrupted"


def test_a_signal_that_is_to_be_ignored_stays_so(tmp_path: Path) -> None:
    code = f"import signal\nsignal.signal(signal.SIGHUP, signal.SIG_IGN)\n{ENDLESS}".replace("600.0", "0.5")
    process = subprocess.Popen(
        [sys.executable, "-c", code, "python"], cwd=tmp_path, env=ENVIRONMENT, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    process.send_signal(signal.SIGHUP)
    process.communicate(timeout=30)
    assert process.returncode == 0
    assert {path.name for path in (tmp_path / "folder").iterdir()} == {"whole", "half"}


SUPERVISES = f"""
import subprocess, sys
supervisor = subprocess.Popen(
    [sys.executable, {supervisor.__file__!r}, "sleep", "600"],
    stdin=subprocess.PIPE,
    stdout=subprocess.DEVNULL,
    start_new_session=True,
)
print(supervisor.pid, flush=True)
if sys.argv[1] == "leave_open":
    supervisor.stdin.write({LEAVE_OPEN!r})
    supervisor.stdin.close()
    sys.exit()
supervisor.wait()
"""


@pytest.mark.parametrize("stays", [False, True])
def test_a_viewer_ends_with_whoever_asked_for_it_however_that_ends_unless_it_is_left_open(stays: bool) -> None:
    asked = subprocess.Popen(
        [sys.executable, "-c", SUPERVISES, "leave_open" if stays else ""], stdout=subprocess.PIPE, text=True
    )
    assert asked.stdout is not None
    viewer = psutil.Process(int(asked.stdout.readline()))
    while not (started := viewer.children()):
        time.sleep(0.02)
    if not stays:
        asked.kill()
    asked.communicate(timeout=30)
    _, alive = psutil.wait_procs([viewer, *started], timeout=1.0 if stays else 10.0)
    for process in alive:
        process.kill()
    assert len(alive) == (2 if stays else 0)


FOLDER = "the folder of the test"
VERBS = {
    "run": ("run", "one_source", "--out", FOLDER),
    "plan": ("plan", "transformer_bay", "--out", FOLDER),
    "reproduce": ("reproduce", "--trials", "3600", "--out", FOLDER),
    "locate": ("locate", str(EXAMPLE), "--out", FOLDER),
    "sweep": ("sweep", "suite/open", "--seeds", "0", "--workers", "1", "--out", FOLDER),
    "replay": ("replay", FOLDER, "--web"),
}


@pytest.fixture(scope="module")
def mission(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the log of a mission, and no recording."""
    folder = tmp_path_factory.mktemp("mission")
    run_mission(load_scenario("transformer_bay"), "patrol").save(folder)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("verb", VERBS)
def test_signals_at_random_moments_end_every_verb_in_two_seconds(verb: str, mission: Path, tmp_path: Path) -> None:
    rng, late = np.random.default_rng(list(verb.encode())), list[float]()
    for k in range(40):
        number, folder = signal.Signals(rng.choice(SIGNALS)), tmp_path / str(k)
        if verb == "replay":
            shutil.copytree(mission, folder)
        process = subprocess.Popen(
            [PDPATROL, *(str(folder) if part == FOLDER else part for part in VERBS[verb])],
            cwd=tmp_path,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        time.sleep(0.3 + rng.exponential(6.0))
        children = psutil.Process(process.pid).children(recursive=True) if process.poll() is None else []
        is_double, began = rng.random() < 0.3, time.monotonic()
        process.send_signal(number)
        if is_double:
            time.sleep(0.1)
            process.send_signal(number)
        _, errors = process.communicate(timeout=60)
        late.append(time.monotonic() - began)
        assert process.returncode in (0, 128 + number, -number), errors  # the last while Python itself starts or ends
        assert "Traceback" not in errors
        assert not [path for path in tmp_path.rglob("*") if ".tmp" in path.name]
        if (folder / "log.npz").exists() or (folder / "log.parts").exists():
            assert MissionLog.load(folder).n_rows("step") > 0
        _, alive = psutil.wait_procs(children, timeout=3.0)
        assert not alive
    assert max(late) < 2.5  # two, and what starting and reaping a process takes on a loaded machine
