"""`pdpatrol replay`: look at a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro

from missions.cli.terminal import out, refuse


def replay(folder: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="DIR")], *, web: bool = False) -> None:
    """Open the recording of a mission in the Rerun viewer.

    Args:
        folder: Folder of a mission; where it has no mission.rrd, the recording is made from its log.
        web: Serve it to a browser on this machine (127.0.0.1) instead.
    """
    if not folder.is_dir():
        refuse(f"{folder}: no such folder; give the folder of a mission")
    from missions.record.mission_log import MissionLog
    from missions.recording import open_viewer, serve, write_recording

    recording = folder / "mission.rrd"
    if not recording.exists():
        try:
            write_recording(MissionLog.load(folder), recording)
        except (FileNotFoundError, ValueError) as error:
            refuse(str(error))
    if not web:
        open_viewer(recording)
        return
    serve(recording, lambda url: out.print(f"Serving at {url}  (Ctrl-C ends it)", highlight=False, soft_wrap=True))
