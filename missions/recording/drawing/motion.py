"""The robot, its trails, its commands and its battery."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from pdpatrol.missions.recording import paths
from pdpatrol.missions.recording.drawing import palette
from pdpatrol.missions.recording.drawing.canvas import Canvas, Slice

FloatArray = NDArray[np.float64]

TRAIL_HEIGHT_M = {paths.TRAJECTORY: 0.06, paths.TRUE_TRAJECTORY: 0.04, paths.ODOMETRY: 0.03}


class Motion:
    """Draws where the robot is and has been.

    A trail is a short line for each bin; the views show those of all the time before.

    Args:
        canvas: What to draw on.
    """

    def __init__(self, canvas: Canvas) -> None:
        self._canvas = canvas
        self._trail_end: dict[str, FloatArray] = {}
        ahead = rr.Arrows3D(origins=[[0.7, 0.0, 1.5]], vectors=[[2.0, 0.0, 0.0]], radii=[0.22], colors=[palette.MARKER])
        canvas.still(paths.MARKER, ahead)
        # a viewer's camera follows what has a shape of its own
        canvas.still(paths.ROBOT, rr.Points3D([[0.0, 0.0, 0.0]], radii=[0.05], colors=[palette.ROBOT]))
        styles = {
            paths.TRAJECTORY: (palette.TRAJECTORY, 1.5),
            paths.ODOMETRY: (palette.ODOMETRY, 0.8),
            paths.TRUE_TRAJECTORY: (palette.TRUTH, 0.8),
        }
        for path, (colour, width) in styles.items():
            canvas.still(path, rr.LineStrips3D.from_fields(colors=[colour], radii=rr.Radius.ui_points([width])))
        canvas.still(paths.COMMAND, rr.SeriesLines(names=["speed (m/s)", "yaw rate (rad/s)"]))

    def draw(self, part: Slice) -> None:
        """Draw the steps of a slice."""
        steps, pose = part.steps, part.step["pose"]
        half = 0.5 * pose[:, 2]
        turn = np.column_stack([np.zeros((steps.size, 2)), np.sin(half), np.cos(half)])
        place = rr.Transform3D.columns(translation=_on_ground(pose), quaternion=turn)
        self._canvas.columns(paths.ROBOT, steps, place)
        for path, column in (
            (paths.TRAJECTORY, "pose"),
            (paths.TRUE_TRAJECTORY, "true_pose"),
            (paths.ODOMETRY, "odometry"),
        ):
            self._draw_trail(path, part.bin_ends, part.at(column, part.bin_ends))
        ends = part.bin_ends
        command = part.at("command", ends)
        given = np.isfinite(command).all(axis=-1)
        pairs = rr.Scalars.columns(scalars=command[given].ravel()).partition([2] * int(given.sum()))
        self._canvas.columns(paths.COMMAND, ends[given], pairs)
        left = part.at("battery", ends)
        known = np.isfinite(left)
        self._canvas.columns(paths.BATTERY, ends[known], rr.Scalars.columns(scalars=100.0 * left[known]))

    def _draw_trail(self, path: str, ends: NDArray[np.intp], pose: FloatArray) -> None:
        known = np.isfinite(pose).all(axis=-1)
        if not known.any():
            return
        place = _on_ground(pose[known]) + np.array([0.0, 0.0, TRAIL_HEIGHT_M[path]])
        before = np.concatenate([self._trail_end.get(path, place[:1]), place[:-1]])
        self._trail_end[path] = place[-1:]
        strips = np.stack([before, place], axis=1).astype(np.float32)
        self._canvas.columns(path, ends[known], rr.LineStrips3D.columns(strips=strips))


def _on_ground(pose: FloatArray) -> FloatArray:
    return np.column_stack([pose[:, :2], np.zeros(len(pose))])
