"""RFID tags located with one directional antenna that is moved and turned: RemanufacturingLab-StudentTeams."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from result import Run

from dirmusic.array.level_calibration import learn_pattern
from dirmusic.arrays import FloatArray
from dirmusic.locating.level_fit import locate_level
from dirmusic.locating.level_model import LevelChannel, LevelModel, LevelRows

POSE = ["antenna x [m]", "antenna y [m]", "antenna rot z [deg]"]
TAG = ["tag id", "tag x [m]", "tag y [m]"]
MIN_POSES = 5
MAX_RANGE_M = 2.5
"""Tags are evaluated that were read from at least so many poses, and lie at most so far from them, in the median."""

SOURCE_STD_DB = 3.0
EXPONENT_STD = 0.5
"""How much a tag's level at 1 m and the exponent differ from those of the calibration (assumed). With 30 dB, or with an
exponent of 2, the median error over the runs at hand stays below 0.15 m, and all truths stay in their ellipses."""

CORRELATED_M = 0.5
"""Distance over which the errors of poses are correlated (assumed); without correlation the ellipses hardly change."""

TAG_DB = 2.0
"""How much the gains of a tag and its mounting differ between directions (assumed); the calibration turns a bare tag in
one plane, which changes the level by 1 dB. Without this, one of the five truths at hand is just outside its ellipse."""

BACK_DB = -18.0
"""Gain behind the antenna (assumed, as of usual panel antennas): the calibration ends 75 degrees off the boresight."""


def calibrate(folder: Path) -> LevelModel:
    """Make the model from the repository's own calibration: levels against azimuth, and against distance."""
    turns: list[tuple[FloatArray, FloatArray]] = []
    for path in sorted(folder.glob("RSSI-Phi-*.csv")):
        turn = pd.read_csv(path, sep=";")
        # The rotation is clockwise, as on a compass: phi is the boresight's azimuth minus the tag's.
        turns.append((-np.radians(_numbers(turn["phi"])), 0.01 * _numbers(turn["RSSI-Org"])))
    learned = learn_pattern(turns, np.radians(5.0), passes=2)
    known, gain_db = learned.is_measured.copy(), learned.gain_db.copy()
    known[0], gain_db[0] = True, BACK_DB  # the first angle is behind the antenna
    gain_db = np.interp(learned.off_boresight_rad, learned.off_boresight_rad[known], gain_db[known], period=2 * np.pi)
    miss_db, laws = [], []
    for path in sorted(folder.glob("rssi-distance-*.xlsx")):
        table = pd.read_excel(path)
        level_db = pd.Series(_numbers(table["RSSI"])).groupby(_numbers(table["Distance"])).median()
        level_db = level_db[level_db.index >= 0.7]  # nearer, the tag is in the antenna's near field
        decades_db = 10.0 * np.log10(level_db.index.to_numpy())
        law = np.polyfit(decades_db, level_db, 1)
        laws.append(law)
        miss_db.append(level_db - np.polyval(law, decades_db))
    slope, source_db = np.mean(laws, axis=0)
    return LevelModel(
        (LevelChannel(learned._replace(gain_db=gain_db).pattern),),
        passes=2,
        source_db=source_db,
        source_std_db=SOURCE_STD_DB,
        exponent=-slope,
        exponent_std=EXPONENT_STD,
        white_db=2.0 * learned.spread_db,
        shadow_db=float(np.hypot(np.std(np.concatenate(miss_db)), TAG_DB)),
        shadow_length_m=CORRELATED_M,
        shadow_common=1.0,
        step_db=0.1,
    )


def read_runs(path: Path) -> list[tuple[str, FloatArray, LevelRows]]:
    """Read the tags of an experiment with enough poses: name, true position and the median level at each pose.

    Tags at (2, 2), (3, 3) ... are left out: their positions are placeholders.
    """
    table = pd.read_excel(path, sheet_name=0)
    table.columns = [str(name).strip().lower() for name in table.columns]
    table = table.dropna(subset=["rssi", *POSE, *TAG])
    for name in ("rssi", *POSE, *TAG[1:]):
        table[name] = _numbers(table[name])
    runs: list[tuple[str, FloatArray, LevelRows]] = []
    for (tag, x_m, y_m), group in table.groupby(TAG):
        level = group.groupby(POSE)["rssi"].median().reset_index().to_numpy()
        is_placeholder = x_m == y_m and x_m >= 2 and float(x_m).is_integer()
        truth_m = np.array([x_m, y_m])
        range_m = np.median(np.linalg.norm(level[:, :2] - truth_m, axis=1))
        if len(level) < MIN_POSES or is_placeholder or range_m > MAX_RANGE_M:
            continue
        boresight_rad = np.radians(90.0 - level[:, 2])
        rows = LevelRows(level[:, 3], level[:, :2], boresight_rad, np.zeros(len(level), dtype=np.intp))
        runs.append((f"{path.stem.split('_', 3)[-1].split('_', 1)[-1]}, tag {str(tag)[-3:]}", truth_m, rows))
    return runs


def evaluate(folder: Path) -> list[Run]:
    """Locate all tags of all experiments in a folder; the simple figure is the pose with the strongest level."""
    model = calibrate(folder)
    results: list[Run] = []
    for path in sorted(folder.glob("rfid_data_*.xlsx")):
        for name, truth_m, rows in read_runs(path):
            low_m, high_m = rows.position_m.min(axis=0) - MAX_RANGE_M, rows.position_m.max(axis=0) + MAX_RANGE_M
            found = locate_level(rows, model, low_m, high_m)
            strongest_m = rows.position_m[np.argmax(rows.level_db)]
            results.append(Run.of(name, rows.level_db.size, found, truth_m, strongest_m))
    return results


def _numbers(column: pd.Series) -> FloatArray:
    """Convert a column of numbers, some of which are text, perhaps with decimal commas."""
    return column.astype(str).str.replace(",", ".").astype(float).to_numpy()
