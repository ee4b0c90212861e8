"""The array: gain towards anywhere, in compiled loops and by the formula that direction finding uses."""

import numpy as np

from dirmusic.array.elevation import gain_in_space
from sensing import ArrayConfig, HelicalArray
from sensing.array import ArrayTable
from sensing.radio.arrivals import gain_towards


def test_the_gain_towards_anywhere_is_what_the_pattern_says_to_nine_digits() -> None:
    """The compiled table of the gain against the formula that direction finding uses."""
    rng, array = np.random.default_rng(0), HelicalArray.draw(ArrayConfig(), np.random.default_rng(1))
    table = ArrayTable.of([array])
    for x, y, up in rng.normal(0.0, 5.0, (200, 3)):
        azimuth, elevation = np.arctan2(y, x), np.arctan2(up, np.hypot(x, y))
        by_table = [
            gain_towards(table.pattern_gain, table.pattern_slope, cos, sin, x, y, up)
            for cos, sin in table.boresight_cos_sin[0]
        ]
        by_formula = gain_in_space(array.pattern, azimuth - array.boresights_rad, elevation).gain
        off = np.abs(np.array(by_table) - by_formula)
        assert np.sort(off)[-2] < 1e-9  # one direction may lie on the step of eq. (1), which the table slopes
        assert off.max() < 0.01
