"""`pdpatrol replay`: show recordings."""

from pathlib import Path
from typing import Annotated

import tyro
from pydantic import Field

from pdpatrol.missions.atomic_file import atomic_file
from pdpatrol.missions.cli.arguments import Flag, optional
from pdpatrol.missions.cli.mission_files import write_mission
from pdpatrol.missions.cli.report import refused_if_damaged
from pdpatrol.missions.cli.terminal import err, note, progress_bar, refuse, say
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.runner import run_mission
from pdpatrol.missions.sweep.dataset import Dataset
from pdpatrol.missions.sweep.plan import digest_of_code
from pdpatrol.missions.video import write_video


def replay(
    folders: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="DIR [DIR ...]", help_behavior_hint="(required)")],
    /,
    *,
    row: Annotated[tyro.conf.UseAppendAction[tuple[int, ...]], tyro.conf.arg(metavar="NUMBER")] = (),
    web: Flag = False,
    port: Annotated[int | None, optional("NUMBER"), Field(ge=1, le=65534)] = None,
    screenshot: Annotated[Path | None, optional("FILE.png")] = None,
    at: Annotated[float | None, optional("SECONDS"), Field(ge=0, allow_inf_nan=False)] = None,
    video: Annotated[Path | None, optional("FILE.mp4|FILE.gif")] = None,
    pace: Annotated[float | None, optional("FACTOR"), Field(ge=0.1, le=1000)] = None,
) -> None:
    """Open the recordings of one or several missions in the Rerun viewer.

    The recording of each mission is made from its log.

    Args:
        folders: Folders of missions.
        row: Number of a mission in the dataset of a sweep, whose folder is given. The mission is run again, and its
            files are kept in that folder. May be given several times.
        web: Serve the recordings to a browser on this machine (127.0.0.1) instead.
        port: Port of the page of --web; its data come from the next port. Default: two free ports.
        screenshot: Write a picture of the viewer instead, without opening it; no screen is needed.
        at: Simulated time that the picture shows. Default: the end.
        video: Write a video instead: the robot as it drives, next to the plan at that time, and a closing card.
            MP4 needs ffmpeg, or the extra `video`.
        pace: Simulated seconds per second of the video. Default: the video lasts 20 s.
    """
    n_missions = max(len(row), len(folders))
    if not folders:
        refuse("DIR: at least one folder must be given, got none")
    if row and len(folders) > 1:
        refuse(f"--row needs one folder, that of a sweep, got {len(folders)}")
    for option, file, endings in (("--screenshot", screenshot, (".png",)), ("--video", video, (".mp4", ".gif"))):
        if file is None:
            continue
        if n_missions > 1:
            refuse(f"{option} needs one mission, got {n_missions}")
        if file.suffix.lower() not in endings or file.exists() or not file.parent.is_dir():
            refuse(f"{option} must be a new {' or '.join(endings)} file in an existing folder, got {file}")
    if at is not None and screenshot is None:
        refuse("--at needs --screenshot")
    if port is not None and not web:
        refuse("--port needs --web")
    if pace is not None and video is None:
        refuse("--pace needs --video")
    if row:
        folders = tuple(_run_again(sweep, number) for number in row for sweep in folders)
    logs = [MissionLog.load(folder) for folder in folders]
    if video is not None:
        _make_video(logs[0], video, pace)
        if screenshot is None:
            return
    # imported here, because a video does not need Rerun
    from pdpatrol.missions.recording import open_viewer, serve, take_screenshot, write_recording

    recordings = [folder / "mission.rrd" for folder in folders]
    for log, recording in zip(logs, recordings, strict=True):
        with refused_if_damaged(recording.parent):
            write_recording(log, recording, lists_recordings=len(logs) > 1)
    if screenshot is not None:
        end_s = float(logs[0].column("step", "time_s").max(initial=0.0))
        with err.status("The viewer draws"), atomic_file(screenshot) as temporary:
            temporary.write_bytes(take_screenshot(recordings[0], end_s if at is None else at))
        say(f"Written: {screenshot}")
    elif web:
        serve(recordings, lambda url: say(f"Serving at {url}  (Ctrl-C ends it)"), port)
    else:
        open_viewer(recordings)


def _make_video(log: MissionLog, video: Path, pace: float | None) -> None:
    """Write a video of a mission."""
    with progress_bar() as progress:
        bar = progress.add_task("video", total=1.0)
        try:
            write_video(log, video, pace, lambda share: progress.update(bar, completed=share))
        except ValueError as error:
            refuse(f"--video: {error}")
    say(f"Written: {video}")


def _run_again(folder: Path, row: int) -> Path:
    """Return the folder of one mission of a sweep, after running it if it has not been kept."""
    dataset = Dataset(folder)
    job = dataset.job(row)
    if dataset.manifest.code != digest_of_code():
        note("the sweep was made with a different version; results may differ")
    mission = folder / "missions" / str(row)
    if not (mission / "log.npz").exists():
        with err.status(f"{job.scenario.name}, {job.policy}, seed {job.seed} runs again"):
            log = run_mission(job.scenario, job.policy, job.seed)
            mission.mkdir(parents=True, exist_ok=True)
            write_mission(log, 0.0, mission)
    return mission
