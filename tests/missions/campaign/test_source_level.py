"""Level and rate of a source do not depend on where it was observed."""

import numpy as np
import pytest

from pdpatrol.missions.campaign.source_level import SourceLevel, source_level
from tests.missions.campaign.surveys import PAST, PLACE, SurveyedSource, along, inspections, survey


def level_of(source: SurveyedSource, *drives: np.ndarray, **changes: np.ndarray) -> SourceLevel:
    """Return the level of a source, estimated from its finding with some attributes changed."""
    (seen,) = inspections([survey(np.concatenate(drives), source)])
    level = source_level(seen, seen.findings[0]._replace(**changes))
    assert level is not None
    return level


@pytest.mark.parametrize("range_m", [2.5, 5.0, 9.0])
def test_level_does_not_depend_on_distance_or_direction(range_m: float) -> None:
    drive = along((8.0, 10.0 - range_m), (12.0, 10.0 - range_m))
    assert level_of(SurveyedSource(PLACE, level_db=-6.0), drive).level_db == pytest.approx(-6.0, abs=1e-9)


def test_pulses_too_weak_to_trigger_do_not_raise_the_level() -> None:
    """From 9 m, half of the pulses are not detected, and the median level of the others is 3 dB too high."""
    near, far = along((8.0, 7.0), (12.0, 7.0)), along((4.0, 1.0), (16.0, 1.0))
    source = SurveyedSource(PLACE, level_db=-27.0, spread_db=5.0, rate_hz=50.0)
    level = level_of(source, near, far)
    assert level.level_db == pytest.approx(-27.0, abs=1.0)
    assert abs(level.level_db + 27.0) < 3 * level.level_std_db
    assert np.exp(level.log_rate) == pytest.approx(50.0, rel=0.15)
    assert level_of(source, far).level_db > -25.5  # distant pulses alone are less accurate


def test_time_spent_in_one_place_changes_neither_rate_nor_level() -> None:
    """The position of the finding is one metre off, so the level differs between places."""
    levels = [
        level_of(SurveyedSource(PLACE, rate_hz=40.0), *drives, position_m=np.array([9.0, 10.0, 1.6]))
        for drives in ((PAST,), (np.tile(PAST[:1], (600, 1)), PAST))
    ]
    assert levels[0].level_db == pytest.approx(levels[1].level_db, abs=0.5)
    for level in levels:
        assert abs(level.log_rate - np.log(40.0)) < 3 * level.log_rate_std


def test_standard_deviation_covers_a_position_error() -> None:
    known, unknown = (
        level_of(
            SurveyedSource(PLACE),
            along((8.0, 7.0), (12.0, 7.0)),
            position_m=np.array([10.0, 10.6, 1.6]),
            covariance_m2=np.diag([1e-4, std_m**2, 1e-4]),
        )
        for std_m in (0.01, 0.6)
    )
    assert 1.2 * known.level_std_db < known.level_db < 2.0 * unknown.level_std_db
    assert unknown.level_std_db**2 - known.level_std_db**2 == pytest.approx(known.level_db**2, rel=0.3)


def test_too_few_pulses_give_no_level() -> None:
    (seen,) = inspections([survey(along((8.0, 7.0), (9.0, 7.0)), SurveyedSource(PLACE, rate_hz=2.0))])
    assert source_level(seen, seen.findings[0]) is None
