"""`pdpatrol trend`: what became of discharges over repeated inspections."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro

from pdpatrol.missions.cli.process import one_line
from pdpatrol.missions.cli.terminal import err, out, output_folder, refuse


def trend(
    run: Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="RUN")],
    *,
    out_dir: Annotated[Path | None, tyro.conf.arg(name="out", metavar="DIR")] = None,
    json_output: Annotated[bool, tyro.conf.arg(name="json")] = False,
) -> None:
    """Join the findings of repeated inspections of one yard: which discharges are new, grown or gone.

    A line for each discharge, those that grow most first: its level and its rate when they were last known, and how
    both change from week to week, with 99 % intervals. `grown` is one whose interval lies above zero; `gone` is one
    that the last inspection would have found if it were as before, and did not.

    Args:
        run: Folders that `pdpatrol run` or `locate` has written, of two dates at least, in any order.
        out_dir: Folder for trend.json and trend.html, new or empty.
        json_output: Print trend.json instead of a table.
    """
    if len(run) < 2:
        refuse(f"RUN: got {len(run)}; allowed are two folders or more")
    from dirmusic import InputFileError
    from pdpatrol.missions.campaign.inspection import read_inspections

    try:
        with err.status(f"Reads {len(run)} logs"):
            inspections = read_inspections(run)
    except InputFileError as error:
        refuse(*error.faults)
    if inspections[0].day == inspections[-1].day:
        refuse(f"RUN: all of {inspections[0].day}; allowed are inspections of two dates at least")
    from pdpatrol.missions.campaign.tables import trend_table
    from pdpatrol.missions.campaign.trend import make_trend
    from pdpatrol.missions.campaign.trend_file import trend_text, write_trend

    written: tuple[str, ...] = ()
    if out_dir is None:
        found = make_trend(inspections)
    else:
        with output_folder(out_dir, "") as folder:
            found = make_trend(inspections)
            written = write_trend(found, inspections, folder)
    if json_output:
        out.print(trend_text(found), end="", soft_wrap=True)
        return
    if found.discharges:
        out.print(trend_table(found))
    else:
        out.print(f"No discharge found in {len(run)} inspections, {found.dates[0]} to {found.dates[-1]}.")
    if written:
        out.print(f"Written to {one_line(str(out_dir))}: {', '.join(written)}", soft_wrap=True)
