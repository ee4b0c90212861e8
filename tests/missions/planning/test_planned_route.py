"""Missions with `waypoints_m = "planned"`."""

import numpy as np
import pytest

from pdpatrol.envs import load_scenario
from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.envs.scenario import ScenarioError
from pdpatrol.missions.planning.plan import with_planned_route
from pdpatrol.missions.runner import Mission
from tests.envs.helpers import to_be_planned
from tests.missions.planning.one_plan import YARDS, plan_of, scenario_of

PLANNED = {"route.waypoints_m": "planned"}


def test_mission_drives_planned_stops() -> None:
    mission = Mission(load_scenario("one_source", PLANNED), "patrol", 0)
    stops = [tuple(stop) for stop in plan_of("one_source").stops_m.tolist()]
    assert list(mission.site_map.route.stops_m) == stops
    assert [tuple(stop) for stop in mission.log.meta["route"]["waypoints_m"]] == stops


def test_random_yard_can_have_a_planned_route() -> None:
    assert len(with_planned_route(to_be_planned(scenario_of("5009"))).route.stops_m) == len(plan_of("5009").stops_m)


def test_environment_refuses_unplanned_route() -> None:
    with pytest.raises(
        ValueError, match=r'^route.waypoints_m: must be points, got "planned"[^\n]*pdpatrol plan[^\n]*$'
    ):
        PatrolEnv(load_scenario("one_source", PLANNED))


def test_planned_route_needs_a_detectable_site() -> None:
    noisy = load_scenario("one_source", {**PLANNED, "receiver.noise_v": 0.5})
    with pytest.raises(ScenarioError, match="no site is detectable"):
        Mission(noisy, "patrol", 0)


def test_invalid_waypoints_are_refused() -> None:
    with pytest.raises(ScenarioError) as raised:
        load_scenario("one_source", {"route.waypoints_m": "by luck"})
    (line,) = raised.value.faults
    assert "route.waypoints_m: must be 'planned', got 'by luck'" in line


@pytest.mark.whole
def test_patrol_dwells_at_each_waypoint() -> None:
    quiet = {"sources": (), "route.waypoints_m": ((8.0, 3.0), (8.0, 8.0))}
    times_s = [
        Mission(load_scenario("one_source", quiet | {"route.dwell_s": dwell_s}), "patrol", 0) for dwell_s in (0.0, 15.0)
    ]
    usual, longer = (mission.run() for mission in times_s)
    assert np.ptp(longer.column("step", "time_s")) - np.ptp(usual.column("step", "time_s")) == pytest.approx(
        30.0, abs=3.0
    )
    is_still = longer.column("step", "phase") == "listen"
    assert is_still.sum() == pytest.approx(300, abs=4)
    assert not longer.column("step", "command")[is_still].any()


@pytest.mark.slow
@pytest.mark.parametrize("name", YARDS)
def test_patrol_takes_the_planned_time(name: str) -> None:
    plan = plan_of(name)
    route = plan.scenario.route.model_copy(update={"waypoints_m": "planned"})
    mission = Mission(plan.scenario.model_copy(update={"route": route}), "patrol", 0)
    log = mission.run()
    assert mission.n_visited == len(plan.stops_m)
    assert log.column("event", "subject")[-1] == "docked"
    assert mission.time_s == pytest.approx(plan.driving_s, rel=0.15)
