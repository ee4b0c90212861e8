"""`pdpatrol report`: the report of a mission, written again from its log."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Annotated

import tyro

from pdpatrol.missions.cli.arguments import JsonOutput
from pdpatrol.missions.cli.mission_files import load_log, print_findings, print_json, write_report
from pdpatrol.missions.cli.terminal import print_written, refuse
from pdpatrol.missions.report.records import read_report


def report(
    folder: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="DIR")],
    *,
    json_output: JsonOutput = False,
) -> None:
    """Write report.json and report.html of a mission again from its log; existing ones are replaced.

    This also works with the log of a mission that was killed. Its report has no phase-resolved patterns, because pulses
    are associated with findings at the end of a mission.

    Args:
        folder: Folder of a mission.
        json_output: Print the report as JSON instead of a table.
    """
    log = load_log(folder)
    wall_time_s = 0.0
    with suppress(OSError, ValueError):
        wall_time_s = read_report((folder / "report.json").read_text(encoding="utf-8")).wall_time_s
    with refused_if_damaged(folder):
        made = write_report(log, wall_time_s, folder)
    if json_output:
        print_json(made)
        return
    print_findings(made)
    print_written(folder, "report.json", "report.html")


@contextmanager
def refused_if_damaged(folder: Path) -> Iterator[None]:
    """Print an error and exit if the block fails because the metadata of a log are damaged."""
    try:
        yield
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError):
        refuse(f"{folder}: the metadata in its log are damaged; give the folder that `pdpatrol run` wrote")
