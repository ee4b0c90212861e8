"""What processes do and say, for tests of commands; of those below one, whatever ends meanwhile is left out."""

import re
from collections.abc import Iterable
from contextlib import suppress

import psutil
import pytest

WRITES_NO_BYTECODE = {"PYTHONDONTWRITEBYTECODE": "1"}
"""Of a process whose files may not become large: Python would keep compiled modules cut short, and fail ever after."""


def below(pid: int) -> set[int]:
    """All processes that one has started, and those that they have; the process itself is not among them."""
    try:
        return {process.pid for process in psutil.Process(pid).children(recursive=True)}
    except psutil.NoSuchProcess:
        return set()


def listening(pids: Iterable[int]) -> set[str]:
    """Addresses, without their ports, on which processes listen."""
    found = set[str]()
    for pid in pids:
        with suppress(psutil.NoSuchProcess):
            connections = psutil.Process(pid).net_connections(kind="tcp")
            found |= {each.laddr.ip for each in connections if each.status == psutil.CONN_LISTEN and each.laddr}
    return found


def cpu_s(pid: int) -> float:
    """Seconds that a process has computed for; 0 where there is none any more."""
    try:
        return psutil.Process(pid).cpu_times().user
    except psutil.NoSuchProcess:
        return 0.0


def title(pid: int) -> str:
    """The command line as the process shows it; empty where there is none any more."""
    try:
        return " ".join(psutil.Process(pid).cmdline())
    except psutil.NoSuchProcess:
        return ""


def assert_tells_time(stderr: str, *parts: str) -> None:
    """One line, whose parts add up."""
    (line,) = (line for line in stderr.splitlines() if line.startswith("Time: "))
    total, *others = (float(number) for number in re.findall(r"(-?\d+\.\d) s", line.partition(";")[0]))
    assert sum(others) == pytest.approx(total, abs=0.1 * len(others))
    assert min(others) >= 0.0
    assert all(f"{part} " in line for part in parts)
