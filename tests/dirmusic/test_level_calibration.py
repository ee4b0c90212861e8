"""Patterns learned from turns on the spot."""

import numpy as np
import pytest

from dirmusic.array.level_calibration import learn_pattern
from dirmusic.array.pattern import GaussianPattern

ANGLE_RAD = np.radians(np.arange(-180.0, 180.0, 2.0))


def gain_db(off_rad: np.ndarray) -> np.ndarray:
    return 20.0 * np.log10(GaussianPattern()(off_rad) / GaussianPattern()(0.0))


@pytest.mark.parametrize("passes", [1, 2])
def test_pattern_is_learned_whatever_the_level_of_each_turn(passes: int) -> None:
    turns = [(ANGLE_RAD, passes * gain_db(ANGLE_RAD) + level_db) for level_db in (-30.0, -55.0)]
    learned = learn_pattern(turns, passes=passes)
    np.testing.assert_allclose(learned.gain_db, gain_db(learned.off_boresight_rad), atol=0.5)
    assert learned.spread_db < 1e-9


def test_spread_is_that_between_the_turns() -> None:
    rng = np.random.default_rng(0)
    waves_db = [3.0 * np.sqrt(2.0) * np.cos(3.0 * ANGLE_RAD + phase) for phase in rng.uniform(0.0, 2 * np.pi, 40)]
    learned = learn_pattern([(ANGLE_RAD, gain_db(ANGLE_RAD) + wave_db) for wave_db in waves_db])
    assert learned.spread_db == pytest.approx(3.0, rel=0.1)


def test_directions_that_few_turns_have_are_interpolated() -> None:
    front = np.abs(ANGLE_RAD) < np.radians(61.0)
    turns = [(ANGLE_RAD[front], gain_db(ANGLE_RAD[front])) for _ in range(3)]
    turns[0] = (ANGLE_RAD, gain_db(ANGLE_RAD))
    learned = learn_pattern(turns)
    assert not learned.is_measured[0]
    assert np.degrees(learned.off_boresight_rad[learned.is_measured]).max() == pytest.approx(60.0)


def test_turns_without_a_common_direction_are_refused() -> None:
    left, right = np.radians(np.arange(20.0, 60.0)), np.radians(np.arange(-60.0, -20.0))
    with pytest.raises(ValueError, match="at least one direction in common"):
        learn_pattern([(left, np.zeros(40)), (right, np.zeros(40))])
