"""Films of missions: the robot in its yard next to the plan, from the log alone."""

import shutil
from collections.abc import Callable, Iterator
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from dirmusic.arrays import FloatArray, IntArray
from pdpatrol.envs.scenario import restore_scenario
from pdpatrol.envs.scenario.base import STEP_S
from pdpatrol.missions.atomic_file import atomic_file
from pdpatrol.missions.planning.plan import with_planned_route
from pdpatrol.missions.record.events import Phase
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.closing_card import closing_card
from pdpatrol.missions.report.figures import BEARING, STATES, draw_finding
from pdpatrol.missions.report.make_report import findings_at, make_report
from pdpatrol.missions.report.wording import phase_text, title_text
from pdpatrol.missions.yard_plan import ROUTE, draw_ground, draw_waypoints, draw_yard
from pdpatrol.robot_models.rendering import View, pictures_from_behind, pictures_of
from pdpatrol.robot_models.world import build_spec

CLIP_S = 20.0
"""Duration of a video at its default pace."""

OPENING_S, STILL_S, CARD_S = 1.5, 1.5, 4.0
"""Durations of the view of the whole yard, of the last frame, and of the closing card in a video."""

MAX_BEARINGS = 10
"""Largest number of bearings drawn at once."""


def write_video(log: MissionLog, path: Path, pace: float | None, progress: Callable[[float], None]) -> None:
    """Write a video of a mission.

    Args:
        log: Log of a simulated mission.
        path: File to write; its name ends in .mp4 or .gif.
        pace: Simulated seconds per second of the video; None for a video of about 20 s.
        progress: Function called with the finished share.

    Raises:
        ValueError: If the log has no step or is not of a simulated mission.
        ImportError: If imageio is missing.
        OSError: If FFmpeg or OpenGL is missing, or the video cannot be written.
    """
    time_s = log.column("step", "time_s")
    if "truth" not in log.meta or time_s.size == 0:
        raise ValueError("the log is not of a simulated mission; only a robot in its yard can be shown in a video")
    from imageio.v2 import get_writer  # an optional dependency

    kind, rate = path.suffix.lower(), 10
    dpi = 75 if kind == ".gif" else 100
    frame_s = (pace or max(time_s[-1] / CLIP_S, 1.0)) / rate
    steps = np.append(np.searchsorted(time_s, np.arange(time_s[0], time_s[-1], frame_s)), time_s.size - 1)
    options: dict[str, Any] = {"duration": 1000 / rate, "loop": 0} if kind == ".gif" else {"fps": rate}
    with TemporaryDirectory() as folder:  # the encoder chooses the format by the file name
        file = Path(folder) / f"video{kind}"
        writer: Any
        try:
            with get_writer(file, **options) as writer:
                frames = video_frames(log, steps, max(frame_s, 1.5), dpi=dpi)
                for number, image in enumerate(frames):
                    shown_s = {0: OPENING_S, steps.size: STILL_S}.get(number, 1 / rate)
                    for _ in range(round(shown_s * rate)):
                        writer.append_data(image)
                    progress(number / steps.size)
                card = closing_frame(log, dpi=dpi)
                for _ in range(round(CARD_S * rate)):
                    writer.append_data(card)
        except RuntimeError as error:
            raise OSError(str(error)) from None
        with atomic_file(path) as temporary:
            shutil.copyfile(file, temporary)


def video_frames(log: MissionLog, steps: IntArray, bearing_s: float, dpi: int) -> Iterator[NDArray[np.uint8]]:
    """Yield the pixels of each frame, shape (height, width, 3); the first shows the whole yard.

    Args:
        log: Log of a simulated mission.
        steps: Step that each frame shows, shape (n_frames,).
        bearing_s: Simulated time for which a bearing is drawn.
        dpi: Pixels per inch of 12.8 by 6.4 inches.

    Raises:
        RuntimeError: If OpenGL is not available.
    """
    scenario = with_planned_route(restore_scenario(log.meta["scenario"]))
    figure = Figure(figsize=(12.8, 6.4), dpi=dpi, layout="constrained")
    canvas = FigureCanvasAgg(figure)
    camera, plan = figure.subplots(1, 2)
    camera.set_axis_off()
    draw_ground(plan, log.meta["bounds_m"])
    draw_yard(plan, scenario.yard)
    draw_waypoints(plan, log.meta["route"], size_pt=9.0)
    table = log.table("step")
    pose, true_pose = table["pose"], table["true_pose"]
    # The camera follows the heading over about 4 s, without quick turns.
    view_rad = gaussian_filter1d(np.unwrap(true_pose[:, 2]), 2.0 / STEP_S, mode="nearest")
    model = build_spec(scenario.robot.description, scenario.yard).compile()
    model.joint("floating_base").qpos0[:2] = true_pose[steps[0], :2]
    low_m, high_m = np.array(log.meta["bounds_m"])
    middle_m = (*(0.5 * (low_m + high_m)).tolist(), 0.0)
    distance_m = 0.95 * float(np.hypot(*(high_m - low_m)))
    whole = View(middle_m, float(np.radians(-120.0)), float(np.radians(32.0)), distance_m)
    pictures = chain(pictures_of(model, [whole]), pictures_from_behind(model, true_pose[steps], view_rad[steps]))
    moving: list[Any] = []
    for step, picture in zip([steps[0], *steps.tolist()], pictures, strict=True):
        for artist in moving:
            artist.remove()
        from_m, bearing_rad = latest_bearings(log, step, bearing_s)
        to_m = from_m + 60.0 * np.column_stack([np.cos(bearing_rad), np.sin(bearing_rad)])
        x, y, heading_rad = pose[step]
        moving = [
            camera.imshow(picture),
            *plan.plot(*pose[: step + 1, :2].T, color=ROUTE, linewidth=2.0, zorder=4),
            *plan.plot(*np.stack([from_m, to_m]).transpose(2, 0, 1), color=BEARING, zorder=5),
            plan.arrow(x, y, np.cos(heading_rad), np.sin(heading_rad), width=0.3, color="#1c2833", zorder=8),
        ]
        findings = findings_at(log, step + 1, *STATES)
        for finding in zip(*(findings[name] for name in ("id", "state", "position_m", "covariance_m2")), strict=True):
            moving += draw_finding(plan, *finding)
        doing = phase_text(Phase(str(table["phase"][step]), int(table["phase_target"][step])))
        title = f"{title_text(log.meta)}, {table['time_s'][step]:.1f} s: {doing}"
        figure.suptitle(title, fontsize=15, parse_math=False)
        canvas.draw()
        yield np.asarray(canvas.buffer_rgba())[..., :3].copy()


def closing_frame(log: MissionLog, dpi: int) -> NDArray[np.uint8]:
    """Return the pixels of the closing card, shape (height, width, 3)."""
    card = closing_card(make_report(log, 0.0))
    figure = Figure(figsize=(12.8, 6.4), dpi=dpi, facecolor="white")
    canvas = FigureCanvasAgg(figure)
    style: Any = {"color": "#1c2833", "parse_math": False, "va": "top"}
    figure.text(0.06, 0.92, card.title, fontsize=30, fontweight="bold", **style)
    top, rows = 0.76, card.rows[:4]
    for row in rows:
        figure.text(0.06, top, f"{row.what}: {row.kind}", fontsize=18, fontweight="bold", **style)
        figure.text(0.06, top - 0.055, row.where, fontsize=16, **style)
        figure.text(0.06, top - 0.105, fill(f"{row.when}: {row.action}", 115), fontsize=14, **style)
        top -= 0.21
    more = f"{len(card.rows) - len(rows)} more in the report. " * (len(card.rows) > len(rows))
    figure.text(0.06, 0.06, f"{title_text(log.meta)}. {more}{card.remark}", fontsize=12, **style)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def latest_bearings(log: MissionLog, step: int, max_age_s: float) -> tuple[FloatArray, FloatArray]:
    """Return robot positions (n, 2) and bearings (n,) of the latest pulses up to a step."""
    stop = log.rows_before("bearing", step + 1)
    bearing = log.table("bearing", max(stop - MAX_BEARINGS, 0), stop)
    pulse_step, time_s = log.column("pulse", "step")[bearing["pulse"]], log.column("step", "time_s")
    recent = time_s[step] - time_s[pulse_step] <= max_age_s
    return log.column("step", "pose")[pulse_step[recent], :2], bearing["bearing_rad"][recent]
