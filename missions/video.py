"""Films of missions: the robot in its yard next to the plan, from the log alone."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap, to_rgba
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.signal import lfilter

from pdpatrol.envs.scenario import restore_scenario
from pdpatrol.missions.atomic_file import atomic_file
from pdpatrol.missions.planning.plan import with_planned_route
from pdpatrol.missions.record.events import Phase
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.figures import ROUTE, STATES, draw_finding, draw_ground, draw_waypoints, draw_yard
from pdpatrol.missions.report.make_report import findings_at, likelihood_shares, make_report
from pdpatrol.missions.report.wording import outcome_text, phase_text, title_text
from pdpatrol.robot_models.antenna_elements import AntennaElements
from pdpatrol.robot_models.rendering import DrawnBall, DrawnLine, PosedYard
from pdpatrol.robot_models.world import build_spec

FloatArray = NDArray[np.float64]

CLIP_S, END_S = 18.0, 2.0
"""Duration of a film at its default pace, and how long its last frame stays."""

FRAMES_PER_S, DPI = {".mp4": 12, ".gif": 8}, {".mp4": 100, ".gif": 75}
"""Frame rate and resolution; GIF files are large."""

MIN_PULSE_S, MAX_BEARINGS = 1.5, 10
"""Simulated time for which a bearing is drawn, and the largest number drawn at once."""

CAMERA_DELAY_S = 1.2
"""Time constant with which the camera follows the heading of the robot, in the film."""

BEARING = "#f39c12"
HEAT = LinearSegmentedColormap.from_list("heat", [(1.0, 0.6, 0.2, 0.0), (1.0, 0.5, 0.1, 0.4), (0.9, 0.3, 0.1, 0.6)])
ARROW_M = np.array([0.95, -0.65 + 0.6j, -0.3, -0.65 - 0.6j])
"""Outline of the robot on the plan as x + iy, ahead along x; larger than the robot."""


class FilmError(OSError):
    """Reason why this machine cannot make a film."""


def write_film(log: MissionLog, path: Path, pace: float | None, progress: Callable[[float], None]) -> None:
    """Write a film of a mission.

    Args:
        log: Log of a simulated mission.
        path: File to write; its name ends in .mp4 or .gif.
        pace: Simulated seconds per second of the film; None for a film of some 20 s.
        progress: Function called with the finished share.

    Raises:
        ValueError: If the log has no step or is not of a simulated mission.
        FilmError: If imageio, FFmpeg or OpenGL is missing.
        OSError: If the film cannot be written.
    """
    time_s = log.column("step", "time_s")
    if "scenario" not in log.meta or time_s.size == 0:
        raise ValueError("the log is not of a simulated mission; only a robot in its yard can be filmed")
    try:
        from imageio.v2 import get_writer  # an extra of the installation
    except ImportError:
        raise FilmError('imageio is missing; install it: pip install "pdpatrol[video]"') from None
    kind = path.suffix.lower()
    rate = FRAMES_PER_S[kind]
    pace = pace or max(float(time_s[-1]) / CLIP_S, 1.0)
    steps = np.append(np.searchsorted(time_s, np.arange(time_s[0], time_s[-1], pace / rate)), time_s.size - 1)
    options: dict[str, Any] = {"duration": 1000.0 / rate, "loop": 0} if kind == ".gif" else {"fps": rate}
    with TemporaryDirectory() as folder:  # the encoder takes the format from the name of the file
        file = Path(folder) / f"film{kind}"
        writer: Any
        try:
            with get_writer(file, **options) as writer:
                frames = film_frames(log, steps, 1.0 / rate, max(MIN_PULSE_S, pace / rate), DPI[kind])
                for number, image in enumerate(frames, start=1):
                    for _ in range(1 if number < steps.size else round(END_S * rate)):
                        writer.append_data(image)
                    progress(number / steps.size)
        except RuntimeError as error:
            raise FilmError(str(error)) from None
        with atomic_file(path) as temporary:
            shutil.copyfile(file, temporary)


def film_frames(
    log: MissionLog, steps: NDArray[np.intp], frame_s: float, pulse_s: float, dpi: int
) -> Iterator[NDArray[np.uint8]]:
    """Yield the pixels of each frame, shape (height, width, 3).

    Args:
        log: Log of a simulated mission with at least one step.
        steps: Step that each frame shows, shape (n_frames,).
        frame_s: Duration of a frame.
        pulse_s: Simulated time for which a bearing is drawn.
        dpi: Pixels per inch of 12.8 by 6.4 inches.

    Raises:
        RuntimeError: If OpenGL is not available.
    """
    scenario = with_planned_route(restore_scenario(log.meta["scenario"]))
    array = scenario.array.nominal_elements()
    elements = AntennaElements(array.positions_m, array.boresights_rad, array.boresight_elevations_rad)
    array_height_m = float(np.mean(np.asarray(array.positions_m)[:, 2]))
    look_rad = smooth_yaw(log.column("step", "true_pose")[steps, 2], frame_s)
    figure = Figure(figsize=(12.8, 6.4), dpi=dpi, layout="constrained")
    canvas = FigureCanvasAgg(figure)
    camera, plan = figure.subplots(1, 2)
    camera.set_axis_off()
    draw_ground(plan, np.full(2, -1.0), np.asarray(scenario.yard.size_m) + 1.0)
    draw_yard(plan, scenario.yard)
    draw_waypoints(plan, log.meta["route"])
    moving: list[Any] = []
    with closing(PosedYard(build_spec(scenario.robot.description, scenario.yard, elements), 620, 500)) as yard:
        for step, yaw_rad in zip(steps.tolist(), look_rad.tolist(), strict=True):
            for artist in moving:
                artist.remove()
            row = {name: column[0] for name, column in log.table("step", step, step + 1).items()}
            pose, age_s, bearing_rad = latest_bearings(log, step, pulse_s)
            start_m = np.column_stack([pose[:, :2], np.full(len(pose), array_height_m)])
            ahead = np.column_stack([np.cos(bearing_rad), np.sin(bearing_rad), np.zeros(len(pose))])
            colours = [to_rgba(BEARING, 0.9 - 0.75 * age / pulse_s) for age in age_s.tolist()]
            findings = findings_at(log, step + 1, *STATES)
            yard.put(row["true_pose"])
            image = yard.from_behind(
                yaw_rad,
                [
                    DrawnLine(a + 0.3 * d, a + 40.0 * d, c, 0.008)
                    for a, d, c in zip(start_m, ahead, colours, strict=True)
                ],
                [
                    DrawnBall(place_m, 0.22, to_rgba(STATES[state][0], 0.9))
                    for place_m, state in zip(findings["position_m"], findings["state"].tolist(), strict=True)
                ],
            )
            rays = np.stack([start_m, start_m + 60.0 * ahead], axis=1)[..., :2]
            x, y, heading_rad = row["pose"]
            outline = complex(x, y) + ARROW_M * np.exp(1j * heading_rad)
            path_m = log.column("step", "pose", 0, step + 1)[:, :2]
            moving = [
                camera.imshow(image),
                *_draw_likelihood(plan, log, step),
                *plan.plot(*path_m.T, color=ROUTE, linewidth=2.0, zorder=4),
                plan.add_collection(LineCollection(list(rays), colors=colours, linewidths=1.6, zorder=5)),
                *plan.fill(outline.real, outline.imag, color="#1c2833", zorder=8),
            ]
            for finding in zip(
                *(findings[name] for name in ("id", "state", "position_m", "covariance_m2")), strict=True
            ):
                moving += draw_finding(plan, *finding)
            is_last = step == log.n_rows("step") - 1
            doing = (
                outcome_text(make_report(log, 0.0)) if is_last else phase_text(Phase(row["phase"], row["phase_target"]))
            )
            figure.suptitle(f"{title_text(log.meta)}, {row['time_s']:.1f} s: {doing}", fontsize=15, parse_math=False)
            n_events = log.n_rows("event") if is_last else log.rows_before("event", step + 1)
            event = log.column("event", "text", 0, n_events)[-1:].tolist()
            figure.supxlabel(*event or [" "], fontsize=13, parse_math=False)
            canvas.draw()
            yield np.asarray(canvas.buffer_rgba())[..., :3].copy()


def _draw_likelihood(plan: Any, log: MissionLog, step: int) -> Iterator[Any]:  # noqa: ANN401 - Matplotlib axes
    """Draw the latest likelihood of a source on the ground."""
    row = log.rows_before("likelihood", step + 1) - 1
    if row >= 0:
        grid, share = likelihood_shares(log.meta, log.column("likelihood", "log_likelihood", row, row + 1)[0])
        (left, bottom), (right, top) = grid.corner_m, grid.corner_m + grid.cell_m * np.array(grid.shape)
        yield plan.imshow(
            share.T, cmap=HEAT, vmin=0, vmax=1, origin="lower", extent=(left, right, bottom, top), zorder=3
        )


def latest_bearings(log: MissionLog, step: int, max_age_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return poses (n, 3), ages (n,) and bearings (n,) of the latest pulses up to a step."""
    stop = log.rows_before("bearing", step + 1)
    start = max(stop - MAX_BEARINGS, 0)
    pulse_step = log.column("pulse", "step")[log.column("bearing", "pulse", start, stop)]
    time_s, pose = log.column("step", "time_s", 0, step + 1), log.column("step", "pose", 0, step + 1)
    age_s = time_s[step] - time_s[pulse_step]
    recent = age_s <= max_age_s
    return pose[pulse_step[recent]], age_s[recent], log.column("bearing", "bearing_rad", start, stop)[recent]


def smooth_yaw(yaw_rad: FloatArray, frame_s: float) -> FloatArray:
    """Return the heading of the camera at each frame, shape (n,): that of the robot without its quick turns."""
    unwrapped, decay = np.unwrap(yaw_rad), np.exp(-frame_s / CAMERA_DELAY_S)
    offset_rad = unwrapped - unwrapped[0]
    return unwrapped[0] + np.asarray(lfilter([1.0 - decay], [1.0, -decay], offset_rad))
