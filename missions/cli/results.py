"""`pdpatrol results`: what a sweep came to."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from pdpatrol.missions.cli.output.folders import output_folder
from pdpatrol.missions.cli.output.terminal import err, in_one_line, out, refuse

if TYPE_CHECKING:
    import pyarrow as pa


def results(
    folder: tyro.conf.Positional[tuple[Path, ...]],
    *,
    markdown: bool = False,
    csv_output: Annotated[bool, tyro.conf.arg(name="csv")] = False,
    compare: Annotated[tuple[str, str] | None, tyro.conf.arg(metavar="A B")] = None,
    figures: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None,
) -> None:
    """Sum up the datasets of sweeps: a line for each scenario or level, policy and setting, with 95 % intervals.

    Args:
        folder: Of the dataset, or of several, which count as one.
        markdown: Print a Markdown table.
        csv_output: Print CSV, in SI units.
        compare: Compare two policies, two values of a setting as receiver.noise_v=1e-3, or this dataset and that of
            another sweep, by their folders, mission by mission on the same scenario and seed.
        figures: Draw into this folder, new or empty: errors, what is found over time, and over each setting.
    """
    wanted = {"--markdown": markdown, "--csv": csv_output, "--compare": compare is not None}
    given = [option for option, is_given in wanted.items() if is_given]
    if not folder:
        refuse("FOLDER: got none; allowed is that of a dataset, or those of several")
    if len(given) > 1 or (compare is not None and figures is not None):
        refuse(
            f"{', '.join(given)}: got more than one output; allowed is one of {', '.join(wanted)}, and --figures "
            "with all but --compare"
        )
    from dirmusic import InputFileError
    from pdpatrol.missions.sweep.dataset import Dataset, read_all
    from pdpatrol.missions.sweep.results import tables
    from pdpatrol.missions.sweep.results.summary import summarise_groups

    try:
        datasets = [Dataset(each) for each in folder]
        rows = read_all(datasets)
    except InputFileError as error:
        refuse(*error.faults)
    if compare is not None:
        _compare(rows, *compare)
        return
    if figures is not None:
        from pdpatrol.missions.sweep.results.figures import draw_figures

        with output_folder(figures, "", "--figures") as folder_of_figures:
            written = draw_figures(rows, folder_of_figures)
        err.print(f"Written to {in_one_line(str(figures))}: {', '.join(path.name for path in written)}", soft_wrap=True)
    summaries = summarise_groups(rows)
    if markdown:
        sys.stdout.write(tables.markdown(summaries))
    elif csv_output:
        sys.stdout.write(tables.as_csv(summaries))
    else:
        out.print(tables.terminal_table(summaries, f"{', '.join(map(str, folder))}, 95 % intervals"))
        for row in rows.to_pylist():
            if row["status"] != "finished":
                last_line = row["error"].strip().splitlines()[-1]
                out.print(
                    f"{row['scenario']}, {row['policy']}, seed {row['seed']}: {row['status']}: {last_line}",
                    soft_wrap=True,
                )
        missing = sum(dataset.manifest["n_missions"] - len(dataset.keys()) for dataset in datasets)
        if missing:
            out.print(f"{missing} missions are still to be run: repeat the command of the sweep")


def _compare(rows: pa.Table, first: str, second: str) -> None:
    """Print the differences between two sides, and which missions flipped."""
    from dirmusic import InputFileError
    from pdpatrol.missions.sweep.results.paired import compare, pair_up
    from pdpatrol.missions.sweep.results.tables import differences_table

    try:
        pairs = pair_up(rows, first, second)
    except InputFileError as error:
        refuse(*error.faults)
    out.print(differences_table(compare(pairs), first, second))
    for pair in pairs:
        if pair.has_flipped:
            n_found = f"{pair.first['n_found']} -> {pair.second['n_found']} of {pair.first['n_sources']} found"
            settings = "" if pair.first["settings"] == "{}" else f" {pair.first['settings']},"
            where = f"{pair.first['scenario']},{settings} seed {pair.first['seed']}"
            out.print(f"{where}: {n_found}", soft_wrap=True)
