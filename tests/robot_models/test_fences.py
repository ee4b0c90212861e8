"""Polygonal fences: the yard, the lidar, contacts, the map, registration, and a mission inside."""

from typing import Any

import numpy as np
import pytest

from dirmusic.arrays import FloatArray
from pdpatrol.envs import Scenario, ScenarioError
from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.envs.scenario.loader import restore_scenario
from pdpatrol.missions.driving.registration import Outlines
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.runner import run_mission
from pdpatrol.robot_models.world import FENCE_HEIGHT_M
from pdpatrol.robot_models.yard.yard import Yard
from tests.envs.helpers import STAND, drive

L_SHAPE = ((0.0, 0.0), (20.0, 0.0), (20.0, 8.0), (9.0, 8.0), (9.0, 16.0), (0.0, 14.0))
"""A yard with a corner that points inwards and two sides that are not along an axis."""

CABINET: dict[str, Any] = {"name": "box", "kind": "cabinet", "shape": "box", "footprint_m": (1.0, 1.0), "height_m": 2.0}


def scenario(fence_m: tuple[tuple[float, float], ...] = L_SHAPE, **tables: Any) -> Scenario:  # noqa: ANN401
    plain: dict[str, Any] = {
        "name": "fenced",
        "yard": {"fence_m": fence_m},
        "route": {"dock_m": (3.0, 3.0), "dock_yaw_deg": 0.0, "waypoints_m": ((17.0, 4.0), (4.0, 12.0))},
        "array": {},
        "lidar": {"range_std_m": 0.0},
        "task": {"time_limit_s": 200.0},
    }
    return Scenario.model_validate(plain | tables)


def ray_to_fence(place_m: FloatArray, yaw_rad: float) -> float:
    """Return the distance from a place to the fence along a direction, by the intersection of lines."""
    ahead, ranges_m = np.array([np.cos(yaw_rad), np.sin(yaw_rad)]), [np.inf]
    for start_m, end_m in zip(np.array(L_SHAPE), np.roll(L_SHAPE, -1, axis=0), strict=True):
        matrix = np.column_stack([ahead, start_m - end_m])
        if abs(np.linalg.det(matrix)) > 1e-9:
            along_m, share = np.linalg.solve(matrix, start_m - place_m)
            if along_m > 0.0 and 0.0 <= share <= 1.0:
                ranges_m.append(float(along_m))
    return min(ranges_m)


def test_rectangle_is_the_polygon_of_four_corners() -> None:
    box = ((0.0, 0.0), (20.0, 0.0), (20.0, 12.0), (0.0, 12.0))
    rectangle, polygon = Yard(size_m=(20.0, 12.0)), Yard.model_validate({"fence_m": box})
    points_m = np.random.default_rng(0).uniform(-2.0, 22.0, (500, 2))
    assert polygon.size_m == (20.0, 12.0)
    np.testing.assert_array_equal(rectangle.clearance(points_m), polygon.clearance(points_m))
    inside = ((points_m >= 0.0) & (points_m <= rectangle.size_m)).all(axis=-1)
    np.testing.assert_array_equal(rectangle.contains(points_m), inside)
    nearest_m = np.minimum(points_m, np.array(rectangle.size_m) - points_m).min(axis=-1)
    np.testing.assert_array_equal(rectangle.clearance(points_m)[inside], nearest_m[inside])


@pytest.mark.parametrize("fence_m", [L_SHAPE, L_SHAPE[::-1]])
def test_lidar_meets_the_fence_and_nothing_else(fence_m: tuple[tuple[float, float], ...]) -> None:
    env = PatrolEnv(scenario(fence_m), full_info=True)
    for place in ((3.0, 3.0, 0.2), (15.0, 5.0, 1.0), (4.0, 12.0, -2.0)):
        _, info = env.reset(seed=0, options={"start_pose": place})
        lidar_m = env.step(STAND)[0]["lidar"]
        x, y, yaw = info["true_pose"]
        for beam, range_m in enumerate(lidar_m.tolist()):
            expected_m = ray_to_fence(np.array([x, y]), yaw + 2.0 * np.pi * beam / lidar_m.size)
            assert range_m == pytest.approx(min(expected_m, 12.0), abs=0.01)


def test_contact_names_the_side_of_the_fence() -> None:
    """The robot drives north into the side from (9, 16) to (0, 14), the fifth."""
    env = PatrolEnv(scenario(), full_info=True, terminate_on_approach=False)
    env.reset(seed=0, options={"start_pose": (5.0, 12.0, np.pi / 2)})
    touched = {name for _ in range(60) for name in env.step(drive(0.8, 0.0))[-1]["touched_names"]}
    assert touched == {"fence/5"}


def test_map_is_free_inside_only_and_paths_go_round_the_corner() -> None:
    site_map = SiteMap(scenario())
    free_m = site_map.centres_m[site_map.is_free]
    x, y = free_m.T
    assert ((y < 8.0) | (x < 9.0)).all()
    assert (y < 14.0 + x * 2.0 / 9.0).all()
    assert len(free_m) * 0.0625 > 0.8 * (20.0 * 8.0 + 9.0 * 7.0)
    paths = site_map.reach(np.array([17.0, 5.0]))
    path_m = paths.path(paths.nearest(np.array([5.0, 13.0])))
    assert site_map.yard.contains(path_m).all()
    assert (np.hypot(*(path_m - (9.0, 8.0)).T) < 2.0).any()


def test_outlines_are_those_of_the_fence() -> None:
    """Points on the fence are at distance zero of its outline, with a normal that points inwards."""
    yard = Yard.model_validate({"fence_m": L_SHAPE})
    outlines = Outlines(yard, 0.5 * FENCE_HEIGHT_M)
    ends = zip(np.array(L_SHAPE), np.roll(L_SHAPE, -1, axis=0), strict=True)
    points_m = np.concatenate([np.linspace(a, b, 12)[1:-1] for a, b in ends])
    distance_m, normal, _ = outlines.meet(points_m)
    np.testing.assert_allclose(distance_m, 0.0, atol=1e-9)
    assert yard.contains(points_m + 0.1 * normal).all()
    assert not yard.contains(points_m - 0.1 * normal).any()


def test_outlines_do_not_lie_beyond_a_notch() -> None:
    """The nearest outline of a place 4 m from a notch 2 m wide is not on the other side of the notch."""
    notch_m = ((0.0, 0.0), (20.0, 0.0), (20.0, 10.0), (11.0, 10.0), (11.0, 4.0), (9.0, 4.0), (9.0, 10.0), (0.0, 10.0))
    outlines = Outlines(Yard.model_validate({"fence_m": notch_m}), 0.5 * FENCE_HEIGHT_M)
    distance_m, _, _ = outlines.meet(np.array([[15.0, 7.0]]))
    assert distance_m[0] == pytest.approx(3.0)


@pytest.mark.whole
def test_mission_within_a_polygon_reaches_all_waypoints() -> None:
    log = run_mission(scenario(lidar={}), "patrol", 2)
    report = make_report(log, 0.0)
    assert (report.ending, report.waypoints.missed, report.collisions) == ("docked", (), 0)
    assert (log.column("frame", "offset") == 0.0).all()


@pytest.mark.parametrize(
    ("yard", "line"),
    [
        ({"fence_m": ((0.0, 0.0), (9.0, 0.0))}, "yard.fence_m: must have at least 3 items"),
        ({"fence_m": ((0.0, 0.0), (9.0, 9.0), (9.0, 0.0), (0.0, 9.0))}, "yard.fence_m: sides must not touch or cross"),
        ({"fence_m": ((1.0, 0.0), (9.0, 0.0), (9.0, 9.0))}, "yard.fence_m: the lowest x and y must be 0, got 1 and 0"),
        ({"fence_m": L_SHAPE, "size_m": (20.0, 20.0)}, "yard.size_m: must be (20.0, 16.0), the extent of fence_m"),
        ({"fence_m": L_SHAPE, "equipment": [CABINET | {"position_m": (15.0, 12.0)}]}, "beyond the fence"),
        (
            {"fence_m": L_SHAPE, "equipment": [CABINET | {"position_m": (9.0, 7.8)}]},
            "extends 0.30 m beyond the fence",
        ),
        (  # all corners are inside, but the corner of the fence is in the piece
            {"fence_m": L_SHAPE, "equipment": [CABINET | {"position_m": (8.7, 7.7), "yaw_deg": 45.0}]},
            "extends 0.08 m beyond the fence",
        ),
        ({"fence_m": ((0.0, 0.0), (900.0, 0.0), (9.0, 9.0))}, "yard.fence_m.1.0: must be less than or equal to 400"),
        ({"fence_m": "round"}, "yard.fence_m: must be an array"),
        ({}, "yard.size_m: is required"),
    ],
)
def test_error_in_a_fence_is_one_line(yard: dict[str, Any], line: str) -> None:
    plain = scenario().model_dump(exclude={"yard"}) | {"yard": yard}
    with pytest.raises(ScenarioError) as caught:
        restore_scenario(plain)
    assert line in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_route_must_lie_within_the_polygon() -> None:
    with pytest.raises(ValueError, match=r"route\.waypoints_m\.0: must lie in the yard.*from fence/3"):
        scenario(route={"dock_m": (3.0, 3.0), "waypoints_m": ((15.0, 9.0),)})
