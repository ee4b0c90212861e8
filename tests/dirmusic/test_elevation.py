"""Gain in space: the pattern itself in the plane, smooth above it, and what ignoring elevation costs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dirmusic import GainManifold, GaussianPattern, estimate_bearings
from dirmusic.angles import difference
from dirmusic.array.elevation import gain_in_space

PATTERN = GaussianPattern()
OFF = np.radians(np.arange(-179.5, 180.0, 1.0))


def test_at_zero_elevation_it_is_the_pattern_and_its_slope() -> None:
    level = gain_in_space(PATTERN, OFF, 0.0)
    np.testing.assert_allclose(level.gain, PATTERN(OFF), rtol=1e-12)
    np.testing.assert_allclose(level.by_azimuth, PATTERN.derivative(OFF), atol=1e-12)


def test_straight_up_every_azimuth_hears_the_same() -> None:
    # psi is a right angle and the roll a quarter turn: the mean of left and right
    up = gain_in_space(PATTERN, OFF, np.pi / 2).gain
    np.testing.assert_allclose(up, 0.5 * (PATTERN(np.pi / 2) + PATTERN(-np.pi / 2)), rtol=1e-12)


def test_on_the_boresight_it_is_the_peak_and_above_and_below_are_alike() -> None:
    assert gain_in_space(PATTERN, 0.0, 0.0).gain == pytest.approx(float(PATTERN(0.0)))
    np.testing.assert_allclose(gain_in_space(PATTERN, OFF, 0.4).gain, gain_in_space(PATTERN, OFF, -0.4).gain)


@given(st.floats(-3.0, 3.0), st.floats(-1.4, 1.4))
def test_it_is_the_law_in_angles_from_and_around_the_boresight(off: float, elevation: float) -> None:
    direction = np.array([np.cos(elevation) * np.cos(off), np.cos(elevation) * np.sin(off), np.sin(elevation)])
    psi = np.arccos(np.clip(direction[0], -1, 1))
    roll = np.arctan2(direction[2], direction[1])
    law = np.cos(roll / 2) ** 2 * PATTERN(psi) + np.sin(roll / 2) ** 2 * PATTERN(-psi)
    assert gain_in_space(PATTERN, off, elevation).gain == pytest.approx(float(law), abs=1e-6)


@pytest.mark.parametrize("elevation", [-0.9, -0.2, 0.05, 0.5, 1.2])
def test_slopes_are_differences(elevation: float) -> None:
    off = OFF[np.abs(np.abs(np.degrees(OFF)) - 153.0) > 12.0]  # eq. (1) has a kink where its angle passes 0/360
    psi = np.degrees(np.arccos(np.cos(elevation) * np.cos(off)))
    off = off[np.abs(psi - 153.0) > 0.5]
    step = 1e-6
    here = gain_in_space(PATTERN, off, elevation)
    turned = [gain_in_space(PATTERN, off + s, elevation).gain for s in (step, -step)]
    raised = [gain_in_space(PATTERN, off, elevation + s).gain for s in (step, -step)]
    np.testing.assert_allclose(here.by_azimuth, (turned[0] - turned[1]) / (2 * step), atol=1e-6)
    np.testing.assert_allclose(here.by_elevation, (raised[0] - raised[1]) / (2 * step), atol=1e-6)


@pytest.mark.parametrize(("elevation_deg", "bias_deg"), [(5, 0.04), (10, 0.16), (20, 0.69), (30, 1.6), (45, 3.6)])
def test_ignoring_elevation_biases_the_azimuth_as_published(elevation_deg: float, bias_deg: float) -> None:
    # locating-notes.md: .04 / .16 / .69 / 1.6 / 3.6 deg rms at 5 / 10 / 20 / 30 / 45 deg of elevation
    ring = GainManifold.ring(6)
    azimuth = OFF
    gain = gain_in_space(PATTERN, azimuth[:, np.newaxis] - ring.boresights_rad, np.radians(elevation_deg)).gain
    in_plane = estimate_bearings(gain[:, np.newaxis], ring).azimuth_rad
    bias = np.degrees(np.sqrt(np.mean(np.square(difference(in_plane, azimuth)))))
    assert bias == pytest.approx(bias_deg, rel=0.15)
    told = estimate_bearings(gain[:, np.newaxis], ring.at_elevation(np.radians(elevation_deg))).azimuth_rad
    assert np.degrees(np.abs(difference(told, azimuth))).max() < 0.01
