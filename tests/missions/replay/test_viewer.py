"""The viewer: says so where there is no screen, listens on this machine alone, and takes pictures."""

import gc
import io
import os
import re
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import psutil
import pytest
from matplotlib.image import imread

from pdpatrol.missions.recording.viewer.rerun_process import ViewerError, check_screen
from tests.missions.replay.short_mission import PDPATROL, pdpatrol, short_mission, without_screen

pytestmark = pytest.mark.whole

NEEDS_SCREEN = pytest.mark.skipif(shutil.which("xvfb-run") is None, reason="xvfb-run is not installed")


@pytest.fixture(scope="module")
def missions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the missions `zero` and `eins und zwei`."""
    folder = tmp_path_factory.mktemp("missions")
    for seed, name in enumerate(("zero", "eins und zwei")):
        (folder / name).mkdir()
        short_mission(seed=seed).save(folder / name)
    return folder


@contextmanager
def started(*arguments: str, cwd: Path, on_screen: bool, keeps_output: bool = False) -> Iterator[psutil.Popen]:
    """The command at work, with all that it has started; ended as Ctrl-C does."""
    screen = ["xvfb-run", "-a", "-s", "-screen 0 1280x800x24"] if on_screen else []
    process = psutil.Popen(
        [*screen, PDPATROL, *arguments],
        cwd=cwd,
        env=without_screen(),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        start_new_session=True,
        text=True,
    )
    try:
        yield process
    finally:
        everything = [process, *(process.children(recursive=True) if process.is_running() else [])]
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGINT)
        _, alive = psutil.wait_procs(everything, timeout=15.0)
        for each in alive:
            each.kill()
        if process.stdout is not None and not keeps_output:
            process.stdout.close()
        gc.collect()  # what psutil left open is closed, with a warning, in the test that it belongs to
        assert not alive


def listening(process: psutil.Popen) -> list[tuple[str, str]]:
    """Name and host of each process that listens, of all that a command has started."""
    found: list[tuple[str, str]] = []
    for each in (process, *process.children(recursive=True)):
        with suppress(psutil.Error):  # it ends meanwhile
            if "Xvfb" not in each.name():
                sockets = [link for link in each.net_connections("inet") if link.status == psutil.CONN_LISTEN]
                found += [(each.name(), link.laddr.ip) for link in sockets]
    return found


def lines(process: psutil.Popen) -> str:
    assert process.stdout is not None
    with process.stdout as output:
        return output.read()


@pytest.mark.parametrize("verb", ["replay", "run"])
def test_without_a_screen_one_line_says_so_and_offers_the_browser(verb: str, missions: Path) -> None:
    done = pdpatrol(*{"replay": ("replay", "zero"), "run": ("run", "--live", "--out", "new")}[verb], cwd=missions)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert "there is no screen" in line
    assert "pdpatrol replay --web" in line
    assert done.stdout == ""
    assert not (missions / "new").exists()


def test_either_kind_of_screen_is_one() -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        check_screen({name: ":0"})


@pytest.mark.skipif(not Path("/proc").exists(), reason="on macOS there is always a screen")
def test_no_screen_is_noticed() -> None:
    for none in ({}, {"DISPLAY": ""}):
        with pytest.raises(ViewerError, match="no screen"):
            check_screen(none)


def test_a_browser_gets_the_recordings_and_nothing_else_from_this_machine_alone(missions: Path) -> None:
    import urllib.error
    import urllib.parse
    import urllib.request

    with started(
        "replay", "zero", "eins und zwei", "--web", cwd=missions, on_screen=False, keeps_output=True
    ) as process:
        assert process.stdout is not None
        told = process.stdout.readline()
        hosts = listening(process)
        (url,) = re.findall(r"http://\S+", told)
        sources = urllib.parse.parse_qs(urllib.parse.urlsplit(url).query)["url"]
        for name, source in zip(("zero", "eins und zwei"), sources, strict=True):
            with urllib.request.urlopen(source, timeout=10) as answer:
                assert answer.read() == (missions / name / "mission.rrd").read_bytes()
                assert url.startswith(answer.headers["Access-Control-Allow-Origin"] + "/")
        for other in ("/", "/0/", "/0/log.npz", "/../zero/log.npz", "/etc/passwd"):
            with pytest.raises(urllib.error.HTTPError, match="404"):
                urllib.request.urlopen(urllib.parse.urljoin(sources[0], other), timeout=10)
    assert {host for _, host in hosts} == {"127.0.0.1"}
    assert len(hosts) == 2  # the page, and the files
    assert lines(process).strip() == "Interrupted"  # no line of Rerun, no second address


@pytest.mark.filterwarnings("default")
def test_a_killed_replay_leaves_no_server_behind(missions: Path) -> None:
    with started("replay", "zero", "--web", cwd=missions, on_screen=False) as process:
        assert process.stdout is not None
        process.stdout.readline()
        servers = process.children(recursive=True)
        assert any(server.name() == "rerun" for server in servers)
        process.kill()
        _, alive = psutil.wait_procs(servers, timeout=10.0)
        assert not alive


@NEEDS_SCREEN
@pytest.mark.filterwarnings("default")  # psutil leaves files open where a process ends while it is looked at
@pytest.mark.parametrize("verb", ["replay", "run"])
def test_a_viewer_on_a_screen_listens_on_this_machine_alone_and_says_nothing(
    verb: str, missions: Path, tmp_path: Path
) -> None:
    arguments = {"replay": ("replay", "zero", "eins und zwei"), "run": ("run", "--live", "--out", str(tmp_path / "m"))}
    with started(*arguments[verb], cwd=missions, on_screen=True, keeps_output=True) as process:
        deadline = time.monotonic() + 60.0
        while not (hosts := listening(process)) and time.monotonic() < deadline:
            time.sleep(0.2)
        time.sleep(3.0)
        hosts = listening(process)
    assert hosts == [("rerun", "127.0.0.1")]
    told = lines(process)
    assert "INFO" not in told
    assert "WARN" not in told
    assert "rerun+http" not in told


def test_a_picture_shows_the_asked_time_without_a_screen(missions: Path) -> None:
    pictures = []
    for at, name in (("2", "early.png"), ("7.5", "läte 1.png")):
        done = pdpatrol("replay", "zero", "--screenshot", name, "--at", at, cwd=missions)
        if "nothing on this machine can draw" in done.stderr:
            pytest.skip(done.stderr)
        assert (done.returncode, done.stderr) == (0, "")
        pictures.append(imread(io.BytesIO((missions / name).read_bytes()))[..., :3])
    early, late = pictures
    assert early.shape == late.shape == (1000, 1600, 3)
    assert np.unique((255 * early).astype(int).reshape(-1, 3), axis=0).shape[0] > 300  # not blank
    assert (np.abs(early - late).max(axis=-1) > 0.1).mean() > 0.002  # the robot is elsewhere
    again = pdpatrol("replay", "zero", "--screenshot", "early.png", cwd=missions)
    assert again.returncode == 2
    assert again.stderr == "--screenshot: early.png exists; allowed is a new file\n"


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["zero", "--screenshot", "a.jpg"], "--screenshot: got a.jpg; allowed is a name that ends in .png"),
        (["zero", "--screenshot", "nix/a.png"], "--screenshot: nix is no folder; allowed is a file in one that exists"),
        (["zero", "eins und zwei", "--screenshot", "a.png"], "--screenshot: got 2 missions; allowed is one"),
        (["zero", "--at", "3"], "--at: got 3.0; allowed is 0 or more, with --screenshot"),
        (["zero", "eins und zwei", "--row", "1"], "--row: got 2 folders; allowed is one, that of a sweep"),
        ([], "DIR: missing; give the folder of a mission"),
        (["zero", "zwölf"], "zwölf: no such folder; give the folder of a mission"),
    ],
)
def test_what_cannot_be_shown_is_refused_in_one_line(arguments: list[str], told: str, missions: Path) -> None:
    done = pdpatrol("replay", *arguments, cwd=missions)
    assert (done.returncode, done.stderr.strip()) == (2, told)
