"""Plans shared by several tests, made once per process."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from pdpatrol.envs import Scenario, load_scenario
from pdpatrol.envs.random_yard import random_yard
from pdpatrol.missions.planning.plan import Plan, make_plan
from pdpatrol.robot_models.yard.pieces import BoxEquipment
from pdpatrol.robot_models.yard.yard import Yard

FloatArray = NDArray[np.float64]

YARDS = ("one_source", "5004", "5009")
"""A shipped scenario, and seeds of random yards with twelve and four pieces."""


def scenario_of(name: str) -> Scenario:
    return random_yard(int(name), int(name) % 13) if name.isdigit() else load_scenario(name)


@cache
def plan_of(name: str) -> Plan:
    return make_plan(scenario_of(name))


def walled_in() -> Scenario:
    """Return the yard of `one_source` with one more cabinet, inside walls that the robot cannot enter."""
    scenario = load_scenario("one_source")
    wall = {"kind": "wall", "shape": "box", "height_m": 5.0}
    sides = (
        ("south", (35.0, 2.0), (5.0, 0.4)), ("north", (35.0, 7.0), (5.0, 0.4)),
        ("west", (32.6, 4.5), (0.4, 5.4)), ("east", (37.4, 4.5), (0.4, 5.4)),
    )  # fmt: skip
    walls = [
        BoxEquipment.model_validate({"name": f"wall_{name}", "position_m": at, "footprint_m": size, **wall})
        for name, at, size in sides
    ]
    hidden = BoxEquipment(
        name="hidden",
        kind="cabinet",
        shape="box",
        position_m=(35.0, 4.5),
        footprint_m=(0.8, 0.6),
        height_m=1.0,
        sites={"door": (0.0, 0.3, 0.5)},
    )
    yard = Yard(size_m=scenario.yard.size_m, equipment=(*scenario.yard.equipment, *walls, hidden))
    route = scenario.route.model_copy(update={"waypoints_m": ()})
    return scenario.model_copy(update={"yard": yard, "route": route})
