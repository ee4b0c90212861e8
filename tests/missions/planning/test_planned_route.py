"""Missions with `waypoints_m = "planned"`."""

from pathlib import Path

import pytest

from pdpatrol.envs import Scenario, load_scenario
from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.envs.random_yard import random_yard
from pdpatrol.envs.scenario import SHIPPED, ScenarioError
from pdpatrol.missions.planning.plan import with_planned_route
from pdpatrol.missions.runner import Mission
from tests.missions.planning.one_plan import YARDS, plan_of, scenario_of


def to_be_planned(scenario: Scenario) -> Scenario:
    return scenario.model_copy(update={"route": scenario.route.model_copy(update={"waypoints_m": "planned"})})


@pytest.fixture
def one_source(tmp_path: Path) -> Path:
    """Write the scenario with `waypoints_m = "planned"`."""
    lines = (SHIPPED / "one_source.toml").read_text(encoding="utf-8").splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("waypoints_m"))
    last = next(k for k in range(first, len(lines)) if lines[k].rstrip().endswith("]]") or lines[k] == "]")
    text = "\n".join([*lines[:first], 'waypoints_m = "planned"', *lines[last + 1 :]])
    (tmp_path / "one_source.toml").write_text(text, encoding="utf-8")
    return tmp_path / "one_source.toml"


def test_mission_drives_planned_stops(one_source: Path) -> None:
    scenario = load_scenario(one_source)
    assert scenario.route.waypoints_m == "planned"
    mission = Mission(scenario, "patrol", 0)
    stops = [tuple(stop) for stop in plan_of("one_source").stops_m.tolist()]
    assert list(mission.site_map.route.stops_m) == stops
    assert [tuple(stop) for stop in mission.log.meta["route"]["waypoints_m"]] == stops
    for _ in range(3):
        mission.step()
    assert mission.log.n_rows("step") == 3


def test_random_yard_can_have_a_planned_route() -> None:
    yard, planned = scenario_of("5009"), random_yard(5009, 5009 % 13, has_planned_route=True)
    assert planned == to_be_planned(yard)
    assert len(with_planned_route(planned).route.stops_m) == len(plan_of("5009").stops_m)


def test_environment_refuses_unplanned_route() -> None:
    with pytest.raises(
        ValueError, match=r'^route.waypoints_m: must be points, got "planned"[^\n]*pdpatrol plan[^\n]*$'
    ):
        PatrolEnv(to_be_planned(load_scenario("one_source")))


def test_planned_route_needs_a_detectable_site() -> None:
    noisy = load_scenario("one_source", {"receiver.noise_v": 0.5})
    with pytest.raises(ScenarioError, match="no site is detectable"):
        Mission(to_be_planned(noisy), "patrol", 0)


@pytest.mark.parametrize(
    ("waypoints", "fault"),
    [
        ('"by luck"', "route.waypoints_m: must be 'planned', got 'by luck'"),
        ("[[1.0]]", "route.waypoints_m.0.1"),
    ],
)
def test_invalid_waypoints_are_refused(one_source: Path, waypoints: str, fault: str) -> None:
    text = one_source.read_text(encoding="utf-8").replace('"planned"', waypoints)
    one_source.write_text(text, encoding="utf-8")
    with pytest.raises(ScenarioError) as raised:
        load_scenario(one_source)
    assert [line.startswith(f"{one_source}: {fault}") for line in raised.value.faults] == [True]


@pytest.mark.slow
@pytest.mark.parametrize("name", YARDS)
def test_patrol_takes_the_planned_time(name: str) -> None:
    plan = plan_of(name)
    mission = Mission(to_be_planned(plan.scenario), "patrol", 0)
    log = mission.run()
    assert mission.n_visited == len(plan.stops_m)
    assert log.column("event", "subject")[-1] == "docked"
    assert mission.time_s == pytest.approx(plan.driving_s, rel=0.15)
