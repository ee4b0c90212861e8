"""Gain in space, and bearings of sources above the plane of the array."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dirmusic import GainManifold, GaussianPattern, estimate_bearings
from dirmusic.angles import difference
from dirmusic.array.pattern import gain_in_space
from tests.dirmusic.scenes import RING, rms

PATTERN = GaussianPattern()
OFF = np.radians(np.arange(-179.5, 180.0, 1.0))


@given(st.floats(-3.0, 3.0), st.floats(-1.4, 1.4), st.one_of(st.just(0.0), st.floats(-1.5, 1.5)))
def test_gain_in_space_follows_law_of_angle_and_roll(off: float, elevation: float, tilt: float) -> None:
    direction = np.array([np.cos(elevation) * np.cos(off), np.cos(elevation) * np.sin(off), np.sin(elevation)])
    from_level = np.array([[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]])
    ahead, left, up = from_level @ direction  # rotate about the axis to the left
    psi = np.arccos(np.clip(ahead, -1, 1))
    roll = np.arctan2(up, left)
    law = np.cos(roll / 2) ** 2 * PATTERN(psi) + np.sin(roll / 2) ** 2 * PATTERN(-psi)
    assert gain_in_space(PATTERN, off, elevation, tilt).gain == pytest.approx(float(law), abs=1e-6)


def test_manifold_of_tilted_ring_is_gain_in_space() -> None:
    tilt = np.radians(25.0)
    tilted = GainManifold(PATTERN, RING.boresights_rad, boresight_elevations_rad=np.full(6, tilt))
    off = OFF - RING.boresights_rad[:, np.newaxis]
    gain, slope = tilted.gain_and_slope(OFF)
    by_formula = gain_in_space(PATTERN, off, 0.0, tilt)
    np.testing.assert_array_equal(gain, by_formula.gain)
    np.testing.assert_array_equal(slope, by_formula.by_azimuth)
    np.testing.assert_allclose(np.roll(gain, -1, axis=0), tilted.gain(OFF + np.radians(60.0)), rtol=1e-9)
    np.testing.assert_array_equal(tilted.take([1, 4]).gain(OFF), gain[[1, 4]])
    in_space = tilted.response_in_space(off.T, np.full((OFF.size, 1), 0.3))
    np.testing.assert_array_equal(in_space.gain, gain_in_space(PATTERN, off, 0.3, tilt).gain.T)


@pytest.mark.parametrize("tilt", [0.0, -1.5, -0.3, 0.2, 0.7, np.pi / 2])
@pytest.mark.parametrize("elevation", [-0.9, -0.2, 0.05, 0.5, 1.2])
def test_slopes_in_space_match_differences(elevation: float, tilt: float) -> None:
    off = OFF[np.abs(np.abs(np.degrees(OFF)) - 153.0) > 12.0]  # eq. (1) has a kink where its angle passes 0/360
    ahead = np.cos(tilt) * np.cos(elevation) * np.cos(off) + np.sin(tilt) * np.sin(elevation)
    off = off[np.abs(np.degrees(np.arccos(ahead)) - 153.0) > 0.5]
    step = 1e-6
    here = gain_in_space(PATTERN, off, elevation, tilt)
    for slope, turn, rise in ((here.by_azimuth, step, 0.0), (here.by_elevation, 0.0, step)):
        after, before = (gain_in_space(PATTERN, off + s * turn, elevation + s * rise, tilt).gain for s in (1, -1))
        np.testing.assert_allclose(slope, (after - before) / (2 * step), atol=1e-6)


@pytest.mark.parametrize(("elevation_deg", "bias_deg"), [(5, 0.04), (10, 0.16), (20, 0.69), (30, 1.6), (45, 3.6)])
def test_ignored_elevation_biases_azimuth_as_published(elevation_deg: float, bias_deg: float) -> None:
    # reference values: .04 / .16 / .69 / 1.6 / 3.6 deg rms at 5 / 10 / 20 / 30 / 45 deg of elevation
    gain = gain_in_space(PATTERN, OFF[:, np.newaxis] - RING.boresights_rad, np.radians(elevation_deg)).gain
    in_plane = estimate_bearings(gain[:, np.newaxis], RING).azimuth_rad
    assert np.degrees(rms(difference(in_plane, OFF))) == pytest.approx(bias_deg, rel=0.15)
