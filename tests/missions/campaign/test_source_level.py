"""Level and rate of a source do not depend on where it was observed."""

import numpy as np
import pytest

from pdpatrol.missions.campaign.source_level import SourceLevel, product_limit, source_level
from tests.missions.campaign.surveys import SurveyedSource, along, inspection, survey

SOURCE = (10.0, 10.0, 1.6)


def level_of(source: SurveyedSource, *drives: np.ndarray) -> SourceLevel:
    seen = inspection(survey(np.concatenate(drives), source))
    level = source_level(seen, seen.findings[0])
    assert level is not None
    return level


@pytest.mark.parametrize("range_m", [2.5, 5.0, 9.0])
def test_level_does_not_depend_on_distance_or_direction(range_m: float) -> None:
    drive = along((8.0, 10.0 - range_m), (12.0, 10.0 - range_m))
    assert level_of(SurveyedSource(SOURCE, level_db=-6.0), drive).level_db == pytest.approx(-6.0, abs=1e-9)


def test_pulses_too_weak_to_trigger_do_not_raise_the_level() -> None:
    """From 9 m half of the pulses are missing, and the median level of the others is 3 dB too high."""
    near, far = along((8.0, 7.0), (12.0, 7.0)), along((4.0, 1.0), (16.0, 1.0))
    source = SurveyedSource(SOURCE, level_db=-27.0, spread_db=5.0, rate_hz=50.0)
    level = level_of(source, near, far)
    assert level.level_db == pytest.approx(-27.0, abs=1.0)
    assert abs(level.level_db + 27.0) < 3 * level.level_std_db
    assert level.rate_hz == pytest.approx(50.0, rel=0.15)
    assert level_of(source, far).level_db > -25.5  # far pulses alone do not determine it better


def test_rate_does_not_depend_on_the_time_spent() -> None:
    drive = along((8.0, 7.0), (12.0, 7.0))
    standing = np.tile(drive[:1], (300, 1))
    for drives in ((drive,), (standing, drive)):
        level = level_of(SurveyedSource(SOURCE, spread_db=3.0, rate_hz=40.0), *drives)
        assert abs(np.log(level.rate_hz / 40.0)) < 3 * level.log_rate_std


def test_long_stop_has_the_weight_of_one_place() -> None:
    """The finding has an error of a metre, so that the level differs between places."""
    drive = along((8.0, 7.0), (12.0, 7.0))
    levels = list[float]()
    for poses in (drive, np.concatenate([np.tile(drive[:1], (600, 1)), drive])):
        seen = inspection(survey(poses, SurveyedSource(SOURCE)))
        level = source_level(seen, seen.findings[0]._replace(position_m=np.array([9.0, 10.0, 1.6])))
        assert level is not None
        levels.append(level.level_db)
    assert levels[0] == pytest.approx(levels[1], abs=0.5)


def test_standard_deviation_covers_a_position_error() -> None:
    seen = inspection(survey(along((8.0, 7.0), (12.0, 7.0)), SurveyedSource(SOURCE)))
    off = seen.findings[0]._replace(position_m=np.array([10.0, 10.6, 1.6]))
    stds_db = list[float]()
    for std_m in (0.01, 0.6):
        level = source_level(seen, off._replace(covariance_m2=np.diag([1e-4, std_m**2, 1e-4])))
        assert level is not None
        stds_db.append(level.level_std_db)
    assert level.level_db > 1.2 * stds_db[0]
    assert level.level_db < 2.0 * stds_db[1]
    assert stds_db[1] ** 2 - stds_db[0] ** 2 == pytest.approx(level.level_db**2, rel=0.3)


def test_too_few_pulses_give_no_level() -> None:
    seen = inspection(survey(along((8.0, 7.0), (9.0, 7.0)), SurveyedSource(SOURCE, rate_hz=2.0)))
    assert source_level(seen, seen.findings[0]) is None


def test_product_limit_without_bounds_is_the_empirical_distribution() -> None:
    level_db = np.random.default_rng(1).normal(0.0, 5.0, 200)
    levels, share = product_limit(level_db, np.full(200, -100.0), np.ones(200))
    np.testing.assert_allclose(share, 1 / 200)
    np.testing.assert_array_equal(levels, np.sort(level_db))


def test_product_limit_restores_truncated_levels() -> None:
    rng = np.random.default_rng(2)
    level_db, min_level_db = rng.normal(0.0, 5.0, 4000), rng.uniform(-20.0, 8.0, 4000)
    seen = level_db >= min_level_db
    levels, share = product_limit(level_db[seen], min_level_db[seen], np.ones(seen.sum()))
    assert np.mean(level_db[seen]) > 1.0
    assert share @ levels == pytest.approx(0.0, abs=0.4)
    assert share[levels > 5.0].sum() == pytest.approx((level_db > 5.0).mean(), abs=0.03)
