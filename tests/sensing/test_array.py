"""Array: positions of its elements, and their tabulated gain against the formula."""

import numpy as np
import pytest

from dirmusic.array.pattern import Boresight, gain_and_slopes_towards, gain_in_space, gain_towards
from pdpatrol.sensing import ArrayConfig, ElementConfig, HelicalArray
from pdpatrol.sensing.array.array_table import ArrayTable

TILTED = ArrayConfig(
    elements=tuple(ElementConfig(azimuth_deg=60.0 * k, elevation_deg=(-50.0, 20.0, 89.0)[k % 3]) for k in range(6))
)


@pytest.mark.parametrize("config", [ArrayConfig(), TILTED, ArrayConfig(n_elements=16)], ids=["level", "tilted", "16"])
def test_tabulated_gain_matches_pattern_to_nine_digits(config: ArrayConfig) -> None:
    """The compiled table of the gain against the formula that direction finding uses."""
    rng, array = np.random.default_rng(0), HelicalArray.draw(config, np.random.default_rng(1))
    table = ArrayTable.of(array)
    pattern = table.pattern
    for x, y, z in rng.normal(0.0, 5.0, (200, 3)):
        azimuth, elevation = np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))
        by_table = [gain_towards(pattern, Boresight(*boresight), x, y, z) for boresight in table.boresights]
        off_rad = azimuth - array.boresights_rad
        by_formula = gain_in_space(array.cut, off_rad, elevation, array.boresight_elevations_rad).gain
        off = np.abs(np.array(by_table) - by_formula)
        assert np.sort(off)[-2] < 1e-9  # one direction may lie on the step of eq. (1), which the table slopes
        assert off.max() < 0.01
        towards = array.gain(np.full(off.size, azimuth), np.full(off.size, elevation))
        np.testing.assert_array_equal(towards, array.gain_factors * by_formula + array.gain_offsets)


@pytest.mark.parametrize("config", [ArrayConfig(), TILTED], ids=["level", "tilted"])
def test_tabulated_slopes_match_formula(config: ArrayConfig) -> None:
    rng, array = np.random.default_rng(0), HelicalArray.draw(config, np.random.default_rng(1))
    table, off = ArrayTable.of(array), list[float]()
    for azimuth, elevation in zip(rng.uniform(-np.pi, np.pi, 200), rng.uniform(-1.5, 1.5, 200), strict=True):
        level = np.cos(elevation)
        x, y, z = level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)
        by_table = [
            gain_and_slopes_towards(table.pattern, Boresight(*boresight), x, y, z) for boresight in table.boresights
        ]
        off_rad = azimuth - array.boresights_rad
        by_formula = gain_in_space(array.cut, off_rad, elevation, array.boresight_elevations_rad)
        off.append(float(np.abs(np.array(by_table) - np.stack(by_formula, axis=-1)).max()))
    assert np.quantile(off, 0.97) < 1e-7  # the others lie on the step of eq. (1)


@pytest.mark.parametrize("n", [3, 4, 6, 16])
def test_ring_starts_at_left_and_goes_clockwise(n: int) -> None:
    array = HelicalArray.nominal(ArrayConfig(n_elements=n, ring_radius_m=0.2, height_m=0.7))
    places_m = array.positions_m
    np.testing.assert_allclose(places_m[0], [0.0, 0.2, 0.7], atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(places_m[:, :2], axis=-1), 0.2)
    turned = places_m[:, 0] + 1j * places_m[:, 1]
    np.testing.assert_allclose(np.roll(turned, -1) / turned, np.exp(-2j * np.pi / n))
    np.testing.assert_allclose(np.exp(1j * array.boresights_rad), turned / 0.2)
    assert not array.boresight_elevations_rad.any()


def test_listed_elements_default_to_the_ring() -> None:
    first = ElementConfig(azimuth_deg=10.0, elevation_deg=20.0, position_m=(0.1, 0.0, 0.9))
    others = [ElementConfig(azimuth_deg=azimuth) for azimuth in (120.0, 240.0)]
    array = HelicalArray.nominal(ArrayConfig(elements=(first, *others), ring_radius_m=0.2, height_m=0.7))
    np.testing.assert_allclose(np.degrees(array.boresights_rad), [10.0, 120.0, 240.0])
    np.testing.assert_allclose(np.degrees(array.boresight_elevations_rad), [20.0, 0.0, 0.0])
    np.testing.assert_allclose(array.positions_m[0], [0.1, 0.0, 0.9])
    np.testing.assert_allclose(array.positions_m[1], [-0.1, 0.2 * np.sin(np.radians(120)), 0.7])
