"""`pdpatrol replay`: look at a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro

from missions.cli.terminal import err, out, refuse, write_mission


def replay(
    folder: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="DIR")],
    *,
    row: int | None = None,
    web: bool = False,
) -> None:
    """Open the recording of a mission in the Rerun viewer.

    Args:
        folder: Folder of a mission; where it has no mission.rrd, the recording is made from its log.
        row: Number of a mission in the dataset of a sweep, whose folder is given: it is run again, and kept there.
        web: Serve it to a browser on this machine (127.0.0.1) instead.
    """
    if not folder.is_dir():
        refuse(f"{folder}: no such folder; give the folder of a mission")
    if row is not None:
        folder = _run_again(folder, row)
    from dirmusic import InputFileError
    from missions.record.mission_log import MissionLog
    from missions.recording import check_recording, open_viewer, serve, write_recording

    recording = folder / "mission.rrd"
    try:
        if not recording.exists():
            log = MissionLog.load(folder)
            try:
                write_recording(log, recording)
            except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError):
                refuse(f"{folder}: the facts in its log are damaged; give the folder that `pdpatrol run` wrote")
        check_recording(recording)
    except InputFileError as error:
        refuse(*error.faults)
    except (FileNotFoundError, ValueError) as error:
        refuse(str(error))
    if not web:
        open_viewer(recording)
        return
    serve(recording, lambda url: out.print(f"Serving at {url}  (Ctrl-C ends it)", soft_wrap=True))


def _run_again(folder: Path, row: int) -> Path:
    """The folder of one mission of a sweep, run again if it has not been yet."""
    from dirmusic import InputFileError
    from missions.sweep.code_version import digest_of_code
    from missions.sweep.dataset import Dataset

    try:
        dataset = Dataset(folder)
        job = dataset.job(row)
    except InputFileError as error:
        refuse(*error.faults)
    if dataset.manifest["code"] != digest_of_code():
        err.print("The sweep is of other code: the mission may end otherwise now", style="yellow")
    mission = folder / "missions" / str(row)
    if not (mission / "log.npz").exists():
        from missions.runner import run_mission

        with err.status(f"{job.scenario.name}, {job.policy}, seed {job.seed} runs again"):
            log = run_mission(job.scenario, job.policy, job.seed)
            mission.mkdir(parents=True, exist_ok=True)
            write_mission(log, 0.0, mission)
    return mission
