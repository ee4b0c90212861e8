"""Field data from recordings of ROS 2: MCAP files and rosbag2 folders with the poses and the pulses of a survey."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from dirmusic import InputFileError
from dirmusic.angles import wrap
from dirmusic.arrays import FloatArray
from pdpatrol.missions.field.field_data import MIN_STRENGTH_V, FieldData, assemble
from pdpatrol.missions.field.instruments.record import MAX_VOLTS
from pdpatrol.missions.field.survey import SurveyOptions
from pdpatrol.missions.field.waveform_files import TablePulses
from pdpatrol.missions.record.words import counted

PULSE = "std_msgs/Header header\nfloat64[] strengths_v\nfloat64[] std_v\nfloat64 mains_phase_rad\nbool is_clipped\n"
"""Definition of `pdpatrol_msgs/Pulse`, for recordings that do not contain it."""

LONGEST_S = 1.0
"""Longest time between two poses that are interpolated (assumed)."""

QUATERNION_ERROR = 0.01
"""Largest difference of the length of a quaternion from 1. Assumed; rounding to three digits causes 0.001, and one that
was never set has length 0."""

Message = Any
"""Message of ROS 2, whose type is known from the recording only."""


class BagPulses(NamedTuple):
    """Pulses of a recording.

    Attributes:
        time_s: Time of each pulse since the first pose, shape (n_pulses,).
        strengths_v: Shape (n_pulses, n_channels).
        std_v: Standard deviations of the strengths, same shape.
        phase_rad: Mains phase, NaN where it is unknown, shape (n_pulses,).
    """

    time_s: FloatArray
    strengths_v: FloatArray
    std_v: FloatArray
    phase_rad: FloatArray


def read_bag(path: Path, survey: SurveyOptions) -> FieldData:
    """Read the poses and pulses of a recording.

    Poses are messages with a pose in x, y and a rotation about z: geometry_msgs/PoseStamped,
    PoseWithCovarianceStamped, nav_msgs/Odometry. Pulses are pdpatrol_msgs/Pulse, as `pdpatrol export` writes them, or
    std_msgs/Float64MultiArray with the strengths in volts, which need `noise_v`. A message without a stamp has the time
    at which it was recorded. The pose of a pulse is interpolated. Times count from the first pose.

    Raises:
        InputFileError: If the recording is damaged, has no such messages, or their values are invalid.
    """
    poses: list[tuple[int, float, float, float]] = []
    pulses: list[tuple[int, Sequence[float], Sequence[float], float]] = []
    n_clipped = 0
    for topic, time_ns, message in _messages(path, (survey.pose_topic, survey.pulse_topic)):
        try:
            if topic == survey.pose_topic:
                poses.append((time_ns, *_planar(message)))
            elif getattr(message, "is_clipped", False):
                n_clipped += 1
            else:
                pulses.append((time_ns, *_pulse(message, survey.noise_v)))
        except (AttributeError, ValueError, TypeError) as error:
            raise InputFileError([f"{path}: {topic}: {' '.join(str(error).split()):.200}"]) from None
    if n_clipped and not pulses:
        raise InputFileError(
            [f"{path}: {survey.pulse_topic}: must have pulses that are not clipped, got {n_clipped} clipped"]
        )
    for topic, found in ((survey.pose_topic, poses), (survey.pulse_topic, pulses)):
        if not found:
            raise InputFileError([f"{path}: {topic}: must have messages; --pose-topic and --pulse-topic name others"])
    if len({len(pulse[1]) for pulse in pulses}) > 1:
        raise InputFileError([f"{path}: {survey.pulse_topic}: all pulses must have the same number of channels"])
    poses.sort()
    pulses.sort(key=itemgetter(0))
    start_ns = poses[0][0]
    rows = np.array([((time_ns - start_ns) / 1e9, *pose) for time_ns, *pose in poses])
    times_ns, strengths_v, std_v, phase_rad = zip(*pulses, strict=True)
    time_s = np.array([(time_ns - start_ns) / 1e9 for time_ns in times_ns])
    data = _field_data(path, rows, BagPulses(time_s, np.array(strengths_v), np.array(std_v), np.array(phase_rad)))
    if n_clipped:
        data = replace(data, notes=(*data.notes, f"{n_clipped} clipped pulses: left out"))
    return data


def _messages(path: Path, topics: tuple[str, str]) -> Iterator[tuple[str, int, Message]]:
    """Yield topic, time in nanoseconds and content of the messages of two topics."""
    if path.is_dir() and not (path / "metadata.yaml").exists():
        raise InputFileError([f"{path}: must be an MCAP file or a rosbag2 folder with metadata.yaml, or a table"])
    known = get_typestore(Stores.ROS2_HUMBLE)
    known.register(get_types_from_msg(PULSE, "pdpatrol_msgs/msg/Pulse"))
    try:
        with AnyReader([path], default_typestore=known) as reader:
            connections = [each for each in reader.connections if each.topic in topics]
            for connection, recorded_ns, data in reader.messages(connections) if connections else ():
                message: Message = reader.deserialize(data, connection.msgtype)
                stamp = getattr(getattr(message, "header", None), "stamp", None)
                stamp_ns = 0 if stamp is None else stamp.sec * 10**9 + stamp.nanosec
                yield connection.topic, stamp_ns or recorded_ns, message
    except (AnyReaderError, OSError, ValueError, TypeError, KeyError, AssertionError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputFileError([f"{path}: must be an MCAP file or a rosbag2 folder ({reason:.200})"]) from None


def _planar(message: Message) -> tuple[float, float, float]:
    """Return x m, y m and yaw rad of a pose."""
    while hasattr(message, "pose"):
        message = message.pose
    x, y, z, w = (float(getattr(message.orientation, name)) for name in "xyzw")
    if not abs(np.linalg.norm([x, y, z, w]) - 1.0) < QUATERNION_ERROR:
        raise ValueError(f"orientations must be unit quaternions (x, y, z, w), got {(x, y, z, w)}")
    yaw_rad = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    place_m = float(message.position.x), float(message.position.y)
    if not np.isfinite([*place_m, yaw_rad]).all() or max(map(abs, place_m)) > 1e5:
        raise ValueError(f"poses must be finite and within 100 km, got {place_m}")
    return *place_m, float(yaw_rad)


def _pulse(message: Message, noise_v: float | None) -> tuple[Sequence[float], Sequence[float], float]:
    """Return strengths, their standard deviations, and the mains phase of a pulse."""
    has_std = hasattr(message, "strengths_v")
    strengths_v = np.asarray(message.strengths_v if has_std else message.data, dtype=np.float64)
    std_v = np.asarray(message.std_v, dtype=np.float64) if has_std else np.empty(0)
    if not strengths_v.size:
        raise ValueError("strengths_v must have a value for each channel, got none")
    if not std_v.size:
        if noise_v is None:
            raise ValueError("needs std_v in each message, or --noise-v: how far a strength can be trusted")
        std_v = np.full(strengths_v.size, noise_v)
    if std_v.size != strengths_v.size:
        raise ValueError(f"std_v must have {strengths_v.size} values, got {std_v.size}")
    if not ((strengths_v >= 0) & (strengths_v <= MAX_VOLTS) & (std_v >= MIN_STRENGTH_V) & (std_v <= MAX_VOLTS)).all():
        raise ValueError(f"strengths must be from 0 to {MAX_VOLTS:g} V and std_v above 0, got {strengths_v}, {std_v}")
    phase_rad = float(message.mains_phase_rad) if has_std else np.nan
    if abs(phase_rad) > 2.0 * np.pi:  # false for NaN, which is unknown
        raise ValueError(f"mains_phase_rad must be from -2 pi to 2 pi, or NaN if it is unknown, got {phase_rad:g}")
    return strengths_v.tolist(), std_v.tolist(), phase_rad


def _field_data(path: Path, poses: FloatArray, pulses: BagPulses) -> FieldData:
    """Interpolate the poses at the pulses; rows of poses are time s, x m, y m and yaw rad, in the order of time."""
    pose_s = poses[:, 0]
    poses[:, 3] = np.unwrap(poses[:, 3])
    after = np.searchsorted(pose_s, pulses.time_s)
    before, after = np.maximum(after - 1, 0), np.minimum(after, pose_s.size - 1)
    is_at_pose = pose_s[after] == pulses.time_s
    is_between = (pose_s[before] <= pulses.time_s) & (pulses.time_s <= pose_s[after])
    has_pose = is_at_pose | (is_between & (pose_s[after] - pose_s[before] <= LONGEST_S))
    if not has_pose.any():
        spans = (f"{time_s[0]:.1f} to {time_s[-1]:.1f} s" for time_s in (pulses.time_s, pose_s))
        raise InputFileError(
            [f"{path}: pulses must have poses within {LONGEST_S:g} s, got pulses from {' and poses from '.join(spans)}"]
        )
    time_s = pulses.time_s[has_pose]
    at_pulses = np.column_stack([time_s, *(np.interp(time_s, pose_s, values) for values in poses[:, 1:].T)])
    rows = np.vstack([poses, at_pulses])
    rows[:, 3] = wrap(rows[:, 3])
    order = np.argsort(rows[:, 0], kind="stable")
    row = np.argsort(order)[len(poses) :]
    phase_rad = np.full(len(rows), np.nan)
    phase_rad[row] = pulses.phase_rad[has_pose] % (2 * np.pi)
    strengths_v, std_v = pulses.strengths_v[has_pose], pulses.std_v[has_pose]
    used = TablePulses(row, strengths_v, np.square(std_v), np.zeros(std_v.shape, dtype=np.bool_))
    data = assemble(path, rows[order], phase_rad, used)
    if has_pose.all():
        return data
    note = f"{counted(np.sum(~has_pose), 'pulse')} without poses within {LONGEST_S:g} s: left out"
    return replace(data, notes=(*data.notes, note))
