"""Plans shared by several tests, made once per process."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from pdpatrol.envs import Scenario, load_scenario
from pdpatrol.envs.random_yard import random_yard
from pdpatrol.missions.planning.plan import Plan, make_plan

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
    box = {"kind": "wall", "shape": "box", "height_m": 5.0}
    pieces = [
        {**box, "name": "south", "position_m": (35.0, 2.0), "footprint_m": (5.0, 0.4)},
        {**box, "name": "north", "position_m": (35.0, 7.0), "footprint_m": (5.0, 0.4)},
        {**box, "name": "west", "position_m": (32.6, 4.5), "footprint_m": (0.4, 5.4)},
        {**box, "name": "east", "position_m": (37.4, 4.5), "footprint_m": (0.4, 5.4)},
        {**box, "name": "hidden", "position_m": (35.0, 4.5), "footprint_m": (0.8, 0.6), "kind": "cabinet",
         "height_m": 1.0, "sites": {"door": (0.0, 0.3, 0.5)}},
    ]  # fmt: skip
    return load_scenario("one_source", {"map.extra": pieces, "route.waypoints_m": ()})
