"""`waypoints_m = "planned"`: the route of a plan in the place of that word.

The environment cannot plan, for the map is a part of missions; so whoever starts a mission puts the route in.
"""

from __future__ import annotations

from functools import lru_cache

from pdpatrol.envs.scenario import Scenario, ScenarioError, restore_scenario
from pdpatrol.envs.scenario.scenario import PLANNED

Point = tuple[float, float]


def with_planned_route(scenario: Scenario) -> Scenario:
    """The scenario with its route planned, if that is to be planned; else as it is.

    Raises:
        ScenarioError: If no site is heard from any place that the robot can reach.
    """
    if scenario.route.waypoints_m != PLANNED:
        return scenario
    waypoints_m = _planned(scenario.model_dump_json())
    if not waypoints_m:
        raise ScenarioError(
            [f'{scenario.name}: route.waypoints_m: got "{PLANNED}", and no site is heard from where the robot can get '
             "to; allowed are points"]
        )  # fmt: skip
    return scenario.model_copy(update={"route": scenario.route.model_copy(update={"waypoints_m": waypoints_m})})


@lru_cache(maxsize=16)
def _planned(scenario: str) -> tuple[Point, ...]:
    """The waypoints of a scenario, which is given as JSON: missions that differ in their seed share a plan."""
    import json

    from pdpatrol.missions.planning.plan import make_plan

    plan = make_plan(restore_scenario(json.loads(scenario)))
    return tuple((float(x), float(y)) for x, y in plan.stops_m)
