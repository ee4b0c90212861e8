"""A survey that is exported as MCAP, or kept as rosbag2, comes back to the same findings."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from dirmusic import InputFileError
from dirmusic.angles import wrap
from pdpatrol.missions.export.ros2_recording import write_ros2_recording
from pdpatrol.missions.field.field_data import FieldData
from pdpatrol.missions.field.locate_field_data import locate_field_data
from pdpatrol.missions.field.ros2_bag import read_bag
from pdpatrol.missions.field.survey import SurveyOptions
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.make_report import make_report
from tests.missions.field.surveys import EXAMPLE, log_of_table

HEADER, *ROWS = EXAMPLE.read_text(encoding="utf-8").splitlines()


def assert_same_findings(expected: MissionLog, data: FieldData) -> None:
    findings = make_report(expected, 0.0).findings
    others = make_report(locate_field_data(data, SurveyOptions()), 0.0).findings
    assert len(others) == len(findings) > 0
    for one, other in zip(findings, others, strict=True):
        np.testing.assert_allclose(other.position_m, one.position_m, atol=2e-3)
        np.testing.assert_allclose(other.covariance_m2, one.covariance_m2, rtol=0.01, atol=1e-6)
        assert (other.state, other.n_bearings) == (one.state, one.n_bearings)


def write_bag(
    folder: Path,
    pulse_type: str = "std_msgs/msg/Float64MultiArray",
    storage: StoragePlugin = StoragePlugin.MCAP,
    *,
    quaternion_length: float = 1.0,
    delay_ns: int = 0,
) -> None:
    """Write the example as rosbag2: odometry at each stop, and the strengths, later by a delay, without a stamp."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    zero = np.zeros(36)
    with Writer(folder, version=8, storage_plugin=storage) as writer:
        odom = writer.add_connection("/odom", "nav_msgs/msg/Odometry", typestore=store)
        pulse = writer.add_connection("/strengths", pulse_type, typestore=store)

        rest = types["geometry_msgs/msg/Vector3"](x=0.0, y=0.0, z=0.0)
        last_s = -1.0
        for row in ROWS:
            time_s, x, y, yaw_deg, *values = map(float, row.split(","))
            time_ns = 1_700_000_000_000_000_000 + round(1e9 * time_s)
            if time_s != last_s:
                last_s, half_rad = time_s, 0.5 * np.radians(yaw_deg)
                stamp = types["builtin_interfaces/msg/Time"](sec=time_ns // 10**9, nanosec=time_ns % 10**9)
                header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="map")
                z, w = quaternion_length * np.sin(half_rad), quaternion_length * np.cos(half_rad)
                turn = types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=z, w=w)
                place = types["geometry_msgs/msg/Point"](x=x, y=y, z=0.0)
                pose = types["geometry_msgs/msg/Pose"](position=place, orientation=turn)
                twist = types["geometry_msgs/msg/Twist"](linear=rest, angular=rest)
                message = types["nav_msgs/msg/Odometry"](
                    header=header,
                    child_frame_id="base_link",
                    pose=types["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=zero),
                    twist=types["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=zero),
                )
                writer.write(odom, time_ns, store.serialize_cdr(message, "nav_msgs/msg/Odometry"))
            layout = types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
            volts = types[pulse_type](layout=layout, data=np.array(values[:6]))
            writer.write(pulse, time_ns + delay_ns, store.serialize_cdr(volts, pulse_type))


@pytest.mark.whole
def test_exported_survey_comes_back(tmp_path: Path) -> None:
    """A channel without a signal is left out by both."""
    dead = [",".join("0" if k == 6 else cell for k, cell in enumerate(row.split(","))) for row in ROWS]
    for name, rows in (("sound", ROWS), ("dead", dead)):
        (tmp_path / f"{name}.csv").write_text("\n".join([HEADER, *rows, ""]))
        log = log_of_table(tmp_path / f"{name}.csv")
        write_ros2_recording(log, tmp_path / f"{name}.mcap")
        data = read_bag(tmp_path / f"{name}.mcap", SurveyOptions())
        assert data.notes == (("channel 3 is zero throughout: left out",) if name == "dead" else ())
        np.testing.assert_allclose(data.pulses.strengths_v, log.column("pulse", "strengths_v"), rtol=1e-12)
        off = data.pose - log.column("step", "pose")
        np.testing.assert_allclose(np.column_stack([off[:, :2], wrap(off[:, 2])]), 0.0, atol=1e-12)
        assert_same_findings(log, data)


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_bags_of_standard_messages_are_read(tmp_path: Path, storage: StoragePlugin) -> None:
    write_bag(tmp_path / "bag", "std_msgs/msg/Float64MultiArray", storage)
    options = SurveyOptions(pose_topic="/odom", pulse_topic="/strengths", noise_v=1e-3)
    data = read_bag(tmp_path / "bag", options)
    rows = np.array([[float(cell) for cell in row.split(",")] for row in ROWS])
    np.testing.assert_allclose(data.pulses.strengths_v, rows[:, 4:10], rtol=1e-12)
    off = data.pose[data.step] - np.column_stack([rows[:, 1:3], np.radians(rows[:, 3])])
    np.testing.assert_allclose(np.column_stack([off[:, :2], wrap(off[:, 2])]), 0.0, atol=1e-9)
    np.testing.assert_allclose(data.time_s[data.step], rows[:, 0] - rows[0, 0], atol=1e-6)


@pytest.mark.parametrize(
    ("length", "delay_ns", "message"),
    [
        (0.0, 0, r"/odom: orientations must be unit quaternions \(x, y, z, w\), got \(0.0, 0.0, -?0.0, 0.0\)"),
        (2.0, 0, "/odom: orientations must be unit quaternions"),
        (1.0, 10**12, r"poses within 1 s, got pulses from 1000.0 to 1260.0 s and poses from 0.0 to 260.0 s"),
    ],
)
def test_bag_without_usable_poses_is_refused(tmp_path: Path, length: float, delay_ns: int, message: str) -> None:
    write_bag(tmp_path / "bag", quaternion_length=length, delay_ns=delay_ns)
    options = SurveyOptions(pose_topic="/odom", pulse_topic="/strengths", noise_v=1e-3)
    with pytest.raises(InputFileError, match=message):
        read_bag(tmp_path / "bag", options)


def test_unusable_recording_is_one_line(tmp_path: Path) -> None:
    log = log_of_table(EXAMPLE)
    write_ros2_recording(log, tmp_path / "m.mcap")
    data = (tmp_path / "m.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: len(data) // 2])
    (tmp_path / "text.mcap").write_text("not a recording")
    (tmp_path / "begun.mcap").write_bytes(data[:8])
    (tmp_path / "empty").mkdir()
    usual = SurveyOptions()
    for name, survey, message in (
        ("cut.mcap", usual, "must be an MCAP file or a rosbag2 folder"),
        ("text.mcap", usual, "must be an MCAP file or a rosbag2 folder"),
        ("begun.mcap", usual, "must be an MCAP file or a rosbag2 folder"),
        ("empty", usual, "must be an MCAP file or a rosbag2 folder with metadata.yaml, or a table"),
        ("none.mcap", usual, "must be an MCAP file or a rosbag2 folder"),
        ("m.mcap", replace(usual, pulse_topic="/clicks"), "/clicks: must have messages; --pose-topic and"),
        ("m.mcap", replace(usual, pose_topic="/yard"), "/yard: "),
    ):
        with pytest.raises(InputFileError, match=message) as refused:
            read_bag(tmp_path / name, survey)
        (line,) = refused.value.faults
        assert line.startswith(str(tmp_path / name))
        assert len(line) < 400 and "\n" not in line  # noqa: PT018
