"""Sources of random yards: a fifth of them is at none of the catalogue's sites, and each of those can be found."""

import numpy as np
import pytest

from dirmusic.angles import aperture
from pdpatrol.envs.random_yard import AIR_M, OFF_SITE_M, SEEN_FROM_M, place_off_sites, random_source, random_yard
from pdpatrol.envs.scenario.radio import surroundings_of
from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing.radio.transmission import Sight

YARDS = [random_yard(seed, 1 + seed % 12).yard for seed in range(12)]


def test_a_fifth_of_the_sources_is_off_the_sites_and_the_rest_on_one_of_them() -> None:
    rng = np.random.default_rng(0)
    sources = [random_source(YARDS[k % len(YARDS)], rng) for k in range(600)]
    n_off = sum(source.position_m is not None for source in sources)
    assert 90 <= n_off <= 150  # 120, and three standard deviations
    for k, source in enumerate(sources):
        assert set(source.sites) <= set(YARDS[k % len(YARDS)].site_names())


@pytest.mark.parametrize("k", range(len(YARDS)))
def test_a_source_off_the_sites_is_on_or_near_equipment_and_in_sight_from_several_sides(k: int) -> None:
    yard, rng = YARDS[k], np.random.default_rng(k)
    sites_m = np.array([yard.site_position(name) for name in yard.site_names()])
    for _ in range(4):
        place_m = place_off_sites(yard, rng)
        assert place_m is not None
        assert np.linalg.norm(sites_m - place_m, axis=-1).min() > OFF_SITE_M - 0.001
        assert 0.0 < yard.solids.distance(place_m).min() < AIR_M[1] + 0.02
        assert yard.contains(place_m)
        ground_m = np.random.default_rng(0).uniform([0.0, 0.0], yard.size_m, (4000, 2))
        range_m = np.linalg.norm(ground_m - place_m[:2], axis=-1)
        ground_m = ground_m[(range_m > SEEN_FROM_M[0]) & (range_m < SEEN_FROM_M[1]) & (yard.clearance(ground_m) > 0.5)]
        share = Sight(surroundings_of(yard))(np.column_stack([ground_m, np.full(len(ground_m), 0.6)]), place_m)
        seen_m = ground_m[share > 10 ** (-12 / 20)] - place_m[:2]
        assert aperture(np.arctan2(seen_m[:, 1], seen_m[:, 0])) > np.radians(50.0)


def test_the_yard_and_its_route_do_not_depend_on_where_the_source_is() -> None:
    rng = np.random.default_rng(5)
    assert random_source(Yard(size_m=(20.0, 20.0)), rng).position_m is not None
    for seed in range(6):
        first, again = random_yard(seed, 6), random_yard(seed, 6, has_planned_route=True)
        assert first.yard == again.yard
        assert first.sources == again.sources
