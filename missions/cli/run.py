"""`pdpatrol run`: one mission."""

import os
import sys
from pathlib import Path
from typing import Annotated, Any

import tyro
from pydantic import NonNegativeInt

from pdpatrol.envs.plausibility import plausibility
from pdpatrol.envs.scenario import load_scenario
from pdpatrol.envs.scenario.array import read_calibration
from pdpatrol.missions.cli.arguments import Flag, JsonOutput, OutFolder, ScenarioName, optional
from pdpatrol.missions.cli.mission_files import print_outcome, print_times, write_mission
from pdpatrol.missions.cli.process import deferred_signals
from pdpatrol.missions.cli.terminal import err, fail, note, output_folder, progress_bar, say
from pdpatrol.missions.first_run import compile_at_first_run
from pdpatrol.missions.policies.make_policy import load_maker
from pdpatrol.missions.record.words import counted
from pdpatrol.missions.report.records import Report
from pdpatrol.missions.report.wording import battery_text, inspection_text
from pdpatrol.missions.runner import Mission, Stopwatch


def run(
    scenario: ScenarioName = "one_source",
    /,
    *,
    policy: Annotated[str, tyro.conf.arg(metavar="{seek,active,patrol,random,oracle,FILE.py:NAME}")] = "seek",
    seed: NonNegativeInt = 0,
    serial_number: Annotated[int | None, optional("NUMBER")] = None,
    calibration: Annotated[Path | None, optional("FILE")] = None,
    date: Annotated[str | None, optional("YYYY-MM-DD")] = None,
    out_dir: OutFolder = None,
    live: Flag = False,
    json_output: JsonOutput = False,
    timing: Flag = False,
) -> None:
    """Run one mission and write its log, report and recording.

    Ctrl-C, SIGTERM, SIGHUP, or an error in your own code ends the mission early; log, report and recording are still
    written. Exit status: 0; 130, 143 or 129 after one of these signals; 1 after an error in your own code or of the
    operating system; 2 if the input is invalid.

    Args:
        scenario: Name of a shipped scenario (see `pdpatrol scenarios`), or path of a TOML file.
        policy: Policy that drives. seek leaves its route for detected sources, active chooses the most informative
            views, patrol keeps to the route, random is a lower bound, and oracle, which is given the truth, an upper
            bound. Your own policy is a class in a file, my_policy.py:MyPolicy, or in a module that Python can import,
            package.module:MyPolicy; MyPolicy(rng) makes one, and policy(observation, findings, site_map) returns two
            numbers in [-1, 1], for speed and yaw rate. The contract is the docstring of
            missions.policies.protocol.Policy; examples/own_policy is an example to copy.
        seed: Seed of all random draws, 0 or more. The same seed gives the same mission.
        serial_number: Serial number of the robot's array, as `serial_number` in the table [array] of the scenario:
            missions with the same number have the same array. Default: that of the scenario; without one, each mission
            has a different array.
        calibration: calibration.toml that an earlier mission with the same array has written. The array errors that it
            contains are used until the pulses contradict them, and a new file is written.
        date: Date of the inspection, as `date` in the table [campaign] of the scenario: the sources change from the
            start of the campaign to this date. Default: that of the scenario.
        out_dir: Folder to write to; new or empty. Default: runs/SCENARIO-SEED, then -2, -3 and so on.
        live: Show the mission in the Rerun viewer while it runs.
        json_output: Print the report as JSON instead of a table.
        timing: Print how long each part took.
    """
    settings: dict[str, Any] = {
        "array.serial_number": serial_number,
        "campaign.date": date,
        "locating.calibration": calibration and read_calibration(calibration),
    }
    loaded = load_scenario(scenario, {key: value for key, value in settings.items() if value is not None})
    load_maker(policy)
    with output_folder(out_dir, f"{loaded.name}-{seed}") as folder:
        compile_at_first_run(err)
        stopwatch = Stopwatch()
        viewer = None
        if live:
            os.environ.setdefault("RUST_LOG", "off")  # otherwise Rerun complains when the user closes the viewer
            from pdpatrol.missions.recording import LiveView  # Rerun is optional

            viewer = LiveView()
        note(*plausibility(loaded))
        with stopwatch.on("starting"):
            mission = Mission(loaded, policy, seed, folder, stopwatch)
        with progress_bar() as progress, deferred_signals() as received:
            bar = progress.add_task("start", total=loaded.task.time_limit_s)
            n_printed = 0

            def after_step(mission: Mission) -> None:
                nonlocal n_printed
                events = mission.log.table("event", n_printed)
                n_printed += events["kind"].size
                for kind, event in zip(events["kind"], events["text"], strict=True):
                    if kind not in ("waypoint", "error", "end"):
                        say(f"{mission.time_s:6.1f} s  {event}", progress.console, hanging=10)
                text = f"{mission.policy.phase}, {mission.n_visited} waypoints"
                progress.update(bar, completed=mission.time_s, description=f"{text:<36}")
                if viewer and (mission.log.n_rows("step") % 5 == 0 or mission.is_over):
                    viewer.update(mission.log)
                if received and not mission.is_over:
                    mission.end("interrupted")

            log = mission.run(after_step)
            with stopwatch.on("log, report and recording"):
                report = write_mission(log, stopwatch.total_s, folder)
    print_outcome(report, folder, _summary(report), json_output)
    if timing:
        print_times(stopwatch)
    if mission.error is not None:
        fail(str(mission.error))
    if received:
        sys.exit(128 + received[0])


def _summary(report: Report) -> list[str]:
    """Describe the course of the mission in a few lines for the terminal."""
    time_s = f"{report.sim_time_s:.0f} s simulated in {report.wall_time_s:.1f} s"
    facts = f"{report.ending} after {time_s}", f"{report.distance_m:.0f} m driven", battery_text(report)
    lines = [
        "; ".join(filter(None, facts)),
        f"{counted(report.n_bearings, 'bearing')}; {counted(report.collisions, 'collision')}",
    ]
    for kind, numbers in (("missed", report.waypoints.missed), ("unreachable", report.waypoints.unreachable)):
        if numbers:
            lines.append(f"waypoints {kind}: {', '.join(map(str, numbers))}")
    if report.inspection is not None and report.findings:  # otherwise the summary states it
        lines.append(inspection_text(report.inspection))
    scores = report.scores
    n_false, n_wrong = counted(scores.false_findings, "false finding"), scores.wrong_confirmations
    lines.append(
        f"{len(scores.matches)} of {len(scores.sources)} sources found, {n_false}; "
        f"{n_wrong} of {scores.confirmations} confirmations were wrong"
    )
    lines += [
        f"false all-clear: {site} was inspected, but its source was not found" for site in scores.false_all_clears or ()
    ]
    return lines
