"""Turns on the spot: a table of headings and received levels, from which the pattern of the antennas is learned."""

from pathlib import Path

import numpy as np

from dirmusic import InputFileError
from dirmusic.array.level_calibration import LearnedPattern, learn_pattern
from dirmusic.arrays import FloatArray
from pdpatrol.missions.field.input_table import read_table

SPOT_M = 0.5
"""Distance within which the robot counts as turning on the spot (assumed)."""

LEAST_CHANGE_DB = 2.0
"""Change of the levels below which they show no pattern. Assumed; receivers measure less than two volts, so that levels
in volts are refused."""


def learn_from_turns(
    path: Path, source_m: FloatArray, boresight_rad: FloatArray, passes: int
) -> tuple[LearnedPattern, int]:
    """Learn the common pattern of all channels from a table with x_m, y_m, yaw_deg and level_1 to level_n.

    Args:
        path: The table.
        source_m: Position of the emitter, shape (2,).
        boresight_rad: Azimuth of each channel's boresight relative to the heading, shape (n_channels,).
        passes: See `learn_pattern`.

    Returns:
        The pattern, and the number of turns, each channel counted for itself.

    Raises:
        InputFileError: If the table is invalid, the emitter is at a turn, or the turns have no direction in common or
            miss most directions.
    """
    table = read_table(path)
    names = [f"level_{k + 1}" for k in range(boresight_rad.size)]
    needed = sorted(["x_m", "y_m", "yaw_deg", *names])
    if sorted(set(table.columns) - {"time_s"}) != needed:
        raise InputFileError(
            [
                f"{path}: must have the columns x_m, y_m, yaw_deg and level_1 to level_{boresight_rad.size}, one for "
                f"each boresight, got {', '.join(table.columns):.200}"
            ]
        )
    place_m = table.numbers(-1e5, 1e5, "x_m", "y_m")
    yaw_rad = np.radians(table.numbers(-1e5, 1e5, "yaw_deg")[:, 0])
    level_db = table.numbers(-300.0, 300.0, *names)
    table.check()
    if (change_db := np.ptp(level_db)) < LEAST_CHANGE_DB:
        must = f"levels must be decibels and change by at least {LEAST_CHANGE_DB:g} dB, as a directional antenna turns"
        raise InputFileError([f"{path}: {must}, got {change_db:.2g} dB; volts are converted by 20 log10(V)"])
    towards_m = source_m - place_m
    if (nearest_m := np.linalg.norm(towards_m, axis=1).min()) < SPOT_M:
        raise InputFileError([f"{path}: must keep {SPOT_M:g} m from the emitter, got {nearest_m:.2f} m; --source-m?"])
    off_rad = np.arctan2(towards_m[:, 1], towards_m[:, 0]) - yaw_rad
    starts = [0]
    for row in range(1, len(place_m)):
        if np.linalg.norm(place_m[row] - place_m[starts[-1]]) > SPOT_M:
            starts.append(row)
    turns = [
        (off_rad[first:last] - boresight, level_db[first:last, channel])
        for first, last in zip(starts, [*starts[1:], len(place_m)], strict=True)
        for channel, boresight in enumerate(boresight_rad.tolist())
    ]
    try:
        return learn_pattern(turns, passes=passes), len(turns)
    except ValueError as error:
        raise InputFileError([f"{path}: {error}"]) from None
