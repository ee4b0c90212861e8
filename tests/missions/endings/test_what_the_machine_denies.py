"""What the machine denies: a full disk, a closed pipe. One line, and status 1."""

import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from pdpatrol.envs import load_scenario
from pdpatrol.missions.cli.output.terminal import INCOMPLETE
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.runner import run_mission
from tests.processes import WRITES_NO_BYTECODE

pytestmark = pytest.mark.whole

PDPATROL = str(Path(sys.executable).with_name("pdpatrol"))


WRITES = """
import sys
from pathlib import Path
from pdpatrol.missions.cli.endings.command_line import command_line
from pdpatrol.missions.cli.output.folders import output_folder
from pdpatrol.missions.cli.output.terminal import write_mission
from pdpatrol.missions.record.mission_log import MissionLog
log = MissionLog.load(Path("whole"))
with command_line(), output_folder(Path(sys.argv[1]), "") as folder:
    write_mission(log, 1.0, folder)
"""


@pytest.fixture(scope="module")
def log_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the log of a mission of four seconds in `whole`."""
    folder = tmp_path_factory.mktemp("missions")
    (folder / "whole").mkdir()
    run_mission(load_scenario("one_source", {"task.time_limit_s": 4.0}), "seek", 0).save(folder / "whole")
    return folder


@pytest.mark.parametrize(
    "most_kb", [40, *(pytest.param(kb, marks=pytest.mark.slow) for kb in (0, 1, 4, 8, 16, 80, 160, 320, 640))]
)
def test_a_full_disk_is_one_line_and_what_is_there_is_whole(most_kb: int, log_folder: Path) -> None:
    """No file may become larger than the limit, which fails as a full disk does."""
    done = subprocess.run(
        [sys.executable, "-c", WRITES, str(most_kb)],
        cwd=log_folder,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **WRITES_NO_BYTECODE},
        capture_output=True,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (1024 * most_kb, 1024 * most_kb)),
    )
    folder = log_folder / str(most_kb)
    files = {path.name for path in folder.iterdir()} if folder.exists() else set[str]()
    if "log.npz" in files:
        assert MissionLog.load(folder).n_rows("step") == 40
    if done.returncode == 0:
        assert files == {"log.npz", "report.json", "report.html", "mission.rrd"}
        return
    (line,) = done.stderr.splitlines()
    assert "File too large" in line
    if most_kb == 0:  # not even the folder can be claimed
        assert (done.returncode, folder.exists()) == (2, False)
        return
    assert done.returncode == 1
    assert "mission.rrd" not in files
    assert INCOMPLETE in files


@pytest.mark.parametrize("arguments", ["scenarios", "scenarios --json", "--help"])
def test_a_full_device_for_what_is_printed_is_one_line(arguments: str) -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run([PDPATROL, *arguments.split()], stdout=full, stderr=subprocess.PIPE, text=True)
    assert (done.returncode, done.stderr) == (1, "No space left on device\n")


def test_a_closed_output_and_a_pipe_that_nobody_reads_are_no_traceback() -> None:
    for tail in (">&-", ">&- 2>&-", "| true"):
        done = subprocess.run(["sh", "-c", f"{PDPATROL} scenarios {tail}"], capture_output=True, text=True)
        assert done.stderr == ""
