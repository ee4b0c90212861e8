"""`pdpatrol report`: the report of a mission, written again from its log."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pdpatrol.missions.cli.arguments import JsonOutput, MissionFolder
from pdpatrol.missions.cli.mission_files import print_findings, write_report
from pdpatrol.missions.cli.terminal import print_written, refuse
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.records import report_text


def report(
    folder: MissionFolder,
    /,
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
    log = MissionLog.load(folder)
    with refused_if_damaged(folder):
        made = write_report(log, folder)
    if json_output:
        sys.stdout.write(report_text(made))
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
