"""Gain in space, and bearings of sources above the plane of the array."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dirmusic import (
    ArrayModel,
    Bearings,
    GainManifold,
    GaussianPattern,
    PulseBatch,
    TabulatedPattern,
    estimate_bearings,
)
from dirmusic.angles import difference
from dirmusic.array.element_errors import UNEXPLAINED
from dirmusic.array.pattern import Boresight, gain_and_slopes_towards, gain_in_space, gain_towards, tabulate
from dirmusic.bearing.elevation import total_std
from dirmusic.bearing.maximum_likelihood import in_plane_likelihood, maximum_likelihood
from tests.dirmusic.scenes import RING, SPREAD, detected, rms, robust_std, with_bearings

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


SMOOTH_RAD = np.radians(np.arange(-180.0, 180.0, 5.0))
WITH_CUTS = TabulatedPattern(
    SMOOTH_RAD,
    0.1 + np.exp(3.0 * (np.cos(SMOOTH_RAD) - 1.0)),
    TabulatedPattern(SMOOTH_RAD, 0.3 + 0.2 * np.sin(SMOOTH_RAD) + np.exp(np.cos(SMOOTH_RAD) - 1.0)),
)
"""Beam that is higher than wide, and stronger above than below."""


@pytest.mark.parametrize("tilt", [0.0, -1.1, 0.2])
@pytest.mark.parametrize("elevation", [-0.9, 0.0, 0.5, 1.2])
def test_slopes_with_two_cuts_match_differences(elevation: float, tilt: float) -> None:
    """The formula and the compiled kernel, which also has the slope by the width of the beam."""
    off, step, table = np.radians(np.arange(-175.0, 180.0, 10.0)), 1e-6, tabulate(WITH_CUTS)
    boresight = Boresight(1.0, 0.0, np.cos(tilt), np.sin(tilt))

    def kernel(turn: float, rise: float, widening: float) -> np.ndarray:
        up = elevation + rise
        towards = [(np.cos(up) * np.cos(a + turn), np.cos(up) * np.sin(a + turn), np.sin(up)) for a in off]
        return np.array([gain_and_slopes_towards(table, boresight, *vector, widening) for vector in towards])

    here = gain_in_space(WITH_CUTS, off, elevation, tilt)
    np.testing.assert_allclose(kernel(0.0, 0.0, 0.0)[:, :3], np.transpose(here), atol=1e-7)
    towards = np.cos(elevation) * np.cos(off), np.cos(elevation) * np.sin(off), np.full(off.size, np.sin(elevation))
    gain = [gain_towards(table, boresight, *np.multiply(3.0, vector)) for vector in zip(*towards, strict=True)]
    np.testing.assert_allclose(gain, here.gain, atol=1e-8)
    for column, turn, rise, wide in ((1, step, 0.0, 0.0), (2, 0.0, step, 0.0), (3, 0.0, 0.0, step)):
        after, before = (kernel(s * turn, s * rise, 0.1 + s * wide)[:, 0] for s in (1, -1))
        np.testing.assert_allclose(kernel(0.0, 0.0, 0.1)[:, column], (after - before) / (2 * step), atol=1e-5)


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


def waves_from_above(ring: GainManifold, most_deg: float, n: int) -> tuple[PulseBatch, np.ndarray, np.ndarray]:
    """Draw pulses of arrays with errors of `SPREAD`, with their azimuths and elevations from 0, both (n,)."""
    rng, n_elements = np.random.default_rng(4), ring.n_elements
    azimuth, elevation = rng.uniform(-np.pi, np.pi, n), np.radians(rng.uniform(0.0, most_deg, n))
    turned = rng.normal(0.0, SPREAD.pointing_rad, (n, n_elements))
    gain = gain_in_space(ring.pattern, azimuth[:, np.newaxis] - ring.boresights_rad - turned, elevation[:, np.newaxis])
    noise_v = 10 ** rng.uniform(-3.0, -1.0, (n, 1))
    factor = 1.0 + np.hypot(SPREAD.gain, UNEXPLAINED) * rng.standard_normal((n, n_elements))
    return (
        detected(np.abs(gain.gain * factor + noise_v * rng.standard_normal(factor.shape)), noise_v),
        azimuth,
        elevation,
    )


def as_known(ring: GainManifold) -> ArrayModel:
    return ArrayModel(
        manifold=ring, positions_m=np.zeros((ring.n_elements, 3)), spread=replace(SPREAD, unexplained=UNEXPLAINED)
    )


@pytest.mark.parametrize(("n_elements", "most", "before"), [(4, 0.13, 0.2), (6, 0.07, 0.09)])
def test_few_bearings_of_sources_above_are_far_off(n_elements: int, most: float, before: float) -> None:
    ring = GainManifold.ring(n_elements)
    pulses, azimuth, elevation = waves_from_above(ring, 80.0, 10_000)
    found, in_plane = (estimate(pulses, as_known(ring)) for estimate in (maximum_likelihood, in_plane_likelihood))
    far_off, was_far_off = (
        np.abs(difference(each.azimuth_rad, azimuth)) > np.radians(20.0) for each in (found, in_plane)
    )
    assert far_off.mean() < most < before < was_far_off.mean()
    is_above = found.elevation_rad > 0.0
    assert is_above[elevation > np.radians(50.0)].mean() > 0.9
    assert rms(found.elevation_rad[is_above] - elevation[is_above]) < np.radians(8.0)


def test_pulses_that_the_plane_explains_keep_their_bearings() -> None:
    pulses, _, _ = waves_from_above(RING, 20.0, 2000)
    found, in_plane = (estimate(pulses, as_known(RING)) for estimate in (maximum_likelihood, in_plane_likelihood))
    level = found.elevation_rad == 0.0
    assert level.mean() > 0.99
    np.testing.assert_array_equal(found.azimuth_rad[level], in_plane.azimuth_rad[level])
    np.testing.assert_array_equal(found.std_rad[level], in_plane.std_rad[level])
    np.testing.assert_array_equal(found.misfit, in_plane.misfit)


def test_waves_without_errors_are_found_in_azimuth_and_elevation() -> None:
    azimuth, elevation = OFF[::7, np.newaxis], np.radians([50.0, 63.0, 70.0, 78.0])
    gain = gain_in_space(PATTERN, azimuth[..., np.newaxis] - RING.boresights_rad, elevation[:, np.newaxis]).gain
    found = maximum_likelihood(detected(gain.reshape(-1, 6), 1e-6), as_known(RING))
    azimuth, elevation = (each.ravel() for each in np.broadcast_arrays(azimuth, elevation))
    assert np.degrees(np.abs(difference(found.azimuth_rad, azimuth))).max() < 2.0
    assert np.degrees(np.abs(found.elevation_rad - elevation)).max() < 2.5


def test_total_deviation_matches_errors_in_every_class() -> None:
    pulses, azimuth, _ = waves_from_above(RING, 80.0, 20_000)
    pulses = with_bearings(pulses, as_known(RING))
    offset_rad, total_rad = difference(pulses.azimuth_rad, azimuth), total_std(pulses, as_known(RING))
    by_noise = robust_std(offset_rad / pulses.std_rad)
    assert by_noise > 3.0
    for stated_rad in (pulses.std_rad, total_rad):
        for low, high in pairwise(np.radians([0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 60.0])):
            own = (low <= stated_rad) & (stated_rad < high)
            assert own.sum() < 300 or 0.85 < robust_std(offset_rad[own] / total_rad[own]) < 1.15


def test_total_deviation_ignores_faulty_channels() -> None:
    pulses, _, _ = waves_from_above(RING, 60.0, 50)
    good = np.array([True, True, False, True, True, True])
    known, five = as_known(RING), with_bearings(pulses.take_channels(good), as_known(RING).take(good))
    directions = {name: getattr(five, name) for name in Bearings._fields}
    six = pulses._replace(**directions, is_usable=np.broadcast_to(good, pulses.strengths_v.shape))
    np.testing.assert_allclose(total_std(six, known), total_std(five, known.take(good)))
