"""`pdpatrol trend`: change of discharges over repeated inspections."""

import sys
from pathlib import Path
from typing import Annotated

import tyro
from pydantic import Field

from pdpatrol.missions.atomic_file import write_text
from pdpatrol.missions.campaign.inspection import read_inspections
from pdpatrol.missions.campaign.page import HEADINGS, summary_row, trend_page
from pdpatrol.missions.campaign.trend import RELEVANT_DB_PER_WEEK, make_trend
from pdpatrol.missions.cli.arguments import JsonOutput, OutFolder
from pdpatrol.missions.cli.terminal import err, out, output_folder, print_written, say
from pdpatrol.missions.fitted_table import FittedTable
from pdpatrol.missions.report.records import report_text


def trend(
    run: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="RUN [RUN ...]", help_behavior_hint="(required)")],
    /,
    *,
    relevant_db_per_week: Annotated[
        float, tyro.conf.arg(metavar="DB"), Field(gt=0.0, allow_inf_nan=False)
    ] = RELEVANT_DB_PER_WEEK,
    out_dir: OutFolder = None,
    json_output: JsonOutput = False,
) -> None:
    """Compare repeated inspections of one yard: which discharges are new, have grown or are gone.

    Print a line for each discharge, the fastest growing first: its last level and rate, and the change of both per
    week, with 99 % intervals. A discharge has grown if the interval of its level slope lies above zero; it is constant
    if the interval includes zero and excludes the growth that matters; it is gone if the last inspection would have
    found it with its former level and rate, but did not.

    Args:
        run: Folders that `pdpatrol run` or `locate` has written, of at least two dates, in any order.
        relevant_db_per_week: Growth of the level that matters, which the interval of a constant discharge excludes.
        out_dir: New or empty folder for trend.json and trend.html.
        json_output: Print trend.json instead of a table.
    """
    with err.status(f"Reading {len(run)} logs"):
        inspections = read_inspections(run)
    found = make_trend(inspections, relevant_db_per_week)
    if out_dir is not None:
        with output_folder(out_dir, "") as folder:
            write_text(folder / "trend.json", report_text(found))
            write_text(folder / "trend.html", trend_page(found, inspections))
    if json_output:
        sys.stdout.write(report_text(found))
        return
    title = f"{found.scenario}: {len(run)} inspections, {found.dates[0]} to {found.dates[-1]}, 99 % intervals"
    table = FittedTable(title, dict.fromkeys(HEADINGS, "left"))
    for discharge in found.discharges:
        table.add_row(*summary_row(discharge))
    if found.discharges:
        out.print(table)
    else:
        say(f"{title}: no discharge found")
    if out_dir is not None:
        print_written(out_dir, "trend.json", "trend.html")
