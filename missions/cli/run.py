"""`pdpatrol run`: one mission."""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from missions.cli.terminal import (
    FAILED,
    INTERRUPTED,
    err,
    make_folder,
    new_folder,
    out,
    refuse,
    tell_calibration,
    tell_channel_faults,
    tell_findings,
    tell_notes,
    tell_where,
    write_mission,
)

if TYPE_CHECKING:
    from missions.runner import Mission

TOLD = (
    "candidate",
    "confirmed",
    "outside",
    "ghost",
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
    out_dir: Annotated[Path | None, tyro.conf.arg(name="out", metavar="DIR")] = None,
    live: bool = False,
    json_output: Annotated[bool, tyro.conf.arg(name="json")] = False,
) -> None:
    """Run one mission and write its log, report and recording.

    Ctrl-C, or an error in your own code, ends the mission early; log, report and recording are written all the same.
    Exit status: 0, or 130 after Ctrl-C, 1 after an error in your own code, 2 if nothing was started.

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
        out_dir: Folder to write to; new or empty. Default: runs/SCENARIO-SEED, then -2, -3 and so on.
        live: Show the mission in the Rerun viewer while it runs.
        json_output: Print the report as JSON instead of a table.
    """
    from dirmusic import InputFileError
    from envs.foreign_code import ForeignCodeError
    from envs.scenario import ScenarioError, load_scenario
    from envs.scenario.calibration import read_calibration
    from missions.policies.names import BUILT_IN, load_maker

    settings: dict[str, Any] = {} if serial_number is None else {"array.serial_number": serial_number}
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
    except ForeignCodeError as error:
        refuse(str(error))
    folder = new_folder(out_dir, f"{loaded.name}-{seed}")
    tell_notes(loaded)

    from missions.record.report import make_report
    from missions.recording import live_stream
    from missions.runner import Mission

    started_s = time.perf_counter()
    with _progress(loaded.task.time_limit_s) as follow:
        viewer = None

        def after_step(mission: Mission) -> None:
            nonlocal viewer
            follow(mission)
            if live:
                viewer = viewer or live_stream(mission.log)
                if mission.log.n_rows("step") % 5 == 0 or mission.is_over:
                    viewer.update()

        try:
            mission = Mission(loaded, policy, seed, folder)
        except ForeignCodeError as error:
            refuse(str(error))
        except ScenarioError as error:
            refuse(*error.faults)
        make_folder(folder)
        log = mission.run(after_step)
        report = make_report(log, time.perf_counter() - started_s)
        write_mission(log, report, folder)
    if json_output:
        out.print_json(data=report)
    else:
        tell_findings(report)
        tell_channel_faults(report)
        tell_calibration(report)
        out.print(_summary(report, log.column("event", "text")[-1]), highlight=False)
        tell_where(folder)
    if mission.error is not None:
        err.print(str(mission.error), highlight=False, markup=False, soft_wrap=True)
        sys.exit(FAILED)
    if log.column("event", "text")[-1] == "interrupted":
        sys.exit(INTERRUPTED)


def _summary(report: dict[str, Any], ending: str) -> str:
    missed, unreachable = report["waypoints"]["missed"], report["waypoints"]["unreachable"]
    parts = [
        f"{ending} after {report['sim_time_s']:.0f} s simulated in {report['wall_time_s']:.1f} s",
        f"{report['distance_m']:.0f} m driven",
        f"{report['n_bearings']} bearings",
        *([] if (left := report["battery_left"]) is None else [f"{100 * left:.1f} % of the battery left"]),
        f"{report['collisions']} collisions",
        f"waypoints missed: {', '.join(map(str, missed)) or 'none'}",
    ]
    if unreachable:
        parts.append(f"waypoints that could not be reached: {', '.join(map(str, unreachable))}")
    if "evaluation" in report:
        sources = report["evaluation"]["sources"]
        found = sum(source["found"] for source in sources)
        parts.append(
            f"{found} of {len(sources)} sources found, {report['evaluation']['false_findings']} false findings"
        )
    return "; ".join(parts)


@contextmanager
def _progress(time_limit_s: float) -> Iterator[Callable[[Mission], None]]:
    """A progress bar over the route, the news as it comes, and Ctrl-C as a wish rather than a crash."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    stopped = False

    def stop(*_: object) -> None:
        nonlocal stopped
        stopped = True

    columns = (
        TextColumn("{task.description:<16}"),
        BarColumn(),
        TextColumn("{task.fields[clock]}"),
        TimeRemainingColumn(),
    )
    previous = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as progress:
            bar = progress.add_task("start", total=1.0, clock="the first run on a machine compiles: some 20 s")
            told = 0

            def follow(mission: Mission) -> None:
                nonlocal told
                events = mission.log.table("event", told)
                for kind, text in zip(events["kind"], events["text"], strict=True):
                    if kind in TOLD:
                        progress.console.print(
                            f"{mission.time_s:6.1f} s  {kind}: {text}", highlight=False, markup=False
                        )
                told += events["kind"].size
                stops = len(mission.site_map.route.stops_m) + 1
                visited = mission.n_visited / stops
                progress.update(
                    bar,
                    completed=max(visited, mission.time_s / time_limit_s),
                    description=mission.policy.phase,
                    clock=f"{mission.time_s:5.0f} s simulated, {visited * stops:.0f} of {stops - 1} waypoints",
                )
                if stopped and not mission.is_over:
                    mission.end("interrupted")

            yield follow
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
