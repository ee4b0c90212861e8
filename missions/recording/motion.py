"""Robot, camera, moving bodies, phases and pulses of a mission as entities of a recording."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from dirmusic import GainManifold
from dirmusic.angles import wrap
from dirmusic.arrays import FloatArray, IntArray
from pdpatrol.missions.record.log_contents import described_manifold
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.recording.camera import camera_moves
from pdpatrol.missions.recording.palette import PALETTE
from pdpatrol.missions.recording.scene import lines_3d
from pdpatrol.robot_models.moving_bodies import described_moving
from pdpatrol.robot_models.yard.solids import YardSolids

AZIMUTHS_RAD = np.radians(np.arange(0.0, 360.0, 3.0))
"""Azimuths at which pseudo-spectra are computed."""

ARRAY_HEIGHT_M = 0.6
"""Height above ground at which rays and rings are drawn; roughly that of the array."""


@dataclass(frozen=True)
class LogBin:
    """Rows of a log that belong to a few consecutive steps; a bin may contain events without steps.

    Attributes:
        log: Log of the mission.
        first: Number of the first row, by the name of the table.
        tables: Rows of the bin, by the name of the table.
    """

    log: MissionLog
    first: Mapping[str, int]
    tables: Mapping[str, dict[str, NDArray[Any]]]

    @property
    def end(self) -> int:
        """Row after the last step."""
        return self.first["step"] + self.tables["step"]["time_s"].size


def time_of(log: MissionLog, step: int) -> float:
    """Return the time of a step in seconds; zero before the first step."""
    return float(log.column("step", "time_s", step, step + 1).sum())  # of one value or none


def set_step(stream: rr.RecordingStream, log: MissionLog, step: int) -> None:
    """Set the time for the following calls of `stream.log` to a step of a mission."""
    stream.set_time("sim_time", duration=time_of(log, step))
    stream.set_time("step", sequence=step)


def at_steps(log: MissionLog, steps: IntArray) -> list[rr.TimeColumn]:
    """Return the times of steps (n,), ascending, for `stream.send_columns`."""
    first, last = (steps[0], steps[-1]) if steps.size else (0, -1)
    time_s = log.column("step", "time_s", int(first), int(last) + 1)[steps - first]
    return [rr.TimeColumn("sim_time", duration=time_s), rr.TimeColumn("step", sequence=steps)]


def draw_motion(stream: rr.RecordingStream, part: LogBin, solids: YardSolids | None) -> None:
    """Draw changes of phase, and poses of robot, camera and moving bodies, as columns.

    The camera avoids `solids`, which are None in an unknown yard.
    """
    log, first, end = part.log, part.first["step"], part.end
    if end == first:
        return
    times, step = at_steps(log, np.arange(first, end)), part.tables["step"]
    phase = log.column("step", "phase", max(first - 1, 0), end)
    is_new = np.append(first == 0, phase[1:] != phase[:-1])[-(end - first) :]
    states = rr.StateChange.columns(state=step["phase"][is_new])
    stream.send_columns("mission/phase", at_steps(log, first + np.flatnonzero(is_new)), states)
    if first == 0:  # the first step ends after the start of the mission, when a viewer would show nothing
        _draw_poses(stream, log, solids, 0, 1, [rr.TimeColumn("sim_time", duration=[0.0])])
    _draw_poses(stream, log, solids, first, end, times)


def _draw_poses(
    stream: rr.RecordingStream,
    log: MissionLog,
    solids: YardSolids | None,
    first: int,
    end: int,
    times: list[rr.TimeColumn],
) -> None:
    """Draw the poses of robot, camera and moving bodies in the steps from `first` up to `end`."""
    stream.send_columns("world/robot", times, _moves(log.column("step", "pose", first, end)))
    stream.send_columns("world/camera", times, camera_moves(log, solids, first, end))
    for description in log.meta.get("truth", {}).get("moving", ()):
        body, track = described_moving(description)
        pose = track.pose(log.column("step", "time_s", first, end))
        stream.send_columns(f"world/truth/{body.label}", times, _moves(pose))


def draw_bearing_plot(stream: rr.RecordingStream, part: LogBin) -> None:
    """Draw the bearings over time as columns."""
    bearing = part.tables["bearing"]
    if bearing["pulse"].size:
        steps = part.tables["pulse"]["step"][bearing["pulse"] - part.first["pulse"]]
        degrees = rr.Scalars.columns(scalars=np.degrees(bearing["bearing_rad"]))
        stream.send_columns("plots/directions/bearing", at_steps(part.log, steps), degrees)


def draw_paths(stream: rr.RecordingStream, part: LogBin) -> None:
    """Draw the heading, and the lines by which the paths grow in a bin."""
    first, end = part.first["step"], part.end
    stream.log("plots/directions/heading", rr.Scalars(np.degrees(wrap(part.tables["step"]["pose"][-1, 2]))))
    for path, column, height_m, colour, width in (
        ("world/trajectory", "pose", 0.06, PALETTE.robot, 1.8),
        ("world/truth/trajectory", "true_pose", 0.04, PALETTE.truth, 0.8),
        ("world/odometry", "odometry", 0.03, PALETTE.odometry, 0.8),
    ):
        pose = part.log.column("step", column, max(first - 1, 0), end)
        if np.isfinite(pose).all():
            line = np.column_stack([pose[:, :2], np.full(len(pose), height_m)])
            stream.log(path, lines_3d([line], colour, width))


def _moves(pose: FloatArray) -> Any:  # noqa: ANN401 - columns of a type that Rerun does not export
    """Return transforms for poses x m, y m, yaw rad, shape (n, 3)."""
    turns = [rr.RotationAxisAngle([0, 0, 1], radians=angle) for angle in pose[:, 2].tolist()]
    translation_m = np.column_stack([pose[:, :2], 0.0 * pose[:, 2]])
    return rr.Transform3D.columns(translation=translation_m, rotation_axis_angle=turns)


def draw_pulses(stream: rr.RecordingStream, part: LogBin) -> None:
    """Draw the bearings of a bin as rays, the strongest pulse as a ring, and the median strengths."""
    bearing_rad, rows = part.tables["bearing"]["bearing_rad"], part.tables["bearing"]["pulse"] - part.first["pulse"]
    if not rows.size:
        for path in ("world/bearings", "world/spectrum"):
            stream.log(path, rr.Clear.flat())
        return
    step, strengths_v = part.tables["pulse"]["step"][rows], part.tables["pulse"]["strengths_v"][rows]
    pose = part.tables["step"]["pose"][step - part.first["step"]]
    start_m = np.column_stack([pose[:, :2], np.full(rows.size, ARRAY_HEIGHT_M)])
    ahead = np.column_stack([np.cos(bearing_rad), np.sin(bearing_rad), np.zeros(rows.size)])
    stream.log("world/bearings", lines_3d(np.stack([start_m, start_m + 25.0 * ahead], axis=1), PALETTE.bearing, 1.0))
    strongest = int(np.linalg.norm(strengths_v, axis=-1).argmax())
    manifold = described_manifold(part.log.meta["array"])
    ring_m = _ring(pose[strongest], strengths_v[strongest], manifold)
    stream.log("world/spectrum", lines_3d([ring_m], PALETTE.spectrum, 1.5))
    level_db = 20.0 * np.log10(np.maximum(np.median(strengths_v, axis=0), 1e-3))  # zeros: elements that face away
    stream.log("plots/strengths", rr.Scalars(level_db))


def _ring(pose: FloatArray, strengths_v: FloatArray, manifold: GainManifold) -> FloatArray:
    """Return the pseudo-spectrum of a pulse as a closed line around a pose, radius 0.8 m at zero and 3 m at the peak.

    It follows eq. (13) to (15) of the Dir-MUSIC paper, with 1.001 for 1 so that the peak is not infinite.
    """
    gain = manifold.gain(AZIMUTHS_RAD)
    fit = strengths_v @ gain / (np.linalg.norm(strengths_v) * np.linalg.norm(gain, axis=0))
    spectrum = 1.0 / (1.001 - np.square(fit))
    angle = np.append(AZIMUTHS_RAD, 0.0) + pose[2]
    radius_m = 0.8 + 2.2 * np.append(spectrum, spectrum[0]) / spectrum.max()
    x, y = pose[0] + radius_m * np.cos(angle), pose[1] + radius_m * np.sin(angle)
    return np.column_stack([x, y, np.full(angle.size, ARRAY_HEIGHT_M)])
