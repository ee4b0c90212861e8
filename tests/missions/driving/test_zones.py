"""Zones with a speed limit: the robot obeys them, and pictures and recording show them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dirmusic.arrays import FloatArray
from pdpatrol.envs import Scenario, ScenarioError, load_scenario
from pdpatrol.missions.driving.path_follower import PathFollower, speed_profile
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.runner import run_mission
from pdpatrol.robot_models.yard.polygon import Polygon
from tests.missions.driving.crossings import crossing_scenario
from tests.missions.replay.read_back import recorded

TOLERANCE_MPS = 0.06
"""Overshoot of the speed controller."""

WALKWAY: dict[str, Any] = {"name": "walkway", "polygon_m": ((9.0, 1.0), (14.0, 1.0), (13.0, 5.0)), "limit_mps": 0.3}
CORNER: dict[str, Any] = {
    "name": "gravel",  # concave, across the second and the third leg
    "polygon_m": ((17.0, 7.0), (22.0, 7.0), (22.0, 15.0), (10.0, 15.0), (10.0, 10.0), (17.0, 10.0)),
    "limit_mps": 0.15,
}


def with_zones(*zones: dict[str, Any], **tables: Any) -> Scenario:  # noqa: ANN401 - tables of many types
    return Scenario.model_validate(crossing_scenario(0, 0).model_dump() | {"zones": zones} | tables)


def speeds(place_m: FloatArray) -> FloatArray:
    return np.linalg.norm(np.diff(place_m, axis=0), axis=-1) / 0.1


@pytest.mark.whole
def test_robot_obeys_the_limits_and_is_not_slower_elsewhere() -> None:
    scenario = with_zones(WALKWAY, CORNER)
    log = run_mission(scenario, "patrol", 1)
    assert make_report(log, 0.0).waypoints.missed == ()
    place_m = log.column("step", "true_pose")[:, :2]
    speed_mps = speeds(place_m)
    away_m = np.full(len(speed_mps), np.inf)
    for zone in scenario.zones:
        to_zone_m = -zone.polygon.signed_distance(place_m[1:])
        away_m = np.minimum(away_m, to_zone_m)
        inside_mps = speed_mps[to_zone_m < 0.0]
        assert inside_mps.size > 20
        assert inside_mps.max() <= zone.limit_mps + TOLERANCE_MPS
        assert np.median(inside_mps) > 0.8 * zone.limit_mps
    free_mps = speed_mps[away_m > 2.0]
    assert np.quantile(free_mps, 0.9) > 0.95 * scenario.robot.description.max_speed_mps


def test_path_follower_brakes_before_a_zone() -> None:
    """The speed is the limit within the zone, and lets the robot brake with 0.5 m/s^2 before it."""
    site_map = SiteMap(with_zones(WALKWAY))
    path_m = np.column_stack([np.arange(3.0, 20.0, 0.25), np.full(68, 3.0)])
    speed_mps = speed_profile(path_m, site_map.robot, site_map.speed_limit(path_m))
    zone = site_map.zones[0].polygon
    assert speed_mps[zone.is_inside(path_m)] == pytest.approx(0.3)
    entry_m = path_m[zone.is_inside(path_m)][0, 0]
    before = path_m[:, 0] < entry_m
    assert (speed_mps[before] <= np.sqrt(0.3**2 + 2.0 * 0.5 * (entry_m - path_m[before, 0])) + 1e-9).all()
    assert speed_mps[0] == site_map.robot.max_speed_mps


def test_deadline_allows_for_slow_zones() -> None:
    """Driving at the allowed speeds takes at most half of the time until the goal is given up."""
    pose, goal_m = np.array([3.0, 3.0, 0.0]), np.array([20.0, 3.0])
    free, slow = (
        PathFollower(SiteMap(with_zones(*zones)).reach(pose), goal_m, 0.0, 0.4).deadline_s
        for zones in ((), (WALKWAY | {"limit_mps": 0.05},))
    )
    crossing_s = 4.0 / 0.05
    assert slow > free + 2.0 * 0.8 * crossing_s


@pytest.mark.parametrize("corners_m", [WALKWAY["polygon_m"], CORNER["polygon_m"], CORNER["polygon_m"][::-1]])
def test_distance_to_a_polygon_is_that_of_its_sampled_boundary(corners_m: tuple[tuple[float, float], ...]) -> None:
    polygon, rng = Polygon(corners_m), np.random.default_rng(0)
    ends = np.roll(corners_m, -1, axis=0)
    boundary_m = np.concatenate([np.linspace(a, b, 2001) for a, b in zip(np.array(corners_m), ends, strict=True)])
    points_m = rng.uniform(0.0, 24.0, (200, 2))
    nearest_m = np.linalg.norm(points_m[:, np.newaxis] - boundary_m, axis=-1).min(axis=-1)
    signed_m = polygon.signed_distance(points_m)
    np.testing.assert_allclose(np.abs(signed_m), nearest_m, atol=0.01)
    turns = boundary_m - points_m[:, np.newaxis]  # the winding number, an independent definition of inside
    angle = np.unwrap(np.arctan2(turns[..., 1], turns[..., 0]), axis=-1)
    is_inside = np.abs(angle[:, -1] - angle[:, 0]) > np.pi
    np.testing.assert_array_equal(signed_m > 0.0, is_inside)


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"polygon_m": ((1.0, 1.0), (2.0, 2.0))}, 'zones "walkway".polygon_m: must have at least 3 items'),
        (
            {"polygon_m": ((1.0, 1.0), (5.0, 5.0), (5.0, 1.0), (1.0, 5.0))},
            'zones "walkway".polygon_m: sides must not touch or',
        ),
        (
            {"polygon_m": ((1.0, 1.0), (5.0, 1.0), (2.0, 1.0))},
            'zones "walkway".polygon_m: sides must not touch or cross',
        ),
        (
            {"polygon_m": ((1.0, 1.0), (1.0, 1.0), (5.0, 5.0))},
            'zones "walkway".polygon_m: sides must be 0.1 m or longer',
        ),
        ({"limit_mps": 0.0}, 'zones "walkway".limit_mps: must be greater than or equal to 0.05'),
    ],
)
def test_error_in_a_zone_is_one_line(change: dict[str, Any], line: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load_scenario("one_source", {"zones": [WALKWAY | change]})
    assert line in str(caught.value)
    assert str(caught.value).count("zones ") == 1


def test_recording_shows_zones(tmp_path: Path) -> None:
    log = run_mission(with_zones(WALKWAY, task={"time_limit_s": 1.0}), "patrol", 0)
    drawn = recorded(log, tmp_path)["world/yard/zones"]
    (ring_m,) = drawn["strips"][None]
    np.testing.assert_allclose(np.array(ring_m)[:, :2], [*WALKWAY["polygon_m"], WALKWAY["polygon_m"][0]], atol=1e-6)
