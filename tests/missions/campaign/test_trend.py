"""What became of discharges: grown, constant, new, gone, and what nobody looked at."""

from pathlib import Path

import numpy as np
import pytest

from dirmusic import InputFileError
from pdpatrol.missions.campaign.inspection import read_inspections
from pdpatrol.missions.campaign.records import Trend
from pdpatrol.missions.campaign.tables import trend_table
from pdpatrol.missions.campaign.trend import make_trend
from pdpatrol.missions.campaign.trend_file import trend_text
from pdpatrol.missions.campaign.words import what_became
from pdpatrol.missions.record.mission_log import MissionLog
from tests.missions.campaign.surveys import Source, along, inspection, survey

PLACE, OTHER = (10.0, 10.0, 1.6), (30.0, 10.0, 1.6)
PAST, PAST_BOTH, ELSEWHERE = (
    along((6.0, 7.0), (14.0, 7.0)),
    along((6.0, 7.0), (34.0, 7.0)),
    along((5.0, 29.0), (9.0, 29.0)),
)
DAYS = ("2026-03-02", "2026-03-09", "2026-03-16", "2026-03-23", "2026-03-30", "2026-04-06")


def trend_of(*logs: MissionLog) -> Trend:
    return make_trend([inspection(log) for log in logs])


def quiet(day: str, poses: np.ndarray = PAST) -> MissionLog:
    """Another discharge far from the place, so that the receiver is known to work."""
    return survey(np.concatenate([poses, along((27.0, 7.0), (33.0, 7.0))]), Source(OTHER, spread_db=2.0), day=day)


def test_one_grows_and_the_other_does_not() -> None:
    logs = [
        survey(
            PAST_BOTH, Source(PLACE, -20.0 + 3.0 * k, 3.0), Source(OTHER, -10.0, 3.0), day=day, seed=k
        )
        for k, day in enumerate(DAYS)
    ]  # fmt: skip
    grown, constant = trend_of(*logs).discharges
    assert grown.level is not None
    assert constant.level is not None
    assert (grown.verdict, constant.verdict) == ("grown", "constant")
    assert grown.level.per_week.lower < 3.0 < grown.level.per_week.upper
    assert grown.level.per_week.value == pytest.approx(3.0, abs=0.3)
    assert constant.level.per_week.lower < 0.0 < constant.level.per_week.upper
    assert grown.position_m[0] == pytest.approx(10.0, abs=0.1)
    assert what_became(grown) == "grown"
    assert what_became(constant).startswith("constant within ")


def test_what_was_looked_at_and_not_found_is_gone_and_what_was_not_looked_at_is_not() -> None:
    """The last inspection passes the place, or stays away from it."""
    source = Source(PLACE, spread_db=2.0)
    both = [survey(PAST_BOTH, source, Source(OTHER, spread_db=2.0), day=day) for day in DAYS[:2]]
    for way, presence, status in ((PAST, "absent", "gone"), (ELSEWHERE, "not inspected", "standing")):
        trend = trend_of(*both, quiet(DAYS[2], way))
        (place,) = (each for each in trend.discharges if each.position_m[0] < 20.0)
        assert [each.presence for each in place.observations] == ["found", "found", presence]
        assert place.status == status
        assert ("gone since 2026-03-16" in what_became(place)) == (status == "gone")
        assert ("not inspected on 2026-03-16" in what_became(place)) == (status == "standing")


def test_what_was_looked_at_and_not_there_before_is_new() -> None:
    found = survey(PAST_BOTH, Source(PLACE, spread_db=2.0), Source(OTHER, spread_db=2.0), day=DAYS[1])
    for way, status in ((PAST, "new"), (ELSEWHERE, "standing")):
        (place,) = (each for each in trend_of(quiet(DAYS[0], way), found).discharges if each.position_m[0] < 20.0)
        assert place.status == status
        assert place.verdict == "too few dates"


def test_a_discharge_that_would_be_too_weak_to_be_detected_from_there_is_not_gone() -> None:
    """From 7 m over 59 degrees: the loud one would have been found, the weak one not."""
    for level_db, presence in ((0.0, "absent"), (-28.0, "not inspected")):
        before = survey(PAST_BOTH, Source(PLACE, level_db), Source(OTHER), day=DAYS[0])
        after = quiet(DAYS[1], along((6.0, 3.0), (14.0, 3.0)))
        (place,) = (each for each in trend_of(before, after).discharges if each.position_m[0] < 20.0)
        assert place.observations[0].level_db is not None
        assert place.observations[1].presence == presence


def test_what_was_passed_on_one_side_of_it_in_a_hurry_is_not_gone() -> None:
    """Lines of sight open by less than what confirms a finding."""
    both = [survey(PAST, Source(PLACE, spread_db=2.0), day=day) for day in DAYS[:2]]
    for way, presence in ((along((9.0, 6.0), (11.0, 6.0), 0.1), "not inspected"), (PAST, "absent")):
        (place,) = (d for d in trend_of(*both, quiet(DAYS[2], way)).discharges if d.position_m[0] < 20.0)
        assert place.observations[2].presence == presence


def test_data_from_the_field_tell_levels_and_neither_rates_nor_absence() -> None:
    """A table holds what triggered: nobody knows how long the receiver waited, and where nothing did."""
    logs = [survey(PAST_BOTH, Source(PLACE, -10.0, 2.0), Source(OTHER), day=day) for day in DAYS[:3]]
    logs.append(quiet(DAYS[3]))
    for log in logs:
        log.meta["field_data"] = {"file": "survey.csv"}
    (place,) = (d for d in trend_of(*logs).discharges if d.position_m[0] < 20.0)
    assert place.level is not None
    assert place.level.at_start == pytest.approx(-10.0, abs=0.5)
    assert place.rate is None
    assert all(each.rate_hz is None for each in place.observations)
    assert [each.presence for each in place.observations] == ["found"] * 3 + ["not inspected"]


def test_a_trend_is_read_back_from_its_text() -> None:
    trend = trend_of(*(survey(PAST, Source(PLACE, spread_db=2.0), day=day) for day in DAYS[:3]))
    again = Trend.model_validate_json(trend_text(trend))
    assert again.model_dump(mode="json") == trend.model_dump(mode="json")
    assert again.dates == DAYS[:3]
    assert trend_table(trend).row_count == 1


def saved(folder: Path, log: MissionLog) -> Path:
    folder.mkdir()
    log.save(folder)
    return folder


def test_inspections_come_by_date_and_two_may_be_of_one_day(tmp_path: Path) -> None:
    days = ("2026-03-09", "2026-03-02", "2026-03-09")
    folders = [saved(tmp_path / str(k), survey(PAST, day=day)) for k, day in enumerate(days)]
    assert [each.day for each in read_inspections(folders)] == sorted(days)


def test_what_cannot_be_used_is_a_line_for_each_folder(tmp_path: Path) -> None:
    good, undated = saved(tmp_path / "good", survey(PAST)), saved(tmp_path / "old", survey(PAST, day=None))
    of_yard = survey(PAST)
    of_yard.meta["scenario"] = {"yard": {"size_m": [40.0, 30.0]}}
    other, cut = saved(tmp_path / "other", of_yard), survey(PAST, Source(PLACE))
    cut._rows["association"] = {"pulse": [], "finding": []}
    damaged = survey(PAST, Source(PLACE))
    damaged.meta["array"] = {"boresights_rad": "none"}
    no_array = saved(tmp_path / "no_array", damaged)
    cut_off, broken = saved(tmp_path / "cut", cut), tmp_path / "broken"
    broken.mkdir()
    (broken / "log.npz").write_bytes(b"none")
    with pytest.raises(InputFileError) as caught:
        read_inspections([good, undated, good, other, cut_off, broken, no_array, tmp_path / "none"])
    for folder, told in (
        (undated, "has no date of inspection"),
        (good, "given twice"),
        (other, "is of another yard than"),
        (cut_off, "the mission was cut short"),
        (broken, "is not the log of a mission"),
        (no_array, "is not the log of a mission (its facts are damaged)"),
        (tmp_path / "none", "holds no log.npz"),
    ):
        assert sum(fault.startswith(str(folder)) and told in fault for fault in caught.value.faults) == 1
    assert len(caught.value.faults) == 7
