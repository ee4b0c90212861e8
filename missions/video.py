"""Films of missions: the robot in its yard next to the plan, from the log alone."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap, to_rgb, to_rgba
from matplotlib.figure import Figure
from numpy.typing import NDArray

from dirmusic.locating.finding import ellipse95, outline95
from pdpatrol.envs.scenario import restore_scenario
from pdpatrol.missions.atomic_file import atomic_file
from pdpatrol.missions.planning.plan import with_planned_route
from pdpatrol.missions.record.events import Phase
from pdpatrol.missions.record.log_contents import described_grid
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.figures import ROUTE, STATES, draw_ground, draw_label, draw_waypoints, draw_yard
from pdpatrol.missions.report.make_report import findings_at, make_report
from pdpatrol.missions.report.wording import outcome_text, phase_text, title_text
from pdpatrol.robot_models.antenna.elements import AntennaElements
from pdpatrol.robot_models.posed_yard import Ball, Line, PosedYard
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
ARROW_M = np.array([[0.95, 0.0], [-0.65, 0.6], [-0.3, 0.0], [-0.65, -0.6]])
"""Outline of the robot on the plan, larger than the robot."""


class FilmError(OSError):
    """Reason why this machine cannot make a film."""


def write_film(
    log: MissionLog, path: Path, pace: float | None = None, progress: Callable[[float], None] = lambda share: None
) -> None:
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
        try:
            film = Film(log, steps, 1.0 / rate, max(MIN_PULSE_S, pace / rate), DPI[kind])
            with closing(film.yard), get_writer(Path(folder) / f"film{kind}", **options) as writer:
                for frame in range(steps.size):
                    image = film.draw(frame)
                    for _ in range(round(END_S * rate) if frame == steps.size - 1 else 1):
                        writer.append_data(image)  # type: ignore[attr-defined]
                    progress((frame + 1) / steps.size)
        except RuntimeError as error:
            raise FilmError(str(error)) from None
        with atomic_file(path) as temporary:
            shutil.copyfile(Path(folder) / f"film{kind}", temporary)


class Film:
    """Frames of a film.

    Args:
        log: Log of a simulated mission with at least one step.
        steps: Step that each frame shows, shape (n_frames,).
        frame_s: Duration of a frame.
        pulse_s: Simulated time for which a bearing is drawn.
        dpi: Pixels per inch of 12.8 by 6.4 inches.

    Raises:
        RuntimeError: If there is no OpenGL to draw with.
    """

    def __init__(self, log: MissionLog, steps: NDArray[np.intp], frame_s: float, pulse_s: float, dpi: int) -> None:
        scenario = with_planned_route(restore_scenario(log.meta["scenario"]))
        array = scenario.array.nominal_elements()
        elements = AntennaElements.checked(array.positions_m, array.boresights_rad, array.boresight_elevations_rad)
        self.yard = PosedYard(build_spec(scenario.robot.description, scenario.yard, elements), 620, 500)
        self._log, self._steps, self._pulse_s = log, steps, pulse_s
        self._array_height_m = float(np.mean(np.asarray(array.positions_m)[:, 2]))
        self._look_rad = smooth_yaw(log.column("step", "true_pose")[steps, 2], frame_s)
        self._outcome = outcome_text(make_report(log, 0.0))
        self._figure = Figure(figsize=(12.8, 6.4), dpi=dpi, facecolor="white")
        self._canvas = FigureCanvasAgg(self._figure)
        self._camera = self._figure.add_axes((0.01, 0.11, 0.484, 0.78))
        self._camera.set_axis_off()
        self._plan = self._figure.add_axes((0.54, 0.14, 0.45, 0.75))
        draw_ground(self._plan, np.full(2, -1.0), np.asarray(scenario.yard.size_m) + 1.0)
        draw_yard(self._plan, scenario.yard)
        draw_waypoints(self._plan, log.meta["route"])
        self._figure.text(0.016, 0.945, title_text(log.meta), fontsize=15, weight="bold", va="center", parse_math=False)
        style: dict[str, Any] = {"fontsize": 13, "va": "center", "parse_math": False}
        self._clock = self._figure.text(0.984, 0.945, "", ha="right", family="monospace", **style)
        self._phase = self._figure.text(0.016, 0.055, "", **style)
        self._event = self._figure.text(0.984, 0.055, "", ha="right", **style)
        self._moving: list[Any] = []

    def draw(self, frame: int) -> NDArray[np.uint8]:
        """Draw a frame and return its pixels, shape (height, width, 3)."""
        log, step = self._log, int(self._steps[frame])
        row = {name: column[0] for name, column in log.table("step", step, step + 1).items()}
        for artist in self._moving:
            artist.remove()
        pose, age_s, bearing_rad = latest_bearings(log, step, self._pulse_s)
        ahead = np.column_stack([np.cos(bearing_rad), np.sin(bearing_rad)])
        opacity = 0.15 + 0.75 * (1.0 - age_s / self._pulse_s)
        findings = findings_at(log, step + 1, *STATES)
        colours = [STATES[str(state)][0] for state in findings["state"]]
        lines: list[Line] = []
        for (x, y, _), (across, up), share in zip(pose, ahead, opacity, strict=True):
            start, direction = np.array([x, y, self._array_height_m]), np.array([across, up, 0.0])
            rgba = (*to_rgb(BEARING), float(share))
            lines.append(Line(start + 0.3 * direction, start + 40.0 * direction, rgba, 0.008))
        balls = [
            Ball(position_m, 0.22, to_rgba(colour, 0.9))
            for position_m, colour in zip(findings["position_m"], colours, strict=True)
        ]
        self.yard.put(row["true_pose"])
        image = self.yard.from_behind(float(self._look_rad[frame]), lines, balls)
        rays = np.stack([pose[:, :2], pose[:, :2] + 60.0 * ahead], axis=1)
        colour = [to_rgba(BEARING, float(share)) for share in opacity]
        turn = np.array(
            [[np.cos(row["pose"][2]), -np.sin(row["pose"][2])], [np.sin(row["pose"][2]), np.cos(row["pose"][2])]]
        )
        self._moving = [
            self._camera.imshow(image, aspect="auto"),
            *self._plan.plot(*log.column("step", "pose", 0, step + 1)[:, :2].T, color=ROUTE, linewidth=2.0, zorder=4),
            *self._plan.fill(*(ARROW_M @ turn.T + row["pose"][:2]).T, color="#1c2833", zorder=8),
            self._plan.add_collection(LineCollection(list(rays), colors=colour, linewidths=1.6, zorder=5)),
            *self._draw_likelihood(step),
        ]
        for k, colour in enumerate(colours):
            position_m, covariance_m2 = findings["position_m"][k][:2], findings["covariance_m2"][k][:2, :2]
            self._moving += self._plan.plot(*position_m, "+", color=colour, zorder=7)
            self._moving.append(
                draw_label(self._plan, str(findings["id"][k]), position_m, (10, 10), str(findings["state"][k]))
            )
            if ellipse95(covariance_m2).semi_major_m <= 12.0:  # a larger one would hide the yard
                self._moving += self._plan.plot(*outline95(position_m, covariance_m2, 60).T, color=colour, zorder=7)
        is_last = frame == self._steps.size - 1
        n_events = log.n_rows("event") if is_last else log.rows_before("event", step + 1)
        event = log.column("event", "text", max(n_events - 1, 0), n_events)
        self._clock.set_text(f"{row['time_s']:.1f} s")
        phase = phase_text(Phase(str(row["phase"]), int(row["phase_target"])))
        self._phase.set_text(self._outcome if is_last else phase)
        self._event.set_text(str(event[0]) if event.size else "")
        self._canvas.draw()
        return np.asarray(self._canvas.buffer_rgba())[..., :3].copy()

    def _draw_likelihood(self, step: int) -> list[Any]:
        """Draw the latest likelihood of a source on the ground."""
        row = self._log.rows_before("likelihood", step + 1) - 1
        if row < 0:
            return []
        grid = described_grid(self._log.meta["grid"])
        value = self._log.column("likelihood", "log_likelihood", row, row + 1)[0].reshape(grid.shape)
        share = np.square(np.clip(value / max(value.max(), 50.0), 0.0, 1.0)).T  # 50: ten pulses from ten places
        (left, bottom), (right, top) = grid.corner_m, grid.corner_m + grid.cell_m * np.array(grid.shape)
        extent = (left, right, bottom, top)
        style: dict[str, Any] = {"cmap": HEAT, "vmin": 0, "vmax": 1, "origin": "lower", "aspect": "equal"}
        return [self._plan.imshow(share, extent=extent, interpolation="bilinear", zorder=3, **style)]


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
    unwrapped = np.unwrap(yaw_rad)
    share, smooth = 1.0 - np.exp(-frame_s / CAMERA_DELAY_S), unwrapped.copy()
    for k in range(1, smooth.size):
        smooth[k] = smooth[k - 1] + share * (unwrapped[k] - smooth[k - 1])
    return smooth
