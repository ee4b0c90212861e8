"""`pdpatrol run`: one mission."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from pdpatrol.missions.cli.endings import interrupts
from pdpatrol.missions.cli.output.folders import output_folder
from pdpatrol.missions.cli.output.terminal import (
    FAILED,
    err,
    fail,
    load_what_writes,
    out,
    refuse,
    tell_calibration,
    tell_channel_faults,
    tell_findings,
    tell_json,
    tell_notes,
    tell_time,
    tell_where,
    write_mission,
)

if TYPE_CHECKING:
    from pdpatrol.missions.recording import LiveView
    from pdpatrol.missions.report.records import Report
    from pdpatrol.missions.runner import Mission

TOLD = (
    "candidate",
    "confirmed",
    "outside",
    "ghost",
    "dropped",
    "contact",
    "unreachable",
    "clipped",
    "channel fault",
    "calibration",
)
"""Kinds of events that are news."""


def run(
    scenario: tyro.conf.Positional[str] = "one_source",
    *,
    policy: Annotated[str, tyro.conf.arg(metavar="{seek,active,patrol,random,oracle,FILE.py:NAME}")] = "seek",
    seed: int = 0,
    serial_number: Annotated[int | None, tyro.conf.arg(metavar="NUMBER")] = None,
    calibration: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None,
    date: Annotated[str | None, tyro.conf.arg(metavar="YYYY-MM-DD")] = None,
    out_dir: Annotated[Path | None, tyro.conf.arg(name="out", metavar="DIR")] = None,
    live: bool = False,
    json_output: Annotated[bool, tyro.conf.arg(name="json")] = False,
    timing: bool = False,
) -> None:
    """Run one mission and write its log, report and recording.

    Ctrl-C, SIGTERM, SIGHUP, or an error in your own code ends the mission early; log, report and recording are written
    all the same, as far as two seconds allow. Exit status: 0, or 130, 143, 129 after one of these signals, 1 after an
    error in your own code or what the machine denies, 2 if nothing was started.

    Args:
        scenario: Name of a shipped scenario (see `pdpatrol scenarios`), or path of a TOML file.
        policy: Who drives. seek leaves its route for what it hears, active looks from where it learns most, patrol
            keeps to the route, random is a floor. oracle knows the truth: a yardstick, not a result. Your own policy is
            a class in a file, my_policy.py:MyPolicy, or in a module that Python can import, package.module:MyPolicy;
            MyPolicy(rng) makes one, and policy(observation, findings, site_map) returns two numbers in [-1, 1], for
            speed and yaw rate.
            The contract is the docstring of missions.policies.protocol.Policy; examples/own_policy is one to copy.
        seed: Fixes all that is drawn; 0 or more. The same seed gives the same mission.
        serial_number: Which array the robot carries, as `serial_number` in the table [array] of the scenario: missions
            with the same number have the same array. Default: as the scenario has it, and there another one for each
            mission.
        calibration: calibration.toml that an earlier mission with this very array has written: what it has learned of
            the errors of the array is made use of, and one more is written. It counts until the pulses contradict it.
        date: Of the inspection, as `date` in the table [campaign] of the scenario: its sources have grown since the
            campaign began. Default: as the scenario has it.
        out_dir: Folder to write to; new or empty. Default: runs/SCENARIO-SEED, then -2, -3 and so on.
        live: Show the mission in the Rerun viewer while it runs.
        json_output: Print the report as JSON instead of a table.
        timing: Say in a line where the time went.
    """
    from dirmusic import InputFileError
    from pdpatrol.envs.scenario import ScenarioError, load_scenario
    from pdpatrol.envs.scenario.array import read_calibration
    from pdpatrol.envs.user_code import UserCodeError
    from pdpatrol.missions.policies.names import BUILT_IN, load_maker
    from pdpatrol.missions.stopwatch import Stopwatch

    stopwatch = Stopwatch()

    settings: dict[str, Any] = {} if serial_number is None else {"array.serial_number": serial_number}
    if date is not None:
        settings["campaign.date"] = date
    try:
        if calibration is not None:
            settings["locating.calibration"] = read_calibration(calibration)
        loaded = load_scenario(scenario, settings)
    except InputFileError as error:
        refuse(*error.faults)
    if seed < 0:
        refuse(f"--seed: got {seed}; allowed is 0 or more")
    try:
        if policy not in BUILT_IN:
            load_maker(policy)
    except UserCodeError as error:
        refuse(str(error))
    with stopwatch.on("loading"):
        from pdpatrol.missions.first_run import compile_at_first_run
        from pdpatrol.missions.runner import Mission
    with stopwatch.on("compiling"):
        compile_at_first_run(err)
    viewer = _live_view() if live else None
    with (
        output_folder(out_dir, f"{loaded.name}-{seed}") as folder,
        _progress(loaded.task.time_limit_s) as follow,
        ExitStack() as while_driving,
    ):
        tell_notes(loaded)
        asked = None

        def after_step(mission: Mission) -> None:
            nonlocal asked
            asked = asked or while_driving.enter_context(interrupts.put_off())
            follow(mission)
            if viewer and (mission.log.n_rows("step") % 5 == 0 or mission.is_over):
                viewer.update(mission.log)
            if asked() and not mission.is_over:
                mission.end("interrupted")

        try:
            with stopwatch.on("starting"):
                mission = Mission(loaded, policy, seed, folder)
        except UserCodeError as error:
            refuse(str(error))
        except ScenarioError as error:
            refuse(*error.faults)
        with stopwatch.on("loading"):
            load_what_writes()
        with stopwatch.on("the rest of the mission"):
            log = mission.run(after_step)
        stopwatch.split("the rest of the mission", mission.stopwatch.spent_s)
        with stopwatch.on("log, report and recording"):
            report = write_mission(log, stopwatch.total_s - stopwatch.spent_s["loading"], folder)
        if viewer:
            viewer.leave_open()
    if json_output:
        tell_json(report)
    else:
        tell_findings(report)
        tell_channel_faults(report)
        tell_calibration(report)
        for line in _summary(report):
            out.print(line, soft_wrap=True)
        tell_where(folder)
    if timing:
        tell_time(stopwatch)
    if mission.error is not None:
        err.print(str(mission.error), soft_wrap=True)
        sys.exit(FAILED)
    if interrupts.status() is not None:
        sys.exit(interrupts.status())


def _live_view() -> LiveView:
    """The viewer, which comes up before anything is run."""
    os.environ.setdefault("RUST_LOG", "off")  # Rerun tells of a viewer that is closed before the mission is over
    from pdpatrol.missions.recording import LiveView, ViewerError

    try:
        return LiveView()
    except ViewerError as error:
        fail(f"--live: {error}; run without it, and `pdpatrol replay --web` shows the mission in a browser")


def _summary(report: Report) -> list[str]:
    """How the mission went, in lines for a terminal."""
    missed, unreachable = report.waypoints.missed, report.waypoints.unreachable
    battery = "" if report.battery_left is None else f"; {100 * report.battery_left:.1f} % of the battery left"
    time_s = f"{report.sim_time_s:.0f} s simulated in {report.wall_time_s:.1f} s"
    lines = [
        f"{report.ending} after {time_s}; {report.distance_m:.0f} m driven{battery}",
        f"{report.n_bearings} bearings; {report.collisions} collisions; "
        f"waypoints missed: {', '.join(map(str, missed)) or 'none'}",
    ]
    if unreachable:
        lines.append(f"waypoints that could not be reached: {', '.join(map(str, unreachable))}")
    if report.evaluation is not None:
        sources, n_false = report.evaluation.sources, report.evaluation.false_findings
        found = f"{sum(source.found for source in sources)} of {len(sources)} sources found"
        lines.append(f"{found if sources else 'no source inside the fence'}, {n_false} false findings")
    return lines


@contextmanager
def _progress(time_limit_s: float) -> Iterator[Callable[[Mission], None]]:
    """Show a progress bar over the route, and print events as they come."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description:<16}"),
        BarColumn(),
        TextColumn("{task.fields[clock]}"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal, refresh_per_second=4) as progress:
        bar = progress.add_task("start", total=1.0, clock="")
        told = 0

        def follow(mission: Mission) -> None:
            nonlocal told
            events = mission.log.table("event", told)
            for kind, text in zip(events["kind"], events["text"], strict=True):
                if kind in TOLD:
                    progress.console.print(f"{mission.time_s:6.1f} s  {text}")
            told += events["kind"].size
            stops = len(mission.site_map.route.stops_m) + 1
            visited = mission.n_visited / stops
            progress.update(
                bar,
                completed=max(visited, mission.time_s / time_limit_s),
                description=str(mission.policy.phase),
                clock=f"{mission.time_s:5.0f} s simulated, {visited * stops:.0f} of {stops - 1} waypoints",
            )

        yield follow
