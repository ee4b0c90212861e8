"""One picture of a film: camera left, plan right, words above and below."""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from dirmusic.locating.finding import ellipse95, outline95
from dirmusic.locating.yard_likelihood import Grid
from pdpatrol.missions.video.moments import Moment
from pdpatrol.robot_models.posed_yard import Picture, on_picture

FloatArray = NDArray[np.float64]

WIDTH, HEIGHT, DPI = 1280, 640, 100
"""Of a frame, pixels."""

CAMERA = (620, 500)
"""Width and height of the picture of the camera, pixels."""

GAP, STRIP = 10, 70
"""Width between the pictures, and height of the strips above and below them, pixels."""

PLAN = (WIDTH - CAMERA[0] - GAP, CAMERA[1])
"""Width and height of the plan, pixels."""

GROUND, PAPER, FAINT = "#12161c", "#eef1f4", "#93a0ad"
STATE_COLOURS = {"candidate": "#ffb228", "confirmed": "#2fe07a", "outside": "#c0c4cc"}
RAY, WAY, ROBOT = "#fff08a", "#4ea8ff", "#ffffff"
HEAT = LinearSegmentedColormap.from_list("heat", [(1.0, 0.45, 0.1, 0.0), (1.0, 0.5, 0.1, 0.5), (1.0, 0.8, 0.3, 0.75)])
LEAST_PEAK = 50.0
"""Log-likelihood drawn strongest until there is more: of some ten pulses from as many places."""

RAY_M = 60.0
MOST_ELLIPSE_M = 12.0
"""Longer half-axis of the largest ellipse that is drawn."""

STROKE = [withStroke(linewidth=2.5, foreground="#12161c")]
ARROW_M = np.array([[0.95, 0.0], [-0.65, 0.6], [-0.3, 0.0], [-0.65, -0.6], [0.95, 0.0]])
"""Outline of the robot on the plan, larger than it is."""


class Frame:
    """A figure whose content is renewed from moment to moment.

    Args:
        title: In the strip above.
        plan: The yard from above.
        middle_m: Point of the ground in the middle of the plan.
        half_m: Half of what the plan shows, along its width and height.
        stops_m: Of the planned route, from the dock on, shape (n, 2).
        grid: Of the likelihood over the yard; None where there is none.
    """

    def __init__(
        self,
        title: str,
        plan: Picture,
        middle_m: FloatArray,
        half_m: FloatArray,
        stops_m: FloatArray,
        grid: Grid | None,
    ) -> None:
        self._middle_m, self._grid = middle_m, grid
        self.figure = plt.figure(figsize=(WIDTH / DPI, HEIGHT / DPI), dpi=DPI, facecolor=GROUND)
        words: dict[str, Any] = {"color": PAPER, "va": "center", "parse_math": False}
        self.figure.text(20 / WIDTH, 1 - 0.5 * STRIP / HEIGHT, title, fontsize=15, weight="bold", **words)
        self._clock = self.figure.text(
            1 - 20 / WIDTH, 1 - 0.5 * STRIP / HEIGHT, "", fontsize=15, ha="right", family="monospace", **words
        )
        self._doing = self.figure.text(20 / WIDTH, 0.5 * STRIP / HEIGHT, "", fontsize=13, **words)
        self._news = self.figure.text(1 - 20 / WIDTH, 0.5 * STRIP / HEIGHT, "", fontsize=13, ha="right", **words)
        left = self.figure.add_axes((0.0, STRIP / HEIGHT, CAMERA[0] / WIDTH, CAMERA[1] / HEIGHT))
        left.set_axis_off()
        self._camera = left.imshow(np.zeros((CAMERA[1], CAMERA[0], 3), np.uint8), aspect="auto")
        scale = min(PLAN[0] / half_m[0], PLAN[1] / half_m[1])
        width, height = scale * half_m
        right = self.figure.add_axes(
            (
                (WIDTH - 0.5 * (PLAN[0] + width)) / WIDTH,
                (STRIP + 0.5 * (PLAN[1] - height)) / HEIGHT,
                width / WIDTH,
                height / HEIGHT,
            )
        )
        right.set_axis_off()
        extent = (-half_m[0], half_m[0], -half_m[1], half_m[1])
        right.imshow(plan // 2 + plan // 8, extent=extent, interpolation="nearest", aspect="auto")
        right.set(xlim=extent[:2], ylim=extent[2:])
        self._plan = right
        self._draw_stops(stops_m)
        self._moving: list[Any] = []

    def draw(self, moment: Moment, camera: Picture, doing: str, news: str) -> None:
        """Renew the content."""
        self._camera.set_data(camera)
        self._clock.set_text(f"{moment.time_s:5.1f} s")
        self._doing.set_text(doing)
        self._news.set_text(news)
        for artist in self._moving:
            artist.remove()
        self._moving = [*self._likelihood(moment), *self._rays(moment), *self._robot(moment), *self._findings(moment)]

    def _draw_stops(self, stops_m: FloatArray) -> None:
        for number, (x, y) in enumerate(on_picture(stops_m, self._middle_m)):
            self._plan.text(
                x, y, str(number or "dock"), color=FAINT, fontsize=9, ha="center", va="center", path_effects=STROKE
            )

    def _likelihood(self, moment: Moment) -> list[Any]:
        if moment.log_likelihood is None or self._grid is None:
            return []
        grid = self._grid
        value = moment.log_likelihood.reshape(grid.shape)
        share = np.square(np.clip(value / max(value.max(), LEAST_PEAK), 0.0, 1.0)).T
        corners = grid.corner_m + grid.cell_m * np.array([[-0.5, -0.5], np.array(grid.shape) - 0.5])
        (left, low), (right, high) = on_picture(corners, self._middle_m)
        extent = (left, right, low, high)
        return [
            self._plan.imshow(
                share, cmap=HEAT, vmin=0, vmax=1, origin="lower", extent=extent, aspect="auto", interpolation="bilinear"
            )
        ]

    def _rays(self, moment: Moment) -> list[Any]:
        start, towards, freshness = moment.rays
        ahead = np.column_stack([np.cos(towards), np.sin(towards), np.zeros(towards.size)])
        foot = start * [1.0, 1.0, 0.0]
        lines = on_picture(np.stack([foot, foot + RAY_M * ahead], axis=1), self._middle_m)
        return [
            self._plan.plot(*line.T, color=RAY, linewidth=1.6, alpha=0.15 + 0.75 * float(fresh))[0]
            for line, fresh in zip(lines, freshness, strict=True)
        ]

    def _robot(self, moment: Moment) -> list[Any]:
        way = on_picture(moment.way_m, self._middle_m)
        x, y, yaw = moment.pose
        turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
        outline = on_picture(ARROW_M @ turn.T + [x, y], self._middle_m)
        return [
            *self._plan.plot(*way.T, color=WAY, linewidth=2.2, solid_capstyle="round"),
            *self._plan.fill(*outline.T, facecolor=ROBOT, edgecolor=GROUND, linewidth=1.2, zorder=5),
        ]

    def _findings(self, moment: Moment) -> list[Any]:
        drawn: list[Any] = []
        for finding in moment.findings:
            colour = STATE_COLOURS[finding.state]
            covariance = finding.covariance_m2[:2, :2]
            if ellipse95(covariance).semi_major_m <= MOST_ELLIPSE_M:
                outline = outline95(finding.position_m[:2], covariance, 60)
                height = np.full((60, 1), finding.position_m[2])
                line = on_picture(np.hstack([outline, height]), self._middle_m)
                drawn += self._plan.plot(*line.T, color=colour, linewidth=2.0, zorder=6)
            x, y = on_picture(finding.position_m, self._middle_m)
            drawn += self._plan.plot(x, y, "o", color=colour, markersize=7, markeredgecolor=GROUND, zorder=7)
            name = f"{'finding' if finding.state == 'confirmed' else finding.state} {finding.id}"
            is_right = x > 0.5 * self._plan.get_xlim()[1]
            drawn.append(
                self._plan.annotate(
                    name,
                    (x, y),
                    xytext=(-10 if is_right else 10, 8),
                    textcoords="offset points",
                    ha="right" if is_right else "left",
                    color=colour,
                    fontsize=12,
                    weight="bold",
                    path_effects=STROKE,
                    annotation_clip=True,
                    zorder=8,
                )
            )
        return drawn
