"""Paths on the site map and following them."""

import numpy as np
import pytest

from pdpatrol.envs import load_scenario
from pdpatrol.missions.driving.path_follower import (
    BRAKING_MPS2,
    TURN_SPEED_MPS,
    PathFollower,
    speed_profile,
)
from pdpatrol.missions.driving.site_map import CELL_M, MARGIN_M, SiteMap

MAP = SiteMap(load_scenario("one_source"))


def test_paths_keep_clear_of_equipment() -> None:
    reach = MAP.reach(np.array([3.0, 3.0]))
    rng = np.random.default_rng(0)
    for cell in rng.choice(np.flatnonzero(MAP.is_free), 60):
        path = reach.path(cell)
        np.testing.assert_array_equal(path[-1], MAP.centres_m[cell])
        between = np.linspace(path[:-1], path[1:], 5).reshape(-1, 2)
        assert MAP.yard.clearance(between).min() >= MAP.robot.footprint_radius_m + 0.5 * MARGIN_M


def test_moves_do_not_leave_the_grid() -> None:
    """A move from one edge of the grid to the opposite one would be as long as the yard."""
    reach = MAP.reach(np.array([3.0, 3.0]))
    assert np.isfinite(reach.length_m).any()
    assert np.linalg.norm(MAP.centres_m - MAP.centres_m[reach.before], axis=-1).max() < 2.3 * CELL_M


def test_paths_avoid_obstacles_until_they_are_removed() -> None:
    start, goal = np.array([3.0, 3.0]), np.array([9.0, 3.0])
    wall_m = np.stack([np.full(30, 6.0), np.linspace(0.0, 5.0, 30)], axis=-1)
    seen = MAP.with_obstacles(wall_m)
    path = seen.reach(start).path(seen.cell(goal))
    assert np.linalg.norm(path[:, np.newaxis] - wall_m, axis=-1).min() >= MAP.robot.footprint_radius_m + MARGIN_M
    assert path[:, 1].max() > 5.0
    again = seen.with_obstacles(wall_m[:0])
    np.testing.assert_array_equal(again.clearance_m, MAP.clearance_m)
    np.testing.assert_array_equal(again.reach(start).length_m, MAP.reach(start).length_m)


def test_drive_replans_on_changed_map_and_keeps_deadline() -> None:
    pose = np.array([3.0, 3.0, 0.0])
    leg = PathFollower(MAP.reach(pose), np.array([9.0, 3.0]), 0.0, 0.4)
    before, deadline_s = leg.path_m, leg.deadline_s
    leg.update_map(MAP, pose)
    assert leg.path_m is before
    leg.update_map(MAP.with_obstacles(np.array([[6.0, 3.0]])), pose)
    assert np.abs(leg.path_m[:, 1] - 3.0).max() > np.abs(before[:, 1] - 3.0).max()
    assert leg.deadline_s == deadline_s


def test_obstructed_goal_is_approached_until_the_deadline() -> None:
    pose, goal = np.array([3.0, 3.0, 0.0]), np.array([9.0, 3.0])
    around = goal + 0.4 * np.stack([np.cos(np.arange(0, 6.3, 0.3)), np.sin(np.arange(0, 6.3, 0.3))], axis=-1)
    leg = PathFollower(MAP.with_obstacles(around).reach(pose), goal, 0.0, 0.3)
    assert not leg.is_reachable
    assert not leg.is_over(pose, 1.0)
    assert leg.is_over(pose, leg.deadline_s + 0.1)
    assert np.linalg.norm(leg.path_m[-1] - goal) < 1.1


@pytest.mark.parametrize(("corner_deg", "speed_mps"), [(0.0, 0.8), (45.0, 0.5), (90.0, TURN_SPEED_MPS)])
def test_speed_profile_brakes_before_turns_and_end(corner_deg: float, speed_mps: float) -> None:
    along_m = np.arange(0.0, 5.0, 0.25)[:, np.newaxis]
    out = np.array([np.cos(np.radians(corner_deg)), np.sin(np.radians(corner_deg))])
    path = np.concatenate([along_m * [1.0, 0.0], [5.0, 0.0] + along_m * out])
    speed = speed_profile(path, MAP.robot, MAP.speed_limit(path))
    assert speed.max() == pytest.approx(MAP.robot.max_speed_mps)
    assert speed[-1] == 0.0
    assert speed[along_m.size] == pytest.approx(speed_mps)
    fall = -np.diff(np.square(speed)) / np.linalg.norm(np.diff(path, axis=0), axis=-1)
    assert fall.max() <= 2.0 * BRAKING_MPS2 + 1e-9


def test_speed_profile_ignores_grid_steps() -> None:
    steps = np.cumsum([[0.25, 0.0], [0.25, 0.25]] * 20, axis=0)
    assert speed_profile(steps, MAP.robot, MAP.speed_limit(steps))[3:20].min() > 0.7 * MAP.robot.max_speed_mps
