"""Slices of a growing MissionLog to Rerun: the live view and the file are made by the same code."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from rerun.encodings import ImageFormat

from dirmusic.locating.ellipse import ellipse95, outline95
from missions.record.array_description import described_grid, described_manifold
from missions.record.mission_log import MissionLog
from missions.recording import blueprint as paths
from missions.recording.phase_view import draw_phase_patterns
from missions.recording.scene import COLOURS, log_scene
from missions.whole_file import whole_file

FloatArray = NDArray[np.float64]

RAY_M = 25.0
HOLD_STEPS = 10
"""How long a bearing and its spectrum stay after the last pulse: one second."""

TRAIL_STEPS = 5
"""Every how many steps of a mission the trail is drawn on; of field data, every one, while they are few."""

MOST_TRAILS, FEWER_TRAILS = 2000, 200
"""Field data of more steps than the first have no more drawings of the trail than the second: each is as long as the
trail is by then."""

MOST_TRAIL_POINTS = 20_000
"""Of one trail."""

SPECTRUM_AZIMUTHS_RAD = np.radians(np.arange(0.0, 361.0, 5.0))
SPECTRUM_RADIUS_M = (0.8, 3.0)
"""Ring radius where the pseudo-spectrum is 0 and where it is 1."""

OUTLINE_POINTS = 49
HEIGHT_M = 0.1
"""Above ground, where fixes and ellipses are drawn."""

MAX_DRAWN_ELLIPSE_M = 15.0
"""A longer ellipse would hide the yard; its fix is drawn as a point until it shrinks."""

LEAST_PEAK = 50.0
"""Log-likelihood that is drawn lightest until there is more: of some ten pulses from as many places."""

UNIT_SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])

QUIETEST_DBV = -60.0
"""Strengths below are drawn here: noise, and elements that look away."""


def write_recording(log: MissionLog, path: Path) -> None:
    """Write a whole recording, blueprint inside.

    Raises:
        OSError: If it cannot be written; a file that Rerun itself writes ends silently where the disk is full.
    """
    stream = rr.RecordingStream("pdpatrol")
    content = stream.binary_stream()
    time_s = log.column("step", "time_s")
    try:
        stream.send_blueprint(paths.blueprint(log.meta, float(time_s[-1]) if time_s.size else None))
        Recorder(stream, log).update()
    finally:
        recording = content.read(flush=True) or b""  # after an error too: Rerun warns of what nobody has read
        stream.disconnect()
    with whole_file(path) as temporary:
        temporary.write_bytes(recording)


class Recorder:
    """Sends what was added to a log since the last call.

    Args:
        stream: Where to.
        log: A mission's log, growing or whole.
    """

    def __init__(self, stream: rr.RecordingStream, log: MissionLog) -> None:
        self._stream = stream
        self._log = log
        self._sent = {"step": 0, "pulse": 0, "bearing": 0, "finding": 0, "likelihood": 0, "event": 0}
        self._trail = np.empty((0, 3))
        self._true_trail, self._odometry_trail = np.empty((0, 3)), np.empty((0, 3))
        self._last_detection = -10 * HOLD_STEPS
        self._phase = ""
        self._named: set[int] = set()
        n_steps = 0 if "scenario" in log.meta else log.n_rows("step")
        self._point_steps = -(-n_steps // MOST_TRAIL_POINTS) if n_steps else TRAIL_STEPS
        times = -(-n_steps // (FEWER_TRAILS * self._point_steps)) if n_steps > MOST_TRAILS else 1
        self._trail_steps = times * self._point_steps
        gain = described_manifold(log.meta["array"]).gain(SPECTRUM_AZIMUTHS_RAD)
        self._unit_gain = gain / np.linalg.norm(gain, axis=0)
        log_scene(stream, log.meta)

    def update(self) -> None:
        """Send the rows added since the last call."""
        new = {table: self._log.table(table, start) for table, start in self._sent.items()}
        first = dict(self._sent)
        self._sent = {table: self._log.n_rows(table) for table in self._sent}
        if new["step"]["time_s"].size:
            self._send_motion(new["step"], first["step"])
            self._send_detections(new, first)
        if new["finding"]["step"].size:
            self._send_findings(new["finding"])
        if new["likelihood"]["step"].size:
            self._send_likelihood(new["likelihood"])
        if new["event"]["step"].size:
            self._send_text(paths.EVENTS, new["event"]["step"], new["event"]["kind"], new["event"]["text"])
            if "end" in new["event"]["kind"]:
                draw_phase_patterns(self._stream, self._log)

    def _times(self, steps: NDArray[Any]) -> list[rr.TimeColumn]:
        time_s = self._log.column("step", "time_s")
        at = time_s[np.minimum(steps, time_s.size - 1)] if time_s.size else np.zeros(len(steps))
        return [rr.TimeColumn(paths.SIM_TIME, duration=at), rr.TimeColumn(paths.STEP, sequence=np.asarray(steps))]

    def _columns(self, path: str, steps: NDArray[Any], columns: Any) -> None:  # noqa: ANN401 - rerun's column lists
        rr.send_columns(path, indexes=self._times(steps), columns=columns, recording=self._stream)

    def _send_motion(self, step: dict[str, NDArray[Any]], first: int) -> None:
        n = step["time_s"].size
        steps = np.arange(first, first + n)
        pose, true_pose = step["pose"], step["true_pose"]
        place = np.column_stack([pose[:, :2], np.zeros(n)])
        half = 0.5 * pose[:, 2]
        turn = np.column_stack([np.zeros((n, 2)), np.sin(half), np.cos(half)])
        self._columns(paths.ROBOT, steps, rr.Transform3D.columns(translation=place, quaternion=turn))
        for name, values in zip(("speed", "yaw_rate"), step["command"].T, strict=True):
            if np.isfinite(values).all():
                self._columns(f"{paths.COMMAND}/{name}", steps, rr.Scalars.columns(scalars=values))
        self._trail = self._send_trail(paths.TRAJECTORY, steps, place, self._trail, 0.06)
        known = np.isfinite(true_pose).all(axis=-1)
        true_place = np.column_stack([true_pose[:, :2], np.zeros(n)])
        self._true_trail = self._send_trail(
            paths.TRUE_TRAJECTORY, steps[known], true_place[known], self._true_trail, 0.04
        )
        has_odometry = np.isfinite(step["odometry"]).all(axis=-1)
        by_odometry = np.column_stack([step["odometry"][:, :2], np.zeros(n)])
        self._odometry_trail = self._send_trail(
            paths.ODOMETRY, steps[has_odometry], by_odometry[has_odometry], self._odometry_trail, 0.03
        )
        charged = np.isfinite(step["battery"])
        if charged.any():
            left = rr.Scalars.columns(scalars=100.0 * step["battery"][charged])
            self._columns(paths.BATTERY, steps[charged], left)
        phases = [(s, p) for s, p in zip(steps, step["phase"], strict=True)]
        changed = [(s, p) for (s, p), (_, q) in zip(phases, [(0, self._phase), *phases[:-1]], strict=True) if p != q]
        self._phase = phases[-1][1]
        if changed:
            at, phase = zip(*changed, strict=True)
            self._columns(paths.PHASE, np.array(at), rr.StateChange.columns(state=[str(p) for p in phase]))

    def _send_trail(
        self, path: str, steps: NDArray[Any], place: FloatArray, trail: FloatArray, height_m: float
    ) -> FloatArray:
        """Draw the trail anew every few steps, from its start; returns it, longer."""
        chosen = steps[(is_point := steps % self._point_steps == 0)]
        grown = np.vstack([trail, place[is_point] + [0.0, 0.0, height_m]])
        drawn = np.flatnonzero(chosen % self._trail_steps == 0)
        if drawn.size:
            strips = [grown[: len(trail) + 1 + k] for k in drawn.tolist()]
            self._columns(path, chosen[drawn], rr.LineStrips3D.columns(strips=strips))
        return grown

    def _send_detections(self, new: dict[str, dict[str, NDArray[Any]]], first: dict[str, int]) -> None:
        n_steps = new["step"]["time_s"].size
        steps = np.arange(first["step"], first["step"] + n_steps)
        pulse, bearing = new["pulse"], new["bearing"]
        row = bearing["pulse"] - first["pulse"]
        at = pulse["step"][row] if row.size else np.empty(0, dtype=np.int64)
        detected = np.unique(at)
        clear = self._steps_to_clear(steps, detected)
        if detected.size:
            loudest = self._loudest(at, pulse["strengths_v"][row])
            decibel = 20 * np.log10(np.maximum(pulse["strengths_v"][row][loudest], 10 ** (QUIETEST_DBV / 20)))
            for element, values in enumerate(decibel.T):
                self._columns(f"{paths.STRENGTHS}/{element + 1}", detected, rr.Scalars.columns(scalars=values))
            rings = self._rings(pulse["strengths_v"][row][loudest])
            self._send_strips(paths.SPECTRUM, detected, rings, np.ones(detected.size, dtype=int), clear)
            pose = new["step"]["pose"][at - first["step"]]
            start = np.column_stack([pose[:, :2], np.full(at.size, 0.6)])
            ahead = np.column_stack([np.cos(bearing["bearing_rad"]), np.sin(bearing["bearing_rad"]), np.zeros(at.size)])
            rays = np.stack([start, start + RAY_M * ahead], axis=1)
            self._send_strips(paths.BEARINGS, detected, rays, np.bincount(np.searchsorted(detected, at)), clear)
        elif clear.size:
            for path in (paths.SPECTRUM, paths.BEARINGS):
                self._send_strips(path, detected, np.empty((0, 2, 3)), np.empty(0, dtype=int), clear)

    def _steps_to_clear(self, steps: NDArray[Any], detected: NDArray[Any]) -> NDArray[Any]:
        """Steps at which the last second was silent for the first time."""
        events = np.concatenate([[self._last_detection], detected])
        silent = events + HOLD_STEPS
        following = np.append(events[1:], steps[-1] + 1)
        if detected.size:
            self._last_detection = int(detected[-1])
        return silent[(silent < following) & (silent >= steps[0])]

    def _send_strips(
        self, path: str, steps: NDArray[Any], strips: FloatArray, counts: NDArray[Any], clear: NDArray[Any]
    ) -> None:
        """Line strips, some to a step, and none at the steps to clear."""
        if steps.size:
            self._columns(path, steps, rr.LineStrips3D.columns(strips=strips.astype(np.float32)).partition(counts))
        if clear.size:
            none = rr.LineStrips3D.columns(strips=[]).partition(np.zeros(clear.size, dtype=int))
            self._columns(path, clear, none)

    @staticmethod
    def _loudest(at: NDArray[Any], strengths: FloatArray) -> NDArray[np.intp]:
        """For each step in ascending `at`, the row of its strongest pulse."""
        order = np.lexsort((np.linalg.norm(strengths, axis=-1), at))
        return order[np.append(np.flatnonzero(np.diff(at[order])), at.size - 1)]

    def _rings(self, strengths: FloatArray) -> FloatArray:
        """The pseudo-spectrum of each row as a closed line around the robot, shape (n, n_azimuths, 3)."""
        unit = strengths / np.linalg.norm(strengths, axis=-1, keepdims=True)
        spectrum = 1.0 / (1.001 - np.square(unit @ self._unit_gain))
        low, high = SPECTRUM_RADIUS_M
        radius = low + (high - low) * spectrum / spectrum.max(axis=-1, keepdims=True)
        x, y = radius * np.cos(SPECTRUM_AZIMUTHS_RAD), radius * np.sin(SPECTRUM_AZIMUTHS_RAD)
        return np.stack([x, y, np.full_like(x, 0.62)], axis=-1)

    def _send_findings(self, finding: dict[str, NDArray[Any]]) -> None:
        for row in np.flatnonzero(finding["state"] == "dropped"):
            self._clear_finding(int(finding["id"][row]), int(finding["step"][row]))
        alive = finding["state"] != "dropped"
        for number in np.unique(finding["id"][alive]).tolist():
            rows = np.flatnonzero(alive & (finding["id"] == number))
            steps, n = finding["step"][rows], rows.size
            state = finding["state"][rows]
            colour = np.array([COLOURS[str(s)] for s in state], dtype=np.uint8)
            place = finding["position_m"][rows]
            words = [f"{s} {number}" for s in state]
            path = paths.finding_path(number)
            radii = np.full(n, 0.2)
            self._columns(path, steps, rr.Points3D.columns(positions=place, colors=colour, radii=radii, labels=words))
            covariance = finding["covariance_m2"][rows][:, :2, :2]
            semi_major = np.array([ellipse95(one).semi_major_m for one in covariance])
            drawn = semi_major <= MAX_DRAWN_ELLIPSE_M
            outlines = [
                outline95(p[:2], c, OUTLINE_POINTS) for p, c in zip(place[drawn], covariance[drawn], strict=True)
            ]
            strips = [np.column_stack([line, np.full(len(line), HEIGHT_M)]) for line in outlines]
            lines = rr.LineStrips3D.columns(strips=strips).partition(drawn.astype(int))
            tints = rr.LineStrips3D.columns(colors=colour, radii=np.full(n, 0.05))
            self._columns(f"{path}/ellipse", steps, [*lines, *tints])
            plot = f"{paths.UNCERTAINTY}/{number}"
            if number not in self._named:
                self._named.add(number)
                self._stream.log(plot, rr.SeriesLines(names=[f"finding {number}"]), static=True)
            self._columns(plot, steps, rr.Scalars.columns(scalars=semi_major))

    def _send_likelihood(self, likelihood: dict[str, NDArray[Any]]) -> None:
        """As pictures on the ground: dark where none of the pulses point, light where most do."""
        grid = described_grid(self._log.meta["grid"])
        nx, ny = grid.shape
        value = likelihood["log_likelihood"].reshape(-1, nx, ny)
        peak = np.maximum(value.max(axis=(1, 2), keepdims=True), LEAST_PEAK)
        share = np.square(np.clip(value / peak, 0.0, 1.0)).swapaxes(1, 2)[:, ::-1, :, np.newaxis]  # from the far side
        ground, light = np.array(COLOURS["ground"]), np.array(COLOURS["likelihood"])
        pictures = np.round(ground + share * (light - ground)).astype(np.uint8)
        picture = ImageFormat(width=nx, height=ny, color_model="RGB", channel_datatype="U8")
        n, steps = len(pictures), likelihood["step"]
        textures = {
            "albedo_texture_buffer": [one.tobytes() for one in pictures],
            "albedo_texture_format": [picture] * n,
        }
        self._columns(paths.LIKELIHOOD, steps, rr.Mesh3D.columns(**textures))
        outer = 0.5 + UNIT_SQUARE * [nx - 1, ny - 1]  # from centre to centre: beyond, a picture repeats
        corners = np.tile(np.column_stack([grid.corner_m + grid.cell_m * outer, np.zeros(4)]), (n, 1))
        onto = np.tile(np.abs(outer / [nx, ny] - [0.0, 1.0]), (n, 1))  # rows of a picture go down
        square = rr.Mesh3D.columns(vertex_positions=corners, vertex_texcoords=onto).partition([4] * n)
        halves = rr.Mesh3D.columns(triangle_indices=np.tile([[0, 1, 2], [0, 2, 3]], (n, 1))).partition([2] * n)
        self._columns(paths.LIKELIHOOD, steps, [*square, *halves])

    def _clear_finding(self, number: int, step: int) -> None:
        path = paths.finding_path(number)
        at = np.array([step])
        self._columns(path, at, rr.Points3D.columns(positions=np.empty((0, 3))).partition([0]))
        self._columns(f"{path}/ellipse", at, rr.LineStrips3D.columns(strips=[]).partition([0]))

    def _send_text(self, path: str, steps: NDArray[Any], kinds: NDArray[Any], texts: NDArray[Any]) -> None:
        words, levels = [str(text) for text in texts], [str(kind) for kind in kinds]
        self._columns(path, steps, rr.TextLog.columns(text=words, level=levels))
