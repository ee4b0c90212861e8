"""Array: positions of its elements, and their tabulated gain against the formula."""

import numpy as np
import pytest

from dirmusic.array.pattern import Boresight, gain_and_slopes_towards, gain_in_space, gain_towards
from pdpatrol.sensing import ArrayConfig, ElementConfig, HelicalArray
from tests.sensing.listening import table_of

TILTED = ArrayConfig(
    elements=tuple(ElementConfig(azimuth_deg=60.0 * k, elevation_deg=(-50.0, 20.0, 89.0)[k % 3]) for k in range(6))
)


@pytest.mark.parametrize("config", [ArrayConfig(), TILTED, ArrayConfig(n_elements=16)], ids=["level", "tilted", "16"])
def test_tabulated_gain_and_slopes_match_formula(config: ArrayConfig) -> None:
    """The compiled table of the gain agrees with the formula that direction finding uses."""
    rng, array = np.random.default_rng(0), HelicalArray.draw(config, np.random.default_rng(1))
    table, off = table_of(array), []
    for azimuth, elevation in zip(rng.uniform(-np.pi, np.pi, 200), rng.uniform(-1.5, 1.5, 200), strict=True):
        level = np.cos(elevation)
        towards = level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)
        looks = [Boresight(*boresight) for boresight in table.boresights]
        by_table = np.array([gain_and_slopes_towards(table.pattern, look, *towards, 0.0)[:3] for look in looks])
        gain = [gain_towards(table.pattern, look, *np.multiply(5.0, towards)) for look in looks]
        np.testing.assert_allclose(gain, by_table[:, 0], atol=1e-12)
        off_rad = azimuth - array.boresights_rad
        by_formula = gain_in_space(array.cut(), off_rad, elevation, array.boresight_elevations_rad)
        off.append(np.sort(np.abs(by_table - np.stack(by_formula, axis=-1)), axis=0))
        in_space = array.gain(np.full(len(looks), azimuth), np.full(len(looks), elevation))
        np.testing.assert_array_equal(in_space, array.gain_factors * by_formula.gain + array.gain_offsets)
    ordered = np.array(off)  # one direction may lie on the step of eq. (1), a slope in the table
    assert ordered[:, -2, 0].max() < 1e-9
    assert ordered[:, -1, 0].max() < 0.01
    assert np.quantile(ordered[:, -2, 1:].max(axis=-1), 0.97) < 1e-7


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
