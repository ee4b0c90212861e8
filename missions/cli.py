"""`pdpatrol`: the command line. Its help and its refusals come before anything heavy is loaded."""

from __future__ import annotations

import json
import math
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import tyro
from rich.console import Console
from rich.table import Table

from missions.choices import PolicyName

if TYPE_CHECKING:
    from missions.runner import Mission

USAGE_ERROR = 2
INTERRUPTED = 130

app = tyro.extras.SubcommandApp()
out, err = Console(), Console(stderr=True)


def main() -> None:
    """Entry point of `pdpatrol`."""
    try:
        app.cli(
            prog="pdpatrol",
            description="A simulated inspection robot that finds partial discharges in a substation.",
            config=(tyro.conf.FlagCreatePairsOff,),
        )
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)


@app.command
def run(
    scenario: tyro.conf.Positional[str] = "one_source",
    *,
    policy: PolicyName = "seek",
    seed: int = 0,
    out_dir: Annotated[Path | None, tyro.conf.arg(name="out", metavar="DIR")] = None,
    live: bool = False,
    json_output: Annotated[bool, tyro.conf.arg(name="json")] = False,
) -> None:
    """Run one mission and write its log, report and recording.

    Ctrl-C ends the mission early; what was heard until then is written all the same.

    Args:
        scenario: Name of a shipped scenario (see `pdpatrol scenarios`), or path of a TOML file.
        policy: Who drives. oracle is told the truth: a yardstick, not a result.
        seed: Fixes all that is drawn; 0 or more. The same seed gives the same mission.
        out_dir: Folder to write to; new or empty. Default: runs/SCENARIO-SEED, then -2, -3 and so on.
        live: Show the mission in the Rerun viewer while it runs.
        json_output: Print the report as JSON instead of a table.
    """
    from envs.scenario import ScenarioError, load_scenario

    try:
        loaded = load_scenario(scenario)
    except ScenarioError as error:
        _refuse(*error.faults)
    if seed < 0:
        _refuse(f"--seed: got {seed}; allowed is 0 or more")
    folder = _made(_new_folder(out_dir, f"{loaded.name}-{seed}"))

    from missions.recording import live_stream, write_recording
    from missions.report import findings_table, make_report
    from missions.runner import run_mission

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

        log = run_mission(loaded, policy, seed, folder, after_step)
        report = make_report(log, time.perf_counter() - started_s)
        log.save(folder)
        _write_text(folder / "report.json", json.dumps(report, indent=2) + "\n")
        write_recording(log, folder / "mission.rrd")
    if json_output:
        out.print_json(data=report)
    else:
        out.print(findings_table(report) if report["findings"] else "No discharge found.", highlight=False)
        out.print(_summary(report, log.column("event", "text")[-1]), highlight=False)
        _tell_where(folder)
    if log.column("event", "text")[-1] == "interrupted":
        sys.exit(INTERRUPTED)


@app.command
def locate(
    table: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="FILE.csv")],
    *,
    pattern: Path | None = None,
    boresights_deg: tuple[float, ...] | None = None,
    ring_radius_m: float = 0.12,
    gain_error: float = 0.05,
    pointing_error_deg: float = 2.0,
    gain_offset: float = 0.0,
    position_std_m: float = 0.05,
    heading_std_deg: float = 0.5,
    pose_correlation_s: float = 5.0,
    noise_v: float | None = None,
    gate_ns: float = 4.5,
    yard_m: tuple[float, float] | None = None,
    out_dir: Annotated[Path | None, tyro.conf.arg(name="out", metavar="DIR")] = None,
    json_output: Annotated[bool, tyro.conf.arg(name="json")] = False,
) -> None:
    """Locate discharges in data from the field; writes log, report and recording like a mission.

    The table has the columns time_s, x_m, y_m, yaw_deg (counter-clockwise from x) and, one pulse a row, strength_1 to
    strength_n in volts, with std_1 to std_n where known; or waveform, the name of a file beside the table: .npz with
    waveforms (channels, samples) or (pulses, channels, samples), sample_rate_hz and, for counts, volts_per_count; or
    .csv with time_s and channel_1 to channel_n.

    Args:
        table: The table.
        pattern: Measured pattern of one element: .csv with angle_deg and gain or gain_db, .msi or .pln. Default: eq.
            (1) of the Dir-MUSIC paper.
        boresights_deg: Where each channel's element looks, counter-clockwise from straight ahead. Default: a ring of
            six, 90 30 -30 -90 -150 150, or its first four; for other numbers an even ring from 90 on, clockwise.
        ring_radius_m: Radius of the ring of elements.
        gain_error: How far gains spread about the data sheet, relative standard deviation.
        pointing_error_deg: How far boresights do, standard deviation.
        gain_offset: Half width of uniform additions to the gains.
        position_std_m: Standard deviation of the poses' x and y.
        heading_std_deg: Standard deviation of their heading.
        pose_correlation_s: How long an error of the pose stays the same.
        noise_v: Deviation of a strength, where the table has no std_1 ..., or of a noise sample of a waveform, where
            no noise was recorded apart from the pulse.
        gate_ns: Length of the gate that is cut out of a waveform.
        yard_m: Length of the yard along x and y from its corner at 0 0; what lies outside is told apart.
        out_dir: Folder to write to; new or empty. Default: runs/NAME, then -2, -3 and so on.
        json_output: Print the report as JSON instead of a table.
    """
    at_least_zero = {
        "--ring-radius-m": ring_radius_m,
        "--gain-error": gain_error,
        "--pointing-error-deg": pointing_error_deg,
        "--gain-offset": gain_offset,
        "--position-std-m": position_std_m,
        "--heading-std-deg": heading_std_deg,
    }
    above_zero = {"--pose-correlation-s": pose_correlation_s, "--noise-v": noise_v, "--gate-ns": gate_ns}
    above_zero |= {"--yard-m": min(yard_m)} if yard_m else {}
    faults = [f"{k}: got {v}; allowed is 0 or more" for k, v in at_least_zero.items() if not 0 <= v < math.inf]
    faults += [
        f"{k}: got {v}; allowed is above 0" for k, v in above_zero.items() if v is not None and not 0 < v < math.inf
    ]
    if faults:
        _refuse(*faults)
    folder = _new_folder(out_dir, table.stem)

    import warnings

    from rich.progress import Progress

    from dirmusic import ElementSpread, InputFileError, PoseError, read_pattern
    from missions.field_data import array_model, read_field_data

    started_s = time.perf_counter()
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            data = read_field_data(table, noise_v=noise_v, gate_s=gate_ns * 1e-9)
            array = array_model(
                data,
                ElementSpread(
                    gain=gain_error, pointing_rad=math.radians(pointing_error_deg), offset=gain_offset / math.sqrt(3)
                ),
                read_pattern(pattern) if pattern else None,
                boresights_deg,
                ring_radius_m,
            )
        except InputFileError as error:
            _refuse(*error.faults)
    notes = tuple(str(warning.message) for warning in told)
    for note in (*notes, *data.notes):
        err.print(f"note: {note}", highlight=False, markup=False, soft_wrap=True)
    _made(folder)

    from missions.field_log import locate_field_data
    from missions.recording import write_recording
    from missions.report import candidates_table, findings_table, make_report

    pose_error = PoseError(
        position_m=position_std_m, heading_rad=math.radians(heading_std_deg), correlation_s=pose_correlation_s
    )
    with Progress(console=err, transient=True) as progress:
        bar = progress.add_task(f"{data.strengths_v.shape[0]} pulses", total=1.0)
        log = locate_field_data(
            data, array, pose_error, fence_m=yard_m, notes=notes, progress=lambda share: progress.advance(bar, share)
        )
    report = make_report(log, time.perf_counter() - started_s)
    log.save(folder)
    _write_text(folder / "report.json", json.dumps(report, indent=2) + "\n")
    write_recording(log, folder / "mission.rrd")
    if json_output:
        out.print_json(data=report)
        return
    out.print(findings_table(report) if report["findings"] else "No discharge found.", highlight=False)
    if report["candidates"]:
        out.print(candidates_table(report), highlight=False)
    out.print(
        f"{data.time_s.size} poses, {data.strengths_v.shape[0]} pulses, {report['n_bearings']} bearings",
        highlight=False,
    )
    _tell_where(folder)


@app.command
def replay(folder: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="DIR")], *, web: bool = False) -> None:
    """Open the recording of a mission in the Rerun viewer.

    Args:
        folder: Folder of a mission; where it has no mission.rrd, the recording is made from its log.
        web: Serve it to a browser on this machine (127.0.0.1) instead.
    """
    if not folder.is_dir():
        _refuse(f"{folder}: no such folder; give the folder of a mission")
    from missions.log import MissionLog
    from missions.recording import open_viewer, serve, write_recording

    recording = folder / "mission.rrd"
    if not recording.exists():
        try:
            write_recording(MissionLog.load(folder), recording)
        except (FileNotFoundError, ValueError) as error:
            _refuse(str(error))
    if not web:
        open_viewer(recording)
        return
    serve(recording, lambda url: out.print(f"Serving at {url}  (Ctrl-C ends it)", highlight=False, soft_wrap=True))


@app.command
def scenarios(
    check: Annotated[tyro.conf.Positional[Path | None], tyro.conf.arg(metavar="CHECK.toml")] = None,
    *,
    json_output: Annotated[bool, tyro.conf.arg(name="json")] = False,
) -> None:
    """List the shipped scenarios, or check a file and name every fault in it.

    Args:
        check: A scenario file to check.
        json_output: Print JSON instead of a table.
    """
    from envs.scenario import SHIPPED, ScenarioError, load_scenario, shipped_scenarios

    if check is not None:
        try:
            scenario = load_scenario(check if check.suffix == ".toml" else check / "")
        except ScenarioError as error:
            _refuse(*error.faults)
        n_sites = len(scenario.yard.site_names())
        facts = {"scenario": scenario.name, "sources": len(scenario.sources), "candidate_sites": n_sites}
        if json_output:
            out.print_json(data=facts)
        else:
            out.print(f"{check}: no fault; {len(scenario.sources)} sources, {n_sites} candidate sites", highlight=False)
        return
    stories = {name: _first_line(SHIPPED / f"{name}.toml") for name in shipped_scenarios()}
    if json_output:
        out.print_json(data=stories)
        return
    table = Table("scenario", "what it shows")
    for name, story in stories.items():
        table.add_row(name, story)
    out.print(table)


@app.command
def reproduce(
    *,
    trials: int = 3600,
    seed: int = 0,
    out_dir: Annotated[Path | None, tyro.conf.arg(name="out", metavar="DIR")] = None,
    json_output: Annotated[bool, tyro.conf.arg(name="json")] = False,
) -> None:
    """Put every exhibit of the Dir-MUSIC paper beside ours, by the paper's method and by the best one.

    Writes reproduction.json and the pictures, drawn like the paper's.

    Args:
        trials: Of each cell; 100 to 1000000. The paper has 3600.
        seed: Fixes all that is drawn; 0 or more.
        out_dir: Folder to write to; new or empty. Default: runs/reproduction-SEED, then -2, -3 and so on.
        json_output: Print the numbers as JSON instead of tables.
    """
    faults = [
        *([] if 100 <= trials <= 1_000_000 else [f"--trials: got {trials}; allowed is 100 to 1000000"]),
        *([] if seed >= 0 else [f"--seed: got {seed}; allowed is 0 or more"]),
    ]
    if faults:
        _refuse(*faults)
    folder = _made(_new_folder(out_dir, f"reproduction-{seed}"))

    from rich.progress import Progress

    from missions.reproduction.figures import draw_all
    from missions.reproduction.reproduce import reproduce as run_trials
    from missions.reproduction.tables import as_json, as_table

    started_s = time.perf_counter()
    with Progress(console=err, transient=True) as progress:
        bar = progress.add_task(f"{trials} trials a cell", total=1.0)
        exhibits = run_trials(trials, seed, lambda share: progress.advance(bar, share))
        progress.update(bar, description="pictures")
        pictures = draw_all(exhibits, folder, seed)
    data = as_json(exhibits, trials, seed)
    _write_text(folder / "reproduction.json", json.dumps(data, indent=2) + "\n")
    if json_output:
        out.print_json(data=data)
        return
    for exhibit in exhibits:
        out.print(as_table(exhibit), highlight=False)
        out.print()
    out.print(
        f"{trials} trials a cell or more in {time.perf_counter() - started_s:.0f} s; intervals are 95 %.\n"
        f"Written to {folder}: reproduction.json and {len(pictures)} pictures",
        highlight=False,
        soft_wrap=True,
    )


def _refuse(*faults: str) -> NoReturn:
    """Print one line per fault and leave with exit status 2."""
    for fault in faults:
        err.print(fault, highlight=False, markup=False, soft_wrap=True)
    sys.exit(USAGE_ERROR)


def _new_folder(given: Path | None, name: str) -> Path:
    """A folder that holds nothing yet: the given one, or the next free one under runs/."""
    if given is not None:
        if given.exists() and not given.is_dir():
            _refuse(f"--out: {given} is a file; allowed is a new or an empty folder")
        if given.is_dir() and any(given.iterdir()):
            _refuse(f"--out: {given} is not empty; allowed is a new or an empty folder")
        return given
    folder, count = Path("runs") / name, 1
    while folder.exists():
        count += 1
        folder = Path("runs") / f"{name}-{count}"
    return folder


def _made(folder: Path) -> Path:
    """The folder, made where it is not there yet."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        _refuse(f"--out: {folder} cannot be made ({error.strerror}); allowed is a folder that can be written to")
    return folder


def _tell_where(folder: Path) -> None:
    out.print(f"Written to {folder}: log.npz, report.json, mission.rrd", highlight=False, soft_wrap=True)
    out.print(f"Look at it with: pdpatrol replay {folder}", highlight=False, soft_wrap=True)


def _write_text(path: Path, text: str) -> None:
    temporary = path.with_name(path.name + ".tmp")
    temporary.write_text(text, encoding="utf-8")
    temporary.replace(path)


def _first_line(path: Path) -> str:
    with path.open(encoding="utf-8") as file:
        return file.readline().lstrip("# ").strip()


def _summary(report: dict[str, Any], ending: str) -> str:
    missed = report["waypoints"]["missed"]
    parts = [
        f"{ending} after {report['sim_time_s']:.0f} s simulated in {report['wall_time_s']:.1f} s",
        f"{report['distance_m']:.0f} m driven",
        f"{report['n_bearings']} bearings",
        f"{report['collisions']} collisions",
        f"waypoints missed: {', '.join(map(str, missed)) or 'none'}",
    ]
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
        with Progress(*columns, console=err, transient=True) as progress:
            bar = progress.add_task("start", total=1.0, clock="")
            told = 0

            def follow(mission: Mission) -> None:
                nonlocal told
                events = mission.log.table("event", told)
                for kind, text in zip(events["kind"], events["text"], strict=True):
                    if kind in ("candidate", "confirmed", "outside", "contact"):
                        progress.console.print(
                            f"{mission.time_s:6.1f} s  {kind}: {text}", highlight=False, markup=False
                        )
                told += events["kind"].size
                stops = len(mission.site_map.route.waypoints_m) + 1
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
