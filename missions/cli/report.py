"""`pdpatrol report`: the report of a mission, made anew from its log."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Annotated

import tyro

from pdpatrol.missions.cli.output.terminal import out, refuse, tell_findings, tell_json, write_report


def report(
    folder: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="DIR")],
    *,
    json_output: Annotated[bool, tyro.conf.arg(name="json")] = False,
) -> None:
    """Make report.json and report.html of a mission anew from its log.

    What a mission that was killed left in its folder will do; it has no phases of pulses, for want of the association
    that is made at the end. Reports that are there are replaced.

    Args:
        folder: Folder of a mission.
        json_output: Print the report as JSON instead of a table.
    """
    if not folder.is_dir():
        refuse(f"{folder}: no such folder; give the folder of a mission")
    from pdpatrol.missions.record.mission_log import MissionLog
    from pdpatrol.missions.report.report_file import read_report

    wall_time_s = 0.0
    with suppress(OSError, ValueError):
        wall_time_s = read_report((folder / "report.json").read_text(encoding="utf-8")).wall_time_s
    try:
        log = MissionLog.load(folder)
    except (FileNotFoundError, ValueError) as error:
        refuse(str(error))
    try:
        made = write_report(log, wall_time_s, folder)
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError):
        refuse(f"{folder}: the facts in its log are damaged; give the folder that `pdpatrol run` wrote")
    if json_output:
        tell_json(made)
        return
    tell_findings(made)
    out.print(f"Written to {folder}: report.json, report.html", soft_wrap=True)
