"""Paths keep clear of equipment, and following them keeps to them."""

import numpy as np
import pytest

from envs import load_scenario
from missions.navigation import MARGIN_M, SiteMap, steer
from missions.policies import Leg
from robot_models.inspector import CHASSIS_RADIUS_M, MAX_SPEED_MPS

MAP = SiteMap(load_scenario("one_source"))


def test_paths_go_round_equipment_with_room_for_the_robot() -> None:
    reach = MAP.reach(np.array([3.0, 3.0]))
    rng = np.random.default_rng(0)
    for cell in rng.choice(np.flatnonzero(MAP.is_free), 60):
        path = reach.path(cell)
        np.testing.assert_array_equal(path[-1], MAP.centres_m[cell])
        between = np.linspace(path[:-1], path[1:], 5).reshape(-1, 2)
        assert MAP.yard.clearance(between).min() >= CHASSIS_RADIUS_M + 0.5 * MARGIN_M


def test_no_way_is_shorter_than_the_straight_line() -> None:
    start = MAP.centres_m[MAP.cell((3.0, 3.0))]
    reach = MAP.reach(start)
    free = MAP.is_free & np.isfinite(reach.length_m)
    assert (reach.length_m[free] >= np.linalg.norm(MAP.centres_m[free] - start, axis=-1) - 1e-9).all()


def test_equipment_hides_what_is_behind_it_and_not_what_stands_on_it() -> None:
    tank = next(item for item in MAP.yard.equipment if item.name == "transformer_1")
    south, north = np.array([12.0, 13.0]), np.array([[12.0, 21.0]])
    assert not MAP.yard.in_sight(north, south)[0]
    surface = np.array([12.0, tank.position_m[1] - 1.4])  # an estimate a little inside its surface
    assert MAP.yard.in_sight(south[np.newaxis], surface, ignore_m=0.5)[0]
    assert not MAP.yard.in_sight(north, surface, ignore_m=0.5)[0]


def test_a_robot_that_steers_along_a_path_arrives_and_strays_little() -> None:
    pose = np.array([3.0, 3.0, 2.0])
    leg = Leg(MAP, pose, np.array([36.0, 21.0]), 0.0)
    worst, step_s = 0.0, 0.1
    for _ in range(1500):
        v, yaw_rate = steer(pose, leg.path_m)
        assert abs(v) <= MAX_SPEED_MPS
        pose = pose + step_s * np.array([v * np.cos(pose[2]), v * np.sin(pose[2]), yaw_rate])
        worst = max(worst, np.linalg.norm(leg.path_m - pose[:2], axis=-1).min())
        if leg.has_arrived(pose, 0.3):
            break
    assert leg.has_arrived(pose, 0.3)
    assert worst < 0.3


def test_a_goal_walled_in_is_given_up_at_once() -> None:
    scenario = load_scenario("quiet_yard")
    wall = {"kind": "wall", "shape": "box", "height_m": 2.0}
    walls = [
        {"name": f"wall_{side}", "position_m": position, "footprint_m": footprint, **wall}
        for side, position, footprint in (
            ("s", (28.0, 4.0), (4.4, 0.4)), ("n", (28.0, 8.0), (4.4, 0.4)),
            ("w", (26.0, 6.0), (0.4, 4.4)), ("e", (30.0, 6.0), (0.4, 4.4)),
        )
    ]  # fmt: skip
    data = scenario.model_dump()
    data["yard"]["equipment"] = (*data["yard"]["equipment"], *walls)
    walled = SiteMap(type(scenario).model_validate(data))
    pose = np.array([3.0, 3.0, 0.0])
    leg = Leg(walled, pose, np.array([28.0, 6.0]), 0.0)
    assert not leg.is_reachable
    assert leg.is_over(pose, 0.0, 0.4)


def test_a_leg_that_takes_too_long_is_over() -> None:
    pose = np.array([3.0, 3.0, 0.0])
    leg = Leg(MAP, pose, np.array([13.0, 6.0]), 5.0)
    assert not leg.is_over(pose, 6.0, 0.4)
    assert leg.is_over(pose, 5.0 + 200.0, 0.4)
    assert leg.deadline_s == pytest.approx(5.0 + 30.0 + leg_length(leg) / 0.4, rel=0.2)


def leg_length(leg: Leg) -> float:
    return float(np.linalg.norm(np.diff(leg.path_m, axis=0), axis=-1).sum())
