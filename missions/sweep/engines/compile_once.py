"""Compilation, once on each machine: what a first worker compiles, all others of that machine read from disk."""

from __future__ import annotations

import fcntl
import os
import sys
from pathlib import Path
from tempfile import gettempdir

from pdpatrol.envs import load_scenario
from pdpatrol.missions.runner import run_mission
from pdpatrol.missions.second_process import SecondProcess
from pdpatrol.missions.sweep.code_version import digest_of_code
from pdpatrol.missions.sweep.plan import digest

MEETS_ALL = {"task.time_limit_s": 60.0}
"""So long a mission in `two_sources` meets every compiled loop."""


def is_compiled() -> bool:
    """Whether a worker of this machine has compiled this code."""
    mark = _mark()
    return mark.exists() and mark.stat().st_size > 0


def compile_once() -> None:
    """Compile all that missions need, or wait until another process of this machine has done so."""
    with _mark().open("a", encoding="utf-8") as mark:
        fcntl.flock(mark, fcntl.LOCK_EX)
        if is_compiled():
            return
        with SecondProcess() as second:
            second.start()
            run_mission(load_scenario("two_sources", MEETS_ALL))
        mark.write("compiled\n")


def _mark() -> Path:
    """The file that says so, and that whoever compiles has locked: one for each user, code and Python."""
    name = digest([digest_of_code(), sys.executable, str(os.getuid())])
    return Path(gettempdir()) / f"pdpatrol-{name[:16]}.compiled"
