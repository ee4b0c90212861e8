"""`pdpatrol results`: statistics of sweeps."""

import sys
from pathlib import Path
from typing import Annotated

import tyro

from pdpatrol.missions.cli.arguments import Flag, optional
from pdpatrol.missions.cli.terminal import note, out, output_folder, refuse, say
from pdpatrol.missions.record.words import counted
from pdpatrol.missions.sweep import analysis, dataset, tables
from pdpatrol.missions.sweep.figures import draw_figures


def results(
    folder: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="DIR [DIR ...]", help_behavior_hint="(required)")],
    /,
    *,
    markdown: Flag = False,
    csv_output: Annotated[Flag, tyro.conf.arg(name="csv")] = False,
    compare: Annotated[tuple[str, str] | None, optional("A B")] = None,
    figures: Annotated[Path | None, optional("DIR")] = None,
) -> None:
    """Summarise the datasets of sweeps: a line for each scenario or level, policy and setting, with 95 % intervals.

    The intervals take all missions in one yard as one cluster, so they are valid for other yards of the same kind; for
    a single yard, they are valid for other seeds in it.

    Args:
        folder: Folder of the dataset, or of several, which are read as one.
        markdown: Print a Markdown table of all figures.
        csv_output: Print all figures as CSV.
        compare: Compare two policies, two values of a setting such as receiver.noise_v=1e-3, or two datasets by their
            folders, mission by mission on the same scenario and seed, with intervals over yards.
        figures: New or empty folder for figures: errors, sources found over time, and both over each setting.
    """
    if not folder:
        refuse("FOLDER: at least one dataset must be given, got none")
    if markdown + csv_output + bool(compare) > 1 or (compare and figures):
        refuse("--markdown, --csv, --compare: give at most one of them, and --figures not with --compare")
    datasets = [dataset.Dataset(each) for each in folder]
    rows = dataset.read_all(datasets)
    if compare is not None:
        first, second = analysis.pair_up(rows, *compare)
        out.print(tables.differences_table(analysis.compare(first, second), *compare))
        for (_, before), (_, after) in zip(first.iterrows(), second.iterrows(), strict=True):
            if before["n_found"] != after["n_found"]:
                found = f"{before['n_found']} -> {after['n_found']} of {before['n_sources']} found"
                parts = (before["scenario"], before["settings"].strip("{}"), f"seed {before['seed']}: {found}")
                say(", ".join(filter(None, parts)), hanging=2)
        return
    if figures is not None:
        with output_folder(figures, "", "--figures") as figure_folder:
            written = draw_figures(rows, figure_folder)
        note(f"{len(written)} figures were written to {figures}")
    summaries = analysis.summarise_groups(rows)
    if markdown:
        sys.stdout.write(tables.markdown_table(summaries))
    elif csv_output:
        sys.stdout.write(tables.as_csv(summaries))
    else:
        out.print(tables.terminal_table(summaries, ", ".join(map(str, folder))), tables.coverage_table(summaries))
        for _, row in rows[rows["status"] != "finished"].iterrows():
            reason = row["error"].strip().splitlines()[-1]
            name = f"{row['scenario']}, {row['policy']}, seed {row['seed']}"
            say(f"{name}: {row['status']}: {reason}", hanging=2)
        if missing := sum(each.manifest.n_missions - len(each.read()) for each in datasets):
            say(f"{counted(missing, 'mission')} missing: run the command of the sweep again to continue it")
