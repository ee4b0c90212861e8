"""Level and rate as they left the source, from wherever it was seen."""

import numpy as np
import pytest

from pdpatrol.missions.campaign.product_limit import product_limit
from pdpatrol.missions.campaign.source_level import SourceLevel, source_level
from tests.missions.campaign.surveys import Source, along, inspection, survey

SOURCE = (10.0, 10.0, 1.6)


def level_of(source: Source, *ways: np.ndarray) -> SourceLevel:
    seen = inspection(survey(np.concatenate(ways), source))
    level = source_level(seen, seen.findings[0])
    assert level is not None
    return level


@pytest.mark.parametrize("range_m", [2.5, 5.0, 9.0])
def test_the_level_of_a_source_is_the_same_from_any_distance_and_direction(range_m: float) -> None:
    way = along((8.0, 10.0 - range_m), (12.0, 10.0 - range_m))
    assert level_of(Source(SOURCE, level_db=-6.0), way).level_db == pytest.approx(-6.0, abs=1e-9)


def test_pulses_too_weak_to_trigger_from_afar_make_no_level_higher() -> None:
    """From 9 m half of the pulses are missing; the level of those that are there is 3 dB too high."""
    near, far = along((8.0, 7.0), (12.0, 7.0)), along((4.0, 1.0), (16.0, 1.0))
    source = Source(SOURCE, level_db=-27.0, spread_db=5.0, rate_hz=50.0)
    level = level_of(source, near, far)
    assert level.level_db == pytest.approx(-27.0, abs=1.0)
    assert abs(level.level_db + 27.0) < 3 * level.level_std_db
    assert level.rate_hz == pytest.approx(50.0, rel=0.15)
    assert level_of(source, far).level_db > -25.5  # of the far ones alone nothing better can be told


def test_a_rate_is_that_of_the_source_however_long_the_robot_stays() -> None:
    way = along((8.0, 7.0), (12.0, 7.0))
    standing = np.tile(way[:1], (300, 1))
    for ways in ((way,), (standing, way)):
        level = level_of(Source(SOURCE, spread_db=3.0, rate_hz=40.0), *ways)
        assert abs(np.log(level.rate_hz / 40.0)) < 3 * level.log_rate_std


def test_a_rate_grows_with_the_rate_of_the_source_and_its_level_does_not() -> None:
    way = along((6.0, 7.0), (14.0, 7.0))
    seldom, often = (level_of(Source(SOURCE, spread_db=2.0, rate_hz=rate), way) for rate in (10.0, 40.0))
    assert often.rate_hz / seldom.rate_hz == pytest.approx(4.0, rel=0.2)
    assert often.level_db == pytest.approx(seldom.level_db, abs=0.5)


def test_a_place_where_the_robot_stands_for_long_counts_no_more_than_others() -> None:
    """The finding is a metre off, so that the level differs from place to place."""
    way = along((8.0, 7.0), (12.0, 7.0))
    levels = list[float]()
    for poses in (way, np.concatenate([np.tile(way[:1], (600, 1)), way])):
        seen = inspection(survey(poses, Source(SOURCE)))
        level = source_level(seen, seen.findings[0]._replace(position_m=np.array([9.0, 10.0, 1.6])))
        assert level is not None
        levels.append(level.level_db)
    assert levels[0] == pytest.approx(levels[1], abs=0.5)


def test_the_stated_deviation_covers_an_error_of_the_position() -> None:
    seen = inspection(survey(along((8.0, 7.0), (12.0, 7.0)), Source(SOURCE)))
    off = seen.findings[0]._replace(position_m=np.array([10.0, 10.6, 1.6]))
    stds_db = list[float]()
    for std_m in (0.01, 0.6):
        level = source_level(seen, off._replace(covariance_m2=np.diag([1e-4, std_m**2, 1e-4])))
        assert level is not None
        stds_db.append(level.level_std_db)
    assert level.level_db > 1.2 * stds_db[0]
    assert level.level_db < 2.0 * stds_db[1]
    assert stds_db[1] ** 2 - stds_db[0] ** 2 == pytest.approx(level.level_db**2, rel=0.3)


def test_too_few_pulses_tell_no_level() -> None:
    seen = inspection(survey(along((8.0, 7.0), (9.0, 7.0)), Source(SOURCE, rate_hz=2.0)))
    assert source_level(seen, seen.findings[0]) is None


def test_without_bounds_the_product_limit_is_the_plain_distribution() -> None:
    level_db = np.random.default_rng(1).normal(0.0, 5.0, 200)
    distribution = product_limit(level_db, np.full(200, -100.0), np.ones(200))
    np.testing.assert_allclose(distribution.share, 1 / 200)
    assert distribution.above(np.array([-50.0, np.sort(level_db)[100], 50.0])) == pytest.approx([1.0, 0.5, 0.0])
    assert distribution.middle_db == pytest.approx(np.sort(level_db)[50:150].mean())


def test_the_product_limit_gives_back_what_bounds_have_taken() -> None:
    rng = np.random.default_rng(2)
    level_db, least_db = rng.normal(0.0, 5.0, 4000), rng.uniform(-20.0, 8.0, 4000)
    seen = level_db >= least_db
    distribution = product_limit(level_db[seen], least_db[seen], np.ones(seen.sum()))
    assert np.mean(level_db[seen]) > 1.0
    assert distribution.middle_db == pytest.approx(0.0, abs=0.4)
    assert distribution.above(np.array([5.0]))[0] == pytest.approx((level_db > 5.0).mean(), abs=0.03)


def test_nothing_seen_is_an_empty_distribution() -> None:
    assert product_limit(np.empty(0), np.empty(0), np.empty(0)).level_db.size == 0
    assert product_limit(np.zeros(3), np.ones(3), np.ones(3)).level_db.size == 0
