"""Viewers: native, in a browser, and as a screenshot."""

import gc
import io
import os
import re
import shutil
import signal
import socket
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from tests.missions.conftest import Refused
from tests.missions.replay.short_mission import short_mission
from tests.processes import PDPATROL, below, listening, pdpatrol, title, without_screen

pytestmark = pytest.mark.whole

NEEDS_SCREEN = pytest.mark.skipif(shutil.which("xvfb-run") is None, reason="xvfb-run is not installed")


@pytest.fixture(scope="module")
def missions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the missions `zero` and `eins und zwei`."""
    folder = tmp_path_factory.mktemp("missions")
    for seed, name in enumerate(("zero", "eins und zwei")):
        (folder / name).mkdir()
        short_mission(seed=seed).save(folder / name)
    return folder


@contextmanager
def started(*arguments: str, cwd: Path, on_screen: bool = False) -> Iterator[subprocess.Popen[str]]:
    """Run the command, and end it and its processes as Ctrl-C does."""
    screen = ["xvfb-run", "-a", "-s", "-screen 0 1280x800x24"] if on_screen else []
    with subprocess.Popen(
        [*screen, PDPATROL, *arguments],
        cwd=cwd, env=without_screen(), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True,
        text=True,
    ) as process:  # fmt: skip
        try:
            yield process
        finally:
            if process.poll() is None:
                end(process)


def end(process: subprocess.Popen[str]) -> str:
    """End a command and its processes as Ctrl-C does, and return the rest of its output."""
    children = below(process.pid)
    os.killpg(process.pid, signal.SIGINT)
    output, _ = process.communicate(timeout=120)
    deadline = time.monotonic() + 15.0
    while (alive := {pid for pid in children if title(pid)}) and time.monotonic() < deadline:
        time.sleep(0.1)
    for pid in alive:
        os.kill(pid, signal.SIGKILL)
    gc.collect()  # psutil's open files are closed, with a warning, in this test
    assert not alive
    return output


def read_address(process: subprocess.Popen[str]) -> str:
    """Return the address that a command prints first."""
    assert process.stdout is not None
    (url,) = re.findall(r"http://\S+", process.stdout.readline())
    return url


@pytest.mark.parametrize("arguments", [("replay", "zero"), ("run", "--live", "--out", "new")])
def test_without_a_screen_the_command_offers_the_browser(arguments: tuple[str, ...], missions: Path) -> None:
    done = pdpatrol(*arguments, cwd=missions)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert "no screen" in line
    assert "pdpatrol replay --web" in line
    assert done.stdout == ""
    assert not (missions / "new").exists()


def test_web_viewer_listens_on_this_machine_alone(missions: Path) -> None:
    with started("replay", "zero", "eins und zwei", "--web", cwd=missions) as process:
        url = read_address(process)
        with urllib.request.urlopen(url.partition("?")[0], timeout=10) as answer:
            assert b"rerun" in answer.read().lower()
        assert listening({process.pid, *below(process.pid)}) == {"127.0.0.1"}
        assert len(end(process).splitlines()) <= 1  # nothing from Rerun


def test_web_viewer_uses_the_requested_port_or_refuses_it(missions: Path) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with started("replay", "zero", "--web", "--port", str(port), cwd=missions) as process:
        assert read_address(process) == f"http://127.0.0.1:{port}/?url=rerun%2Bhttp://127.0.0.1:{port + 1}/proxy"
        done = pdpatrol("replay", "zero", "--web", "--port", port, cwd=missions)
    assert done.returncode == 1
    assert done.stderr == f"port {port} cannot be used (Address already in use); choose another one with --port\n"


@NEEDS_SCREEN
@pytest.mark.filterwarnings("default")  # psutil leaves files open if a process ends while it is inspected
@pytest.mark.parametrize("command", ["replay", "run"])
def test_native_viewer_listens_on_this_machine_alone(command: str, missions: Path, tmp_path: Path) -> None:
    arguments = {"replay": ("replay", "zero", "eins und zwei"), "run": ("run", "--live", "--out", str(tmp_path / "m"))}
    with started(*arguments[command], cwd=missions, on_screen=True) as process:
        deadline = time.monotonic() + 60.0
        while not listening(below(process.pid)) and time.monotonic() < deadline:
            time.sleep(0.2)
        time.sleep(3.0)
        assert listening(below(process.pid)) == {"127.0.0.1"}
        output = end(process)
    assert not [word for word in ("INFO", "WARN", "rerun+http") if word in output]


def test_screenshot_shows_the_requested_time(missions: Path) -> None:
    pictures = []
    for at, name in (("2", "early.png"), ("7.5", "läte 1.png")):
        done = pdpatrol("replay", "zero", "--screenshot", name, "--at", at, cwd=missions)
        if "No graphics adapter" in done.stderr:
            pytest.skip(done.stderr)
        assert (done.returncode, done.stderr) == (0, "")
        pictures.append(imread(io.BytesIO((missions / name).read_bytes()))[..., :3])
    early, late = pictures
    assert early.shape == late.shape == (1000, 1600, 3)
    assert np.unique((255 * early).astype(int).reshape(-1, 3), axis=0).shape[0] > 300  # not blank
    assert (np.abs(early - late).max(axis=-1) > 0.1).mean() > 0.002  # the robot has moved


@pytest.mark.parametrize(
    ("arguments", "option"),
    [
        (["zero", "--screenshot", "a.jpg"], "--screenshot"),
        (["zero", "--screenshot", "zero/log.npz.png"], "--screenshot"),
        (["zero", "--at", "3"], "--at"),
        (["zero", "--port", "9876"], "--port"),
        (["zero", "eins und zwei", "--row", "1"], "--row"),
        (["zero", "--video", "a.gif", "--pace", "0"], "--pace"),
        ([], "DIR"),
        (["zero", "zwölf"], "zwölf"),
    ],
)
def test_invalid_options_are_refused_in_one_line(
    arguments: list[str], option: str, missions: Path, refused: Refused
) -> None:
    (missions / "zero" / "log.npz.png").touch()
    (line,) = refused("replay", *arguments, cwd=missions)
    assert line.startswith(option)
