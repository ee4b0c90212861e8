"""Film to file: MP4 by ffmpeg, GIF by Pillow, both as matplotlib drives them."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import numpy as np
from matplotlib import rcParams
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter

from pdpatrol.missions.atomic_file import atomic_file
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.video.film import Film
from pdpatrol.missions.video.frame import DPI
from pdpatrol.missions.video.moments import STAYS_S

CLIP_S, END_S = 20.0, 2.0
"""How long a clip lasts unless a pace is given, and how long its last frame stays."""

FRAMES_PER_S = {".mp4": 12, ".gif": 8}
SCALE = {".mp4": 1.0, ".gif": 0.75}
"""A GIF is large: it has fewer and smaller frames."""


NO_ENCODER = (
    "no ffmpeg on this machine to write an MP4 with; install ffmpeg, or pdpatrol with its extra `video`, or give a "
    "name that ends in .gif"
)


class FilmError(OSError):
    """The machine cannot make the film; one line says why."""


def write_film(
    log: MissionLog, path: Path, pace: float | None = None, progress: Callable[[float], None] = lambda share: None
) -> None:
    """Write a film of a mission.

    Args:
        log: Of a simulated mission.
        path: Ends in .mp4 or .gif.
        pace: Simulated seconds in one of the clip; None for a clip of some 20 s.
        progress: Called with the share that is done.

    Raises:
        ValueError: If the log has no step, or is not of a simulated mission.
        FilmError: If the machine has no encoder, or nothing to draw with.
        OSError: If the film cannot be written.
    """
    kind = path.suffix.lower()
    writer = _writer(kind)
    time_s = log.column("step", "time_s")
    if "scenario" not in log.meta or time_s.size == 0:
        raise ValueError("the log is not of a simulated mission; only a robot in its yard can be filmed")
    pace = pace or max(float(time_s[-1]) / (CLIP_S - END_S), 1.0)
    frame_s = 1.0 / FRAMES_PER_S[kind]
    at_s = np.arange(float(time_s[0]), float(time_s[-1]), pace * frame_s)
    steps = np.append(np.searchsorted(time_s, at_s), time_s.size - 1)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"film{kind}"  # by its ending an encoder knows what to write
        try:
            film = Film(log, steps, frame_s, max(STAYS_S, pace * frame_s))
            try:
                with writer.saving(film.figure, str(file), DPI * SCALE[kind]):
                    for frame in range(steps.size):
                        film.draw(frame)
                        for _ in range(round(END_S / frame_s) if frame == steps.size - 1 else 1):
                            writer.grab_frame()
                        progress((frame + 1) / steps.size)
            finally:
                film.close()
        except RuntimeError as error:
            raise FilmError(str(error)) from None
        except subprocess.CalledProcessError:
            raise FilmError("ffmpeg could not write the film: no space left, or built without H.264") from None
        with atomic_file(path) as temporary:
            shutil.copyfile(file, temporary)


def _writer(kind: str) -> AbstractMovieWriter:
    """What encodes a kind of file."""
    if kind == ".gif":
        return PillowWriter(fps=FRAMES_PER_S[kind])
    if not FFMpegWriter.isAvailable():
        try:
            rcParams["animation.ffmpeg_path"] = import_module("imageio_ffmpeg").get_ffmpeg_exe()  # the extra `video`
        except (ImportError, RuntimeError):
            raise FilmError(NO_ENCODER) from None
    quality = ["-pix_fmt", "yuv420p", "-crf", "23", "-movflags", "+faststart"]
    return FFMpegWriter(fps=FRAMES_PER_S[kind], codec="h264", extra_args=quality)
