"""Helpers that run commands and inspect processes; processes that end in the meantime are ignored."""

import os
import re
import resource
import subprocess
import sys
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

PDPATROL = str(Path(sys.executable).with_name("pdpatrol"))


def without_screen() -> dict[str, str]:
    """Return the environment of a machine without a screen."""
    return {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}


def pdpatrol(*arguments: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run a command to its end, without a screen."""
    return subprocess.run(
        [PDPATROL, *map(str, arguments)],
        cwd=cwd, env=without_screen(), capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip


def start_python(code: str, *arguments: str, cwd: Path) -> subprocess.Popen[str]:
    """Start Python code that may import this repository."""
    return subprocess.Popen(
        [sys.executable, "-c", code, *arguments],
        cwd=cwd, env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def run_on_full_disk(words: list[str], n_bytes: int, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run a command whose files fail beyond a size, as they do on a full disk.

    It writes no bytecode, because truncated bytecode would break later imports.
    """
    return subprocess.run(
        words, cwd=cwd, capture_output=True, text=True, timeout=120,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "PYTHONDONTWRITEBYTECODE": "1"},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes, n_bytes)),
    )  # fmt: skip


def refusal(done: subprocess.CompletedProcess[str]) -> list[str]:
    """Return the error lines of a command that refused its input, after checking its exit status."""
    assert done.returncode == 2, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""
    return done.stderr.strip().splitlines()


def below(pid: int) -> set[int]:
    """Return the ids of all descendants of a process."""
    try:
        return {process.pid for process in psutil.Process(pid).children(recursive=True)}
    except psutil.NoSuchProcess:
        return set()


def listening(pids: Iterable[int]) -> set[str]:
    """Return the addresses, without ports, on which processes listen."""
    found = set[str]()
    for pid in pids:
        with suppress(psutil.NoSuchProcess):
            connections = psutil.Process(pid).net_connections(kind="tcp")
            found |= {each.laddr.ip for each in connections if each.status == psutil.CONN_LISTEN and each.laddr}
    return found


def title(pid: int) -> str:
    """Return the command line of a process; empty if it has ended."""
    try:
        return " ".join(psutil.Process(pid).cmdline())
    except psutil.NoSuchProcess:
        return ""


def assert_times_add_up(stderr: str, *parts: str) -> None:
    """Check the line of `--timing`: it has these parts, and all parts add up to the total."""
    (line,) = (line for line in stderr.splitlines() if line.startswith("Time: "))
    total, *others = (float(number) for number in re.findall(r"(-?\d+\.\d) s", line.partition(";")[0]))
    assert sum(others) == pytest.approx(total, abs=0.1 * len(others))
    assert min(others) >= 0.0
    assert all(f"{part} " in line for part in parts)
