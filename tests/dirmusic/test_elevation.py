"""Gain in space: the pattern itself in the plane, smooth above it, and what ignoring elevation costs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dirmusic import GainManifold, GaussianPattern, estimate_bearings
from dirmusic.angles import difference
from dirmusic.array.pattern import gain_in_space

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


@given(st.floats(-3.0, 3.0), st.floats(-1.4, 1.4), st.one_of(st.just(0.0), st.floats(-1.5, 1.5)))
def test_it_is_the_law_in_angles_from_and_around_the_boresight(off: float, elevation: float, tilt: float) -> None:
    direction = np.array([np.cos(elevation) * np.cos(off), np.cos(elevation) * np.sin(off), np.sin(elevation)])
    from_level = np.array([[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]])
    ahead, left, up = from_level @ direction  # an element that is tilted is a level one that was turned about its left
    psi = np.arccos(np.clip(ahead, -1, 1))
    roll = np.arctan2(up, left)
    law = np.cos(roll / 2) ** 2 * PATTERN(psi) + np.sin(roll / 2) ** 2 * PATTERN(-psi)
    assert gain_in_space(PATTERN, off, elevation, tilt).gain == pytest.approx(float(law), abs=1e-6)


@pytest.mark.parametrize("tilt", [-1.2, 0.3, 0.8])
def test_above_and_below_change_places_when_the_array_is_tilted_the_other_way(tilt: float) -> None:
    for elevation in (0.0, 0.4, -1.1):
        up, down = gain_in_space(PATTERN, OFF, elevation, tilt), gain_in_space(PATTERN, OFF, -elevation, -tilt)
        np.testing.assert_allclose(up.gain, down.gain, rtol=1e-13)
        np.testing.assert_allclose(up.by_azimuth, down.by_azimuth, atol=1e-12)
        np.testing.assert_allclose(up.by_elevation, -down.by_elevation, atol=1e-12)


def test_straight_ahead_a_tilt_is_an_elevation_less() -> None:
    elevation = np.linspace(-1.2, 1.2, 25)
    for tilt in (-0.3, 0.25):
        tilted, level = gain_in_space(PATTERN, 0.0, elevation + tilt, tilt), gain_in_space(PATTERN, 0.0, elevation)
        np.testing.assert_allclose(tilted.gain, level.gain, rtol=1e-12)
        np.testing.assert_allclose(tilted.by_elevation, level.by_elevation, atol=1e-12)


def test_an_element_that_points_straight_up_receives_alike_from_all_azimuths_but_for_its_roll() -> None:
    """Seen from above it, azimuth is roll: the gain is that of one angle, mixed as the roll says."""
    elevation = 0.6
    psi, roll = np.pi / 2 - elevation, np.arctan2(-np.cos(OFF), np.sin(OFF))
    law = np.cos(roll / 2) ** 2 * PATTERN(psi) + np.sin(roll / 2) ** 2 * PATTERN(-psi)
    np.testing.assert_allclose(gain_in_space(PATTERN, OFF, elevation, np.pi / 2).gain, law, rtol=1e-12)


@pytest.mark.parametrize("elevation_deg", [0.0, 20.0])
def test_the_manifold_of_a_tilted_ring_is_the_gain_in_space_and_rolls_with_its_elements(elevation_deg: float) -> None:
    ring, tilt, elevation = GainManifold.ring(6), np.radians(25.0), float(np.radians(elevation_deg))
    tilted = GainManifold(PATTERN, ring.boresights_rad, boresight_elevations_rad=np.full(6, tilt))
    at = tilted.at_elevation(elevation)
    off = OFF - ring.boresights_rad[:, np.newaxis]
    by_formula = gain_in_space(PATTERN, off, elevation, tilt)
    np.testing.assert_array_equal(at.gain(OFF), by_formula.gain)
    np.testing.assert_array_equal(at.derivative(OFF), by_formula.by_azimuth)
    np.testing.assert_allclose(np.roll(at.gain(OFF), -1, axis=0), at.gain(OFF + np.radians(60.0)), rtol=1e-9)
    some = at.take([1, 4])
    np.testing.assert_array_equal(some.gain(OFF), at.gain(OFF)[[1, 4]])
    in_space = tilted.response_in_space(off.T, np.full((OFF.size, 1), elevation))
    np.testing.assert_array_equal(in_space.gain, by_formula.gain.T)


def test_without_noise_a_tilted_array_finds_every_azimuth_of_sources_at_the_elevation_it_was_told() -> None:
    tilts = np.radians([30.0, -20.0, 10.0, 45.0, 0.0, 30.0])
    array = GainManifold(PATTERN, GainManifold.ring(6).boresights_rad, boresight_elevations_rad=tilts)
    for elevation in (0.0, 0.4):
        manifold = array.at_elevation(elevation)
        found = estimate_bearings(manifold.gain(OFF).T[:, np.newaxis], manifold).azimuth_rad
        error = np.degrees(np.abs(difference(found, OFF)))
        assert np.quantile(error, 0.95) < 1e-6  # a few lie on the kink of eq. (1)
        assert error.max() < 0.5


def test_an_array_that_takes_its_tilt_for_level_is_wrong_by_degrees() -> None:
    tilts = np.radians([40.0, 0.0, 40.0, 0.0, 40.0, 0.0])
    ring = GainManifold.ring(6)
    tilted = GainManifold(PATTERN, ring.boresights_rad, boresight_elevations_rad=tilts)
    found = estimate_bearings(tilted.gain(OFF).T[:, np.newaxis], ring).azimuth_rad
    assert np.degrees(np.sqrt(np.mean(np.square(difference(found, OFF))))) > 2.0


@pytest.mark.parametrize("tilt", [0.0, -1.5, -0.3, 0.2, 0.7, np.pi / 2])
@pytest.mark.parametrize("elevation", [-0.9, -0.2, 0.05, 0.5, 1.2])
def test_slopes_are_differences(elevation: float, tilt: float) -> None:
    off = OFF[np.abs(np.abs(np.degrees(OFF)) - 153.0) > 12.0]  # eq. (1) has a kink where its angle passes 0/360
    ahead = np.cos(tilt) * np.cos(elevation) * np.cos(off) + np.sin(tilt) * np.sin(elevation)
    off = off[np.abs(np.degrees(np.arccos(ahead)) - 153.0) > 0.5]
    step = 1e-6
    here = gain_in_space(PATTERN, off, elevation, tilt)
    turned = [gain_in_space(PATTERN, off + s, elevation, tilt).gain for s in (step, -step)]
    raised = [gain_in_space(PATTERN, off, elevation + s, tilt).gain for s in (step, -step)]
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
