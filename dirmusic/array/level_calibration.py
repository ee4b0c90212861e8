"""Pattern of an antenna, and its uncertainty, learned from levels received while the antenna turns on the spot."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dirmusic.array.pattern import TabulatedPattern
from dirmusic.arrays import BoolArray, FloatArray


class LearnedPattern(NamedTuple):
    """Pattern learned from one or more turns.

    Attributes:
        off_boresight_rad: Angles off the boresight, in equal steps over one turn from -pi, shape (n,).
        gain_db: Gain relative to the boresight's, shape (n,).
        std_db: Standard deviation of a single turn about the mean of all, shape (n,): what multipath, which differs
            between places, adds to a level. NaN where fewer than two have a level.
        is_measured: True where at least half of the turns have a level, shape (n,).
    """

    off_boresight_rad: FloatArray
    gain_db: FloatArray
    std_db: FloatArray
    is_measured: BoolArray

    @property
    def pattern(self) -> TabulatedPattern:
        """Amplitude pattern."""
        return TabulatedPattern(self.off_boresight_rad, 10.0 ** (self.gain_db / 20.0))

    @property
    def spread_db(self) -> float:
        """Root mean square of `std_db`; NaN for a single turn."""
        known_db = self.std_db[np.isfinite(self.std_db)]
        return float(np.sqrt(np.mean(np.square(known_db)))) if known_db.size else np.nan


def learn_pattern(
    turns: Sequence[tuple[FloatArray, FloatArray]], step_rad: float = np.radians(10.0), passes: int = 1
) -> LearnedPattern:
    """Learn a pattern from turns; each is a pair of angles off the boresight, and of levels in decibels, of one shape.

    The levels of a turn are reduced to medians in steps, and shifted to agree with the other turns in
    the mean over the steps that all have. The pattern is the mean over the turns, at the steps that at least half of
    them have, and is interpolated between these.

    Args:
        turns: Angles off the boresight and levels of each turn.
        step_rad: Step of the pattern; one turn must be a multiple of it.
        passes: 2 where the antenna also sends the wave that the emitter returns: the pattern counts twice.

    Raises:
        ValueError: If no step is measured in all turns, or less than a quarter of the steps.
    """
    n_steps = round(2 * np.pi / step_rad)
    angle_rad = np.linspace(-np.pi, np.pi, n_steps, endpoint=False)
    curves = np.full((len(turns), n_steps), np.nan)
    for curve, (off_rad, level_db) in zip(curves, turns, strict=True):
        step = np.rint((off_rad + np.pi) / step_rad).astype(np.intp) % n_steps
        for number in np.unique(step).tolist():
            curve[number] = np.median(level_db[step == number])
    shared = np.isfinite(curves).all(axis=0)
    if not shared.any():
        raise ValueError("turns must have at least one direction in common")
    curves -= curves[:, shared].mean(axis=1, keepdims=True)
    count = np.isfinite(curves).sum(axis=0)
    mean_db: FloatArray = np.where(np.isfinite(curves), curves, 0.0).sum(axis=0) / np.maximum(count, 1)
    variance = np.where(np.isfinite(curves), np.square(curves - mean_db), 0.0).sum(axis=0)
    std_db = np.where(count > 1, np.sqrt(variance / np.maximum(count - 1, 1)), np.nan)
    measured = 2 * count >= len(turns)
    if 4 * measured.sum() < n_steps:
        raise ValueError(f"turns must have levels in a quarter of {n_steps} directions, got {measured.sum()}")
    filled_db: FloatArray = np.interp(angle_rad, angle_rad[measured], mean_db[measured], period=2 * np.pi)
    filled_db -= float(np.interp(0.0, angle_rad, filled_db))
    return LearnedPattern(angle_rad, filled_db / passes, std_db / passes, measured)
