"""Wi-Fi access point located by a robot with five antennas: herolab-uga/indoor-rssi-mobile-robot."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from result import Run

from dirmusic.array.level_calibration import learn_pattern
from dirmusic.arrays import FloatArray
from dirmusic.locating.level_fit import locate_level
from dirmusic.locating.level_model import LevelChannel, LevelModel, LevelRows

ACCESS_POINT_M = np.array([9.0, 0.0])
CALIBRATION_SETS = (6, 7)
BOX_M = np.array([[-12.0, -13.0], [20.0, 26.0]])
"""Searched box, in the frame of the start: the office and some metres around it."""

MOUNT_M = np.array([[0.6, 0.5], [0.6, -0.5], [-0.6, 0.5], [-0.6, -0.5], [0.0, 0.0]])
BORESIGHT_DEG = np.array([45.0, -45.0, 135.0, -135.0, 0.0])
"""Places and nominal boresights of the antennas on the robot: front left and right, back left and right, centre."""

STEP_M, STEP_DEG = 1.5, 60.0
"""Rows are reduced to a median for each stretch of the path, about as long as levels stay correlated (assumed)."""

TURNS_DEG = np.arange(-60.0, 61.0, 15.0)
"""Start headings, relative to the stated one; they differ between sets by 20 to 40 degrees."""

SHADOW_LENGTH_M = 4.0
"""Distance over which the errors of an antenna are correlated (assumed)."""

EXPONENT, EXPONENT_STD = 3.0, 0.5
SHADOW_DB = 10.0
"""Exponent and shadowing in offices near 2 GHz after ITU-R P.1238; the standard deviation of the exponent is assumed.
The two calibration sets turn at one place, so that they cannot show how levels differ between places."""


def read_set(path: Path) -> tuple[FloatArray, FloatArray]:
    """Read poses (x m, y m, yaw rad), shape (n, 3), and raw levels of the five antennas in dBm, shape (n, 5)."""
    table = np.loadtxt(path, skiprows=1, usecols=(3, 4, 7, 8, 15, 16, 17, 18, 19))
    yaw_rad = np.unwrap(2.0 * np.arctan2(table[:, 2], table[:, 3]))
    return np.column_stack([table[:, :2], yaw_rad]), table[:, 4:]


def antenna_rows(pose: FloatArray, level_db: FloatArray) -> LevelRows:
    """Make a row for each pose and antenna."""
    cos, sin = np.cos(pose[:, 2:]), np.sin(pose[:, 2:])
    offset_m = np.stack([cos * MOUNT_M[:, 0] - sin * MOUNT_M[:, 1], sin * MOUNT_M[:, 0] + cos * MOUNT_M[:, 1]], axis=-1)
    boresight_rad = pose[:, 2:] + np.radians(BORESIGHT_DEG)
    channel = np.broadcast_to(np.arange(5), level_db.shape)
    position_m = pose[:, np.newaxis, :2] + offset_m
    return LevelRows(level_db.ravel(), position_m.reshape(-1, 2), boresight_rad.ravel(), channel.ravel())


def calibrate(folder: Path) -> LevelModel:
    """Learn one pattern of the four antennas and one of the centre's from the turns on the spot."""
    corner: list[tuple[FloatArray, FloatArray]] = []
    centre: list[tuple[FloatArray, FloatArray]] = []
    for number in CALIBRATION_SETS:
        rows = antenna_rows(*read_set(folder / f"Dataset{number}.datalog"))
        off_m = ACCESS_POINT_M - rows.position_m
        off_rad = np.arctan2(off_m[:, 1], off_m[:, 0]) - rows.boresight_rad
        for channel in range(5):
            own = rows.channel == channel
            (centre if channel == 4 else corner).append((off_rad[own], rows.level_db[own]))
    learned = learn_pattern(corner)
    channels = [LevelChannel(learned.pattern, 0.0, 2.0)] * 4
    channels.append(LevelChannel(learn_pattern(centre).pattern, 0.0, 10.0))
    return LevelModel(
        tuple(channels),
        source_db=-20.0,
        source_std_db=15.0,
        exponent=EXPONENT,
        exponent_std=EXPONENT_STD,
        white_db=2.0,
        shadow_db=SHADOW_DB,
        shadow_length_m=SHADOW_LENGTH_M,
        step_db=1.0,
        least_range_m=0.5,
    )


def thin(pose: FloatArray, level_db: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Reduce a drive to the median pose and level of each stretch between steps of distance or heading."""
    stretch = np.zeros(len(pose), dtype=np.intp)
    start = 0
    for k in range(1, len(pose)):
        far = np.linalg.norm(pose[k, :2] - pose[start, :2]) > STEP_M
        if far or abs(pose[k, 2] - pose[start, 2]) > np.radians(STEP_DEG):
            start = k
        stretch[k] = start
    chosen = [stretch == first for first in np.unique(stretch)]
    return tuple(np.array([np.median(column[own], axis=0) for own in chosen]) for column in (pose, level_db))


def evaluate(folder: Path) -> list[Run]:
    """Locate the access point in each drive; the simple figure is the pose with the strongest centre antenna."""
    model = calibrate(folder)
    results: list[Run] = []
    for path in sorted(folder.glob("Dataset*.datalog")):
        number = int(path.stem.removeprefix("Dataset"))
        if number in CALIBRATION_SETS:
            continue
        pose, level_db = thin(*read_set(path))
        rows = antenna_rows(pose, level_db)
        found = locate_level(rows, model, *BOX_M, np.radians(TURNS_DEG))
        strongest_m = pose[np.argmax(level_db[:, 4]), :2]
        results.append(Run.of(f"set {number}", rows.level_db.size, found, ACCESS_POINT_M, strongest_m))
    return results
