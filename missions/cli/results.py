"""`pdpatrol results`: statistics of sweeps."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import tyro

from dirmusic import InputFileError
from pdpatrol.missions.cli.process import one_line
from pdpatrol.missions.cli.terminal import err, out, output_folder, refuse
from pdpatrol.missions.sweep import analysis, dataset, tables
from pdpatrol.missions.sweep.figures import draw_figures


def results(
    folder: tyro.conf.Positional[tuple[Path, ...]],
    *,
    markdown: bool = False,
    csv_output: Annotated[bool, tyro.conf.arg(name="csv")] = False,
    compare: Annotated[tuple[str, str] | None, tyro.conf.arg(metavar="A B")] = None,
    figures: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None,
) -> None:
    """Summarise the datasets of sweeps: a line for each scenario or level, policy and setting, with 95 % intervals.

    The intervals resample whole missions: they hold for other seeds in the same yards.

    Args:
        folder: Folder of the dataset, or of several, which are read as one.
        markdown: Print a Markdown table of all figures.
        csv_output: Print all figures as CSV.
        compare: Compare two policies, two values of a setting such as receiver.noise_v=1e-3, or two datasets by their
            folders, mission by mission on the same scenario and seed.
        figures: New or empty folder for figures: errors, sources found over time, and both over each setting.
    """
    chosen = {"--markdown": markdown, "--csv": csv_output, "--compare": compare is not None}
    given = [option for option, is_given in chosen.items() if is_given]
    if not folder:
        refuse("FOLDER: at least one dataset must be given, got none")
    if len(given) > 1 or (compare is not None and figures is not None):
        refuse(f"{', '.join(chosen)}: give at most one of them, and --figures not with --compare")
    try:
        datasets = [dataset.Dataset(each) for each in folder]
        rows = dataset.read_all(datasets)
        pairs = [] if compare is None else analysis.pair_up(rows, *compare)
    except InputFileError as error:
        refuse(*error.faults)
    if compare is not None:
        out.print(tables.differences_table(analysis.compare(pairs), *compare))
        for first, second in pairs:
            if first["n_found"] != second["n_found"]:
                name = ", ".join(
                    filter(None, (first["scenario"], first["settings"].strip("{}"), f"seed {first['seed']}"))
                )
                found = f"{first['n_found']} -> {second['n_found']} of {first['n_sources']} found"
                out.print(f"{name}: {found}", soft_wrap=True)
        return
    if figures is not None:
        with output_folder(figures, "", "--figures") as figure_folder:
            written = draw_figures(rows, figure_folder)
        err.print(f"Written to {one_line(str(figures))}: {', '.join(path.name for path in written)}", soft_wrap=True)
    summaries = analysis.summarise_groups(rows)
    if markdown:
        lines = [list(tables.cells(summary).values()) for summary in summaries]
        sys.stdout.write(tables.markdown(list(tables.cells(summaries[0])) if summaries else [], lines))
    elif csv_output:
        sys.stdout.write(tables.as_csv(summaries))
    else:
        out.print(tables.terminal_table(summaries, f"{', '.join(map(str, folder))}, 95 % intervals for other seeds"))
        for row in rows.to_pylist():
            if row["status"] != "finished":
                reason = row["error"].strip().splitlines()[-1]
                name = f"{row['scenario']}, {row['policy']}, seed {row['seed']}"
                out.print(f"{name}: {row['status']}: {reason}", soft_wrap=True)
        if missing := sum(each.manifest["n_missions"] - len(each.keys()) for each in datasets):
            out.print(f"{missing} missions are missing: run the command of the sweep again to continue it")
