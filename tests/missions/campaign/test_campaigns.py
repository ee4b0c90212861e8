"""Campaigns of simulated missions with all errors of the shipped scenarios."""

from typing import Any

import numpy as np
import pytest

from pdpatrol.envs import load_scenario
from pdpatrol.missions.campaign.records import Trend
from pdpatrol.missions.campaign.trend import make_trend
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.runner import run_mission
from tests.missions.campaign.surveys import DAYS, inspections

pytestmark = pytest.mark.slow


def campaign(number: int, *changes: dict[str, Any]) -> Trend:
    """Run one mission a week in `two_sources` with the given changes to its sources; seeds and arrays differ."""
    logs = list[MissionLog]()
    for week, changed in enumerate(changes):
        sources = [source.model_dump(exclude_unset=True) for source in load_scenario("two_sources").sources]
        settings = {
            "sources": tuple({**source, **changed.get(source["name"], {})} for source in sources),
            "campaign.number": number,
            "campaign.begins": DAYS[0],
            "campaign.date": DAYS[week],
        }
        logs.append(run_mission(load_scenario("two_sources", settings), "seek", 1000 * number + week))
    return make_trend(inspections(logs))


@pytest.mark.parametrize(("number", "growing"), [(1, "discharge_east"), (2, "discharge_west")])
def test_six_weeks_separate_growth_of_3_db_a_week_from_none(number: int, growing: str) -> None:
    trend = campaign(number, *([{growing: {"growth_db_per_week": 3.0}}] * 6))
    grown, constant = trend.discharges
    assert (grown.verdict, constant.verdict) == ("grown", "constant")
    assert grown.level is not None
    assert constant.level is not None
    assert grown.level.per_week.lower < 3.0 < grown.level.per_week.upper
    assert constant.level.per_week.lower < 0.0 < constant.level.per_week.upper
    assert constant.level.per_week.upper < grown.level.per_week.lower
    assert (grown.position_m[0] > 22.0) == (growing == "discharge_east")


def test_ended_discharge_is_gone_and_started_one_is_new() -> None:
    silent = {"active_s": (0.0, 0.1)}
    trend = campaign(301, {"discharge_east": silent}, {}, {"discharge_west": silent})
    status = {each.position_m[0] > 22.0: each.status for each in trend.discharges}
    assert status == {True: "new", False: "gone"}
    for each in trend.discharges:
        levels = [seen.level_db.value for seen in each.observations if seen.level_db]
        assert len(levels) == 2
        assert np.ptp(levels) < 3.0
