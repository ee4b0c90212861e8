"""`pdpatrol calibrate`: patterns from turns on the spot."""

from pathlib import Path

import numpy as np
import pytest

from dirmusic import GaussianPattern, InputFileError, read_pattern
from pdpatrol.missions.cli.calibrate import calibrate
from pdpatrol.missions.field.turns import learn_from_turns

BORESIGHTS_DEG = (45.0, -45.0)


def write_turns(path: Path, level_name: str = "level_2") -> Path:
    """Write turns at two places around an emitter at (10, 0); the second channel is 6 dB weaker."""
    lines = [f"x_m,y_m,yaw_deg,level_1,{level_name}"]
    for x, y in ((0.0, 0.0), (10.0, -8.0)):
        for yaw_deg in range(0, 360, 2):
            off_rad = np.arctan2(0.0 - y, 10.0 - x) - np.radians(yaw_deg + np.array(BORESIGHTS_DEG))
            one, two = 20 * np.log10(GaussianPattern()(off_rad)) - 50.0
            lines.append(f"{x},{y},{yaw_deg},{one:.3f},{two - 6.0:.3f}")
    path.write_text("\n".join(lines) + "\n")
    return path


def test_calibrate_writes_a_pattern_that_read_pattern_reads(tmp_path: Path) -> None:
    out = tmp_path / "pattern.csv"
    calibrate(write_turns(tmp_path / "turns.csv"), source_m=(10.0, 0.0), boresights_deg=BORESIGHTS_DEG, out_file=out)
    off_rad = np.radians(np.arange(-180.0, 180.0, 5.0))
    written, true = (20 * np.log10(each(off_rad) / each(0.0)) for each in (read_pattern(out), GaussianPattern()))
    np.testing.assert_allclose(written, true, atol=0.7)
    assert "# Learned from 4 turns" in out.read_text()


def test_missing_level_column_is_named(tmp_path: Path) -> None:
    path = write_turns(tmp_path / "turns.csv", level_name="rssi")
    with pytest.raises(InputFileError, match="level_1 to level_2, one for each boresight, got x_m"):
        learn_from_turns(path, np.array([10.0, 0.0]), np.radians(BORESIGHTS_DEG), 1)


def write_turn(path: Path, end_deg: int) -> Path:
    """Write a turn of one channel at the origin."""
    path.write_text("\n".join(["x_m,y_m,yaw_deg,level_1", *(f"0,0,{k},{-40 - k % 180}" for k in range(end_deg))]))
    return path


@pytest.mark.parametrize(
    ("source_m", "end_deg", "message"),
    [
        ((0.1, 0.0), 360, r"must keep 0.5 m from the emitter, got 0.10 m; --source-m\?"),
        ((10.0, 0.0), 7, "turns must have levels in a quarter of 36 directions, got 2"),  # radians in yaw_deg
    ],
)
def test_turns_that_show_no_pattern_are_refused(
    tmp_path: Path, source_m: tuple[float, float], end_deg: int, message: str
) -> None:
    path = write_turn(tmp_path / "turns.csv", end_deg)
    with pytest.raises(InputFileError, match=message):
        learn_from_turns(path, np.array(source_m), np.zeros(1), 1)


def test_levels_in_volts_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "turns.csv"
    path.write_text("\n".join(["x_m,y_m,yaw_deg,level_1", *(f"0,0,{k},{0.01 + 1e-3 * k}" for k in range(360))]))
    with pytest.raises(
        InputFileError, match=r"levels must be decibels and change by at least 2 dB.*, got 0.36 dB; volts"
    ):
        learn_from_turns(path, np.array([10.0, 0.0]), np.zeros(1), 1)


def test_spread_of_a_single_turn_is_unknown(tmp_path: Path) -> None:
    out = tmp_path / "pattern.csv"
    calibrate(write_turn(tmp_path / "turns.csv", 360), source_m=(10.0, 0.0), out_file=out)
    assert "# Learned from 1 turn: how much turns differ is unknown, because there is only one." in out.read_text()
