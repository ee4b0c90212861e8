"""Discharges are classified as grown, constant, new or gone, but not at sites that were not inspected."""

from pathlib import Path

import numpy as np
import pytest

from dirmusic import InputFileError
from pdpatrol.missions.campaign.inspection import read_inspections
from pdpatrol.missions.campaign.page import describe_change
from pdpatrol.missions.campaign.records import TrackedDischarge
from pdpatrol.missions.campaign.trend import LEVEL_SCATTER_DB, RELEVANT_DB_PER_WEEK, fit_line, judge, make_trend
from pdpatrol.missions.record.mission_log import MissionLog
from tests.missions.campaign.surveys import DAYS, PAST, PLACE, SurveyedSource, along, inspections, survey

OTHER = (30.0, 10.0, 1.6)
PAST_BOTH, ELSEWHERE = along((6.0, 7.0), (34.0, 7.0)), along((5.0, 29.0), (9.0, 29.0))


def both(day: str, level_db: float = 0.0, other_db: float = 0.0, seed: int = 0) -> MissionLog:
    """Return a survey that passes two discharges."""
    sources = SurveyedSource(PLACE, level_db, 2.0), SurveyedSource(OTHER, other_db, 2.0)
    return survey(PAST_BOTH, *sources, day=day, seed=seed)


def without_place(day: str, poses: np.ndarray = PAST) -> MissionLog:
    """Return a survey with only a distant discharge, which shows that the receiver works."""
    drives = np.concatenate([poses, along((27.0, 7.0), (33.0, 7.0))])
    return survey(drives, SurveyedSource(OTHER, spread_db=2.0), day=day)


def at_place(*logs: MissionLog) -> TrackedDischarge:
    """Return the discharge at `PLACE` in the trend of some surveys."""
    (place,) = (each for each in make_trend(inspections(logs)).discharges if each.position_m[0] < 20.0)
    return place


@pytest.mark.whole
def test_growing_and_constant_discharge_are_separated() -> None:
    logs = [both(day, -20.0 + 3.0 * k, -10.0, seed=k) for k, day in enumerate(DAYS)]
    grown, constant = make_trend(inspections(logs)).discharges
    assert grown.level is not None
    assert constant.level is not None
    assert (grown.verdict, constant.verdict) == ("grown", "constant")
    assert grown.level.per_week.lower < 3.0 < grown.level.per_week.upper
    assert grown.level.per_week.value == pytest.approx(3.0, abs=0.3)
    assert constant.level.per_week.lower < 0.0 < constant.level.per_week.upper
    assert grown.position_m[0] == pytest.approx(10.0, abs=0.1)
    assert describe_change(grown) == "grown"
    assert describe_change(constant).startswith("constant within ")


@pytest.mark.whole
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
    place = at_place(*(both(day, level_db) for day in DAYS[:2]), without_place(DAYS[2], drive))
    assert [each.presence for each in place.observations] == ["found", "found", presence]
    assert place.status == ("gone" if presence == "absent" else "standing")
    change = "gone since 2026-03-16" if presence == "absent" else "not inspected on 2026-03-16"
    assert change in describe_change(place)


@pytest.mark.parametrize(("drive", "status"), [(PAST, "new"), (ELSEWHERE, "standing")])
def test_discharge_is_new_only_if_its_site_was_inspected_before(drive: np.ndarray, status: str) -> None:
    place = at_place(without_place(DAYS[0], drive), both(DAYS[1]))
    assert (place.status, place.verdict) == (status, "too few dates")


@pytest.mark.whole
def test_field_data_give_levels_but_neither_rates_nor_absence() -> None:
    """A table contains only pulses that triggered; the waiting time of the receiver is unknown."""
    logs = [*(both(day, -10.0) for day in DAYS[:3]), without_place(DAYS[3])]
    for log in logs:
        log.meta["field_data"] = {"file": "survey.csv"}
    place = at_place(*logs)
    assert place.level is not None
    assert place.level.at_start == pytest.approx(-10.0, abs=0.5)
    assert place.rate is None
    assert all(each.rate_hz is None for each in place.observations)
    assert [each.presence for each in place.observations] == ["found"] * 3 + ["not inspected"]


@pytest.mark.whole
@pytest.mark.parametrize("disagreement", ["", "tails", "outlier"])
@pytest.mark.parametrize("n_weeks", [3, 4, 6, 12])
def test_interval_of_slope_is_calibrated_and_useful(n_weeks: int, disagreement: str) -> None:
    """Intervals contain the slope although the scatter differs from the prior, has heavy tails, or one outlier."""
    rng, weeks, n = np.random.default_rng(3), np.arange(float(n_weeks)), 500
    n_held, width_db = 0, np.empty(n)
    for k in range(n):
        std = rng.uniform(0.3, 1.0, n_weeks)
        scatter = np.exp(rng.normal(0.0, 0.6))  # median 1 dB
        off_db = rng.standard_t(3, n_weeks) if disagreement == "tails" else rng.standard_normal(n_weeks)
        off_db = scatter * off_db + std * rng.standard_normal(n_weeks)
        if disagreement == "outlier":
            off_db[rng.integers(n_weeks)] += rng.choice([-1.0, 1.0]) * rng.uniform(2.0, 5.0)
        line = fit_line(weeks, 0.7 * weeks + off_db, std, LEVEL_SCATTER_DB)
        assert line is not None
        n_held += line.per_week.lower <= 0.7 <= line.per_week.upper
        width_db[k] = line.per_week.upper - line.per_week.lower
    assert n_held / n >= (0.975 if not disagreement else 0.95)
    if not disagreement:
        assert 0.5 * np.median(width_db) < {3: 3.2, 4: 2.0, 6: 1.0, 12: 0.4}[n_weeks]  # three dates: 7 to 24 by t


@pytest.mark.whole
@pytest.mark.parametrize(("growth_db", "n_weeks"), [(1.2, 6), (-1.2, 6), (1.1, 12), (0.0, 12)])
def test_constant_is_stated_only_if_relevant_growth_is_excluded(growth_db: float, n_weeks: int) -> None:
    rng, weeks, n_constant = np.random.default_rng(4), np.arange(float(n_weeks)), 0
    for _ in range(300):
        std = rng.uniform(0.3, 1.0, n_weeks)
        value_db = growth_db * weeks + std * rng.standard_normal(n_weeks) + rng.standard_t(4, n_weeks)
        line = fit_line(weeks, value_db, std, LEVEL_SCATTER_DB)
        assert line is not None
        n_constant += judge(line, RELEVANT_DB_PER_WEEK) == "constant"
    assert n_constant >= 270 if growth_db == 0.0 else n_constant <= 3


def test_too_little_data_state_the_growth_that_is_possible() -> None:
    place = at_place(*(both(day, -10.0, seed=k) for k, day in enumerate(DAYS[:3])))
    assert place.verdict == "not known"
    assert place.level is not None
    low, high = place.level.per_week.lower, place.level.per_week.upper
    assert describe_change(place) == f"not known: growth between {low:+.1f} and {high:+.1f} dB a week is possible"
    assert low < -RELEVANT_DB_PER_WEEK or high > RELEVANT_DB_PER_WEEK


def test_line_is_exact_for_exact_values_and_needs_three_dates() -> None:
    weeks = np.arange(6.0)
    line = fit_line(weeks, 2.0 + 3.0 * weeks, np.full(6, 0.5), 0.8)
    assert line is not None
    assert (line.per_week.value, line.at_start) == pytest.approx((3.0, 2.0))
    assert line.per_week.lower < 3.0 < line.per_week.upper
    assert line.scatter < 0.5
    assert fit_line(np.array([0.0, 0.0, 1.0]), np.zeros(3), np.ones(3), 0.8) is None


def test_less_certain_inspection_has_less_weight() -> None:
    value = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 9.0])
    lines = [fit_line(np.arange(6.0), value, np.array([0.5] * 5 + [last]), 0.8) for last in (0.5, 9.0)]
    certain, uncertain = (line.per_week.value for line in lines if line is not None)
    assert uncertain < 0.1 < 1.0 < certain


def test_inspections_are_sorted_and_unusable_folders_one_line_each(tmp_path: Path) -> None:
    def saved(name: str, log: MissionLog) -> Path:
        (tmp_path / name).mkdir()
        log.save(tmp_path / name)
        return tmp_path / name

    late, early = saved("late", survey(PAST, day=DAYS[1])), saved("early", survey(PAST))
    assert [each.day for each in read_inspections([late, early])] == list(DAYS[:2])

    of_yard, damaged = survey(PAST), survey(PAST, SurveyedSource(PLACE))
    of_yard.meta["scenario"] = {"yard": {"size_m": [40.0, 30.0]}}
    damaged.meta["array"] = {"boresights_rad": "none"}
    broken = saved("broken", survey(PAST))
    (broken / "log.npz").write_bytes(b"none")
    unusable = {
        saved("undated", survey(PAST, day=None)): "must have a date",
        late: "must be given once",
        saved("other", of_yard): "must be of the yard of",
        saved("incomplete", survey(PAST[:0])): "the mission is incomplete",
        broken: "is not the log of a mission",
        saved("no_array", damaged): "is not the log of a mission (its metadata are damaged)",
        tmp_path / "none": "log.npz",
    }
    with pytest.raises(InputFileError) as caught:
        read_inspections([late, *unusable])
    assert len(caught.value.faults) == len(unusable)
    for line, (folder, message) in zip(caught.value.faults, unusable.items(), strict=True):
        assert line.startswith(str(folder))
        assert message in line
