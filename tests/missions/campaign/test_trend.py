"""Discharges are grown, constant, new or gone, and sites that were not inspected are neither."""

from pathlib import Path

import numpy as np
import pytest

from dirmusic import InputFileError
from pdpatrol.missions.campaign.inspection import read_inspections
from pdpatrol.missions.campaign.page import describe_change, trend_table
from pdpatrol.missions.campaign.records import TrackedDischarge, Trend
from pdpatrol.missions.campaign.trend import fit_line, make_trend
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.records import report_text
from tests.missions.campaign.surveys import SurveyedSource, along, inspection, survey

PLACE, OTHER = (10.0, 10.0, 1.6), (30.0, 10.0, 1.6)
PAST, PAST_BOTH, ELSEWHERE = (
    along((6.0, 7.0), (14.0, 7.0)),
    along((6.0, 7.0), (34.0, 7.0)),
    along((5.0, 29.0), (9.0, 29.0)),
)
DAYS = ("2026-03-02", "2026-03-09", "2026-03-16", "2026-03-23", "2026-03-30", "2026-04-06")


def trend_of(*logs: MissionLog) -> Trend:
    return make_trend([inspection(log) for log in logs])


def in_the_west(trend: Trend) -> TrackedDischarge:
    (place,) = (each for each in trend.discharges if each.position_m[0] < 20.0)
    return place


def without_place(day: str, poses: np.ndarray = PAST) -> MissionLog:
    """Return a survey with only a distant discharge, which shows that the receiver works."""
    return survey(
        np.concatenate([poses, along((27.0, 7.0), (33.0, 7.0))]), SurveyedSource(OTHER, spread_db=2.0), day=day
    )


def test_growing_and_constant_discharge_are_separated() -> None:
    logs = [
        survey(
            PAST_BOTH, SurveyedSource(PLACE, -20.0 + 3.0 * k, 3.0), SurveyedSource(OTHER, -10.0, 3.0), day=day, seed=k
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
    assert describe_change(grown) == "grown"
    assert describe_change(constant).startswith("constant within ")


@pytest.mark.parametrize(
    ("level_db", "drive", "presence"),
    [
        pytest.param(0.0, PAST, "absent", id="past"),
        pytest.param(0.0, ELSEWHERE, "not inspected", id="elsewhere"),
        pytest.param(0.0, along((6.0, 3.0), (14.0, 3.0)), "absent", id="strong from 7 m"),
        pytest.param(-28.0, along((6.0, 3.0), (14.0, 3.0)), "not inspected", id="weak from 7 m"),
        pytest.param(0.0, along((9.0, 6.0), (11.0, 6.0), 0.1), "not inspected", id="small aperture"),
    ],
)
def test_discharge_is_gone_only_if_it_would_have_been_found(level_db: float, drive: np.ndarray, presence: str) -> None:
    both = [survey(PAST_BOTH, SurveyedSource(PLACE, level_db), SurveyedSource(OTHER), day=day) for day in DAYS[:2]]
    place = in_the_west(trend_of(*both, without_place(DAYS[2], drive)))
    assert [each.presence for each in place.observations] == ["found", "found", presence]
    assert place.status == ("gone" if presence == "absent" else "standing")
    assert ("gone since 2026-03-16" in describe_change(place)) == (presence == "absent")
    assert ("not inspected on 2026-03-16" in describe_change(place)) == (presence == "not inspected")


def test_discharge_is_new_only_if_its_site_was_inspected_before() -> None:
    found = survey(PAST_BOTH, SurveyedSource(PLACE, spread_db=2.0), SurveyedSource(OTHER, spread_db=2.0), day=DAYS[1])
    for drive, status in ((PAST, "new"), (ELSEWHERE, "standing")):
        place = in_the_west(trend_of(without_place(DAYS[0], drive), found))
        assert place.status == status
        assert place.verdict == "too few dates"


def test_field_data_give_levels_but_neither_rates_nor_absence() -> None:
    """A table contains only what triggered; how long the receiver waited is unknown."""
    logs = [survey(PAST_BOTH, SurveyedSource(PLACE, -10.0, 2.0), SurveyedSource(OTHER), day=day) for day in DAYS[:3]]
    logs.append(without_place(DAYS[3]))
    for log in logs:
        log.meta["field_data"] = {"file": "survey.csv"}
    place = in_the_west(trend_of(*logs))
    assert place.level is not None
    assert place.level.at_start == pytest.approx(-10.0, abs=0.5)
    assert place.rate is None
    assert all(each.rate_hz is None for each in place.observations)
    assert [each.presence for each in place.observations] == ["found"] * 3 + ["not inspected"]


def test_trend_is_read_back_from_its_text() -> None:
    trend = trend_of(*(survey(PAST, SurveyedSource(PLACE, spread_db=2.0), day=day) for day in DAYS[:3]))
    again = Trend.model_validate_json(report_text(trend))
    assert again.model_dump(mode="json") == trend.model_dump(mode="json")
    assert again.dates == DAYS[:3]
    assert trend_table(trend).row_count == 1


@pytest.mark.parametrize(("scatter", "n_weeks"), [(0.0, 6), (1.0, 6), (1.0, 4), (3.0, 12)])
def test_slope_interval_covers_the_truth_in_99_of_100_campaigns(scatter: float, n_weeks: int) -> None:
    rng, weeks, n = np.random.default_rng(3), np.arange(float(n_weeks)), 1000
    held = 0
    for _ in range(n):
        std = rng.uniform(0.3, 1.2, n_weeks)
        line = fit_line(weeks, 0.7 * weeks + rng.normal(0.0, np.hypot(std, scatter)), std)
        assert line is not None
        held += line.per_week.lower <= 0.7 <= line.per_week.upper
    assert held / n >= 0.98


def test_line_through_exact_values_is_that_line() -> None:
    weeks = np.arange(6.0)
    line = fit_line(weeks, 2.0 + 3.0 * weeks, np.full(6, 0.5))
    assert line is not None
    assert (line.per_week.value, line.at_start, line.scatter) == pytest.approx((3.0, 2.0, 0.0))
    assert line.per_week.lower < 3.0 < line.per_week.upper


def test_less_certain_inspection_has_less_weight() -> None:
    value = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 9.0])
    lines = [fit_line(np.arange(6.0), value, np.array([0.5] * 5 + [last])) for last in (0.5, 9.0)]
    certain, uncertain = (line.per_week.value for line in lines if line is not None)
    assert uncertain < 0.1 < 1.0 < certain


def test_line_needs_three_dates() -> None:
    assert fit_line(np.array([0.0, 0.0, 1.0]), np.zeros(3), np.ones(3)) is None
    assert fit_line(np.array([0.0, 1.0, 2.0]), np.zeros(3), np.ones(3)) is not None


def saved(folder: Path, log: MissionLog) -> Path:
    folder.mkdir()
    log.save(folder)
    return folder


def test_inspections_are_sorted_by_date(tmp_path: Path) -> None:
    days = ("2026-03-09", "2026-03-02", "2026-03-09")
    folders = [saved(tmp_path / str(k), survey(PAST, day=day)) for k, day in enumerate(days)]
    assert [each.day for each in read_inspections(folders)] == sorted(days)


def test_unusable_folders_are_one_line_each(tmp_path: Path) -> None:
    good, undated = saved(tmp_path / "good", survey(PAST)), saved(tmp_path / "old", survey(PAST, day=None))
    of_yard = survey(PAST)
    of_yard.meta["scenario"] = {"yard": {"size_m": [40.0, 30.0]}}
    damaged = survey(PAST, SurveyedSource(PLACE))
    damaged.meta["array"] = {"boresights_rad": "none"}
    other, no_array = saved(tmp_path / "other", of_yard), saved(tmp_path / "no_array", damaged)
    incomplete, broken = saved(tmp_path / "incomplete", survey(PAST[:0])), tmp_path / "broken"
    broken.mkdir()
    (broken / "log.npz").write_bytes(b"none")
    with pytest.raises(InputFileError) as caught:
        read_inspections([good, undated, good, other, incomplete, broken, no_array, tmp_path / "none"])
    for folder, message in (
        (undated, "must have a date"),
        (good, "must be given once"),
        (other, "must be of the yard of"),
        (incomplete, "the mission is incomplete"),
        (broken, "is not the log of a mission"),
        (no_array, "is not the log of a mission (its metadata are damaged)"),
        (tmp_path / "none", "log.npz"),
    ):
        assert sum(line.startswith(str(folder)) and message in line for line in caught.value.faults) == 1
    assert len(caught.value.faults) == 7
