"""`pdpatrol gap`: where a recording and the simulation of the same drive differ."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import tyro

from pdpatrol.envs.scenario import load_scenario
from pdpatrol.missions.atomic_file import atomic_file, write_text
from pdpatrol.missions.cli.arguments import JsonOutput, OutFolder, optional
from pdpatrol.missions.cli.locate import read_survey
from pdpatrol.missions.cli.terminal import err, note, out, output_folder, print_written, progress_bar, say
from pdpatrol.missions.field.gap.compare import compare, fitted_scenario, survey_of
from pdpatrol.missions.field.gap.output import as_json, draw_gap, gap_table
from pdpatrol.missions.field.survey import Heading, Positive
from pdpatrol.missions.record.words import counted


def gap(
    recording: Annotated[Path, tyro.conf.arg(metavar="RECORDING.csv")],
    /,
    *,
    yard: Annotated[Path, tyro.conf.arg(metavar="FILE.toml")],
    heading: Heading = "counterclockwise",
    noise_v: Annotated[Positive | None, optional("VOLTS")] = None,
    gate_ns: Annotated[Positive, tyro.conf.arg(metavar="NANOSECONDS")] = 4.5,
    out_dir: OutFolder = None,
    json_output: JsonOutput = False,
) -> None:
    """State where a recording and the simulation of the same drive differ, with intervals.

    The sources of the recording are sought at the sites of the yard and at the findings. The same drive is simulated
    with them, with the array, receiver, ground and pose errors that the scenario states. Writes gap.json, gap.png, and
    fitted.toml: the scenario with the fitted values, for `pdpatrol run`.

    Args:
        recording: Survey as for `pdpatrol locate`.
        yard: Scenario file of the yard in whose frame the poses are.
        heading: What yaw_deg holds, as for `locate`.
        noise_v: Standard deviation of a strength or of a noise sample, where the recording does not state it.
        gate_ns: Length of the gate that is cut out of a waveform.
        out_dir: Folder to write to; new or empty. Default: runs/gap-NAME, then -2, -3 and so on.
        json_output: Print the report as JSON instead of a table.
    """
    scenario = load_scenario(str(yard))
    survey = replace(survey_of(scenario, yard), heading=heading, noise_v=noise_v, gate_ns=gate_ns)
    with output_folder(out_dir, f"gap-{recording.stem}") as folder:
        data = read_survey(recording, survey)
        note(*data.notes)
        with progress_bar() as progress:
            bar = progress.add_task(counted(data.step.size, "pulse"), total=1.0)
            found = compare(data, scenario, survey, lambda share: progress.advance(bar, share))
        with err.status("Writing report"):
            with atomic_file(folder / "gap.png") as picture:
                draw_gap(found, picture)
            write_text(folder / "fitted.toml", fitted_scenario(found, f"{scenario.name}_fitted"))
            write_text(folder / "gap.json", json.dumps(as_json(found), indent=2) + "\n")
    if json_output:
        out.print_json(data=as_json(found))
        return
    out.print(gap_table(found))
    say("Intervals are 3 standard deviations on each side.")
    print_written(folder, "gap.json", "gap.png", "fitted.toml")
