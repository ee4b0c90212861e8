"""Driving among obstacles: safe speed, unmapped obstacles, backing off, and complete courses."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pytest

from dirmusic import Finding
from pdpatrol.envs import Scenario
from pdpatrol.envs.patrol_env import STEP_S, Observation, PatrolEnv
from pdpatrol.envs.random_yard import random_yard
from pdpatrol.envs.scenario.robot import RobotConfig
from pdpatrol.envs.scenario.scenario import RouteConfig, TaskConfig
from pdpatrol.missions.driving.lidar_stop import STOP_M, free_distance, safe_speed
from pdpatrol.missions.driving.moving_obstacles import MovingObstacles, Scan
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.policies.collision_guard import BACK_OFF_S, SEEN_S, TOUCHED_S, CollisionGuard, SeenObstacles
from pdpatrol.missions.policies.make_policy import Random
from pdpatrol.missions.policies.patrol import Patrol
from pdpatrol.missions.policies.protocol import Action, ReportingPolicy
from pdpatrol.missions.record.events import Phase
from pdpatrol.robot_models.description.robot_file import load_robot
from pdpatrol.robot_models.sensors import LIDAR_BEAMS

ROBOT = load_robot("inspector")
BEAMS_RAD = 2.0 * np.pi * np.arange(LIDAR_BEAMS) / LIDAR_BEAMS
NOTHING = np.full(LIDAR_BEAMS, 12.0)


def route(*waypoints_m: tuple[float, float]) -> RouteConfig:
    return RouteConfig(dock_m=(2.0, 5.0), dock_yaw_deg=0.0, waypoints_m=waypoints_m)


OPEN_YARD = Scenario.model_validate(
    {"name": "open_yard", "yard": {"size_m": (14.0, 10.0)}, "route": route((12.0, 5.0)), "array": {}}
)


class Driven(NamedTuple):
    """Result of a drive; numbers of waypoints count from 1."""

    time_s: float
    touched: set[str]
    visited: tuple[int, ...]
    unreachable: tuple[int, ...]
    is_docked: bool
    phases: set[str]
    path_m: np.ndarray


def drive(scenario: Scenario, site_map: SiteMap, seed: int = 0, policy: ReportingPolicy | None = None) -> Driven:
    """Drive, without locating, until the policy is done, the robot has docked or the time is over."""
    env, policy = PatrolEnv(scenario, terminate_on_approach=False, full_info=True), policy or CollisionGuard(Patrol())
    observation, info = env.reset(seed=seed)
    touched, phases, path, terminated, truncated = set[str](), set[str](), [info["true_pose"]], False, False
    while not (terminated or truncated) and (action := policy(observation, [], site_map)) is not None:
        observation, _, terminated, truncated, info = env.step(action)
        touched.update(info["touched_names"])
        phases.add(policy.phase.name)
        path.append(info["true_pose"])
    visited = tuple((np.flatnonzero(info["waypoints_visited"]) + 1).tolist())
    return Driven(info["time_s"], touched, visited, policy.unreachable, terminated, phases, np.array(path)[:, :2])


def with_equipment(scenario: Scenario, *pieces: dict[str, Any]) -> Scenario:
    data = scenario.model_dump()
    named = [{"name": f"piece_{k}", "kind": "cabinet", "height_m": 1.5, **piece} for k, piece in enumerate(pieces)]
    data["yard"]["equipment"] = (*data["yard"]["equipment"], *named)
    return Scenario.model_validate(data)


def wall_at(x_m: float) -> np.ndarray:
    """Return the lidar ranges to a wall across the path ahead."""
    with np.errstate(divide="ignore"):
        return np.where(np.cos(BEAMS_RAD) > 1e-9, np.minimum(x_m / np.cos(BEAMS_RAD), 12.0), 12.0)


def test_free_distance_ends_at_walls() -> None:
    for x_m in (0.3, 0.4, 0.55):
        ahead_m = free_distance(wall_at(x_m), 0.8, 0.0, ROBOT)
        assert ahead_m == pytest.approx(x_m - ROBOT.footprint_radius_m - 0.04, abs=0.03)
        assert free_distance(np.roll(wall_at(x_m), LIDAR_BEAMS // 2), -0.8, 0.0, ROBOT) == ahead_m  # behind
    for v in (0.8, -0.8):
        assert free_distance(NOTHING, v, 0.3, ROBOT) == pytest.approx(0.6)
    on_the_left = np.roll(wall_at(0.3), LIDAR_BEAMS // 4)
    straight_m, right_m, left_m = (free_distance(on_the_left, 0.5, yaw_rate, ROBOT) for yaw_rate in (0.0, -1.0, 1.0))
    assert straight_m == right_m == pytest.approx(0.6)
    assert left_m < 0.4


@pytest.mark.parametrize("x_m", [0.27, 0.3, 0.4, 0.5, 3.0])
def test_safe_speed_allows_stopping_in_time(x_m: float) -> None:
    v = safe_speed(wall_at(x_m), ROBOT.max_speed_mps, 0.0, ROBOT)
    stops_in_m = v * STEP_S + v**2 / (2 * ROBOT.max_acceleration_mps2)
    assert stops_in_m <= x_m - ROBOT.footprint_radius_m - STOP_M
    assert v == ROBOT.max_speed_mps or stops_in_m > x_m - ROBOT.footprint_radius_m - STOP_M - 0.07


@pytest.mark.parametrize("seed", range(2))
def test_guard_prevents_contacts_of_random_driving(seed: int) -> None:
    things = [
        {"shape": "box", "position_m": (4.0, 2.0), "footprint_m": (0.6, 1.2), "yaw_deg": 30.0},
        {"shape": "box", "position_m": (5.0, 7.5), "footprint_m": (2.0, 0.3)},
        {"shape": "cylinder", "position_m": (3.5, 5.0), "radius_m": 0.3},
        {"shape": "cylinder", "position_m": (1.0, 3.5), "radius_m": 0.05},
    ]
    yard, task = OPEN_YARD.yard.model_copy(update={"size_m": (7.0, 9.0)}), TaskConfig(time_limit_s=120.0)
    small = OPEN_YARD.model_copy(update={"yard": yard, "route": route((6.0, 5.0)), "task": task})
    scenario = with_equipment(small, *things)
    driven = drive(scenario, SiteMap(scenario), seed, CollisionGuard(Random(np.random.default_rng(seed))))
    unguarded = drive(scenario, SiteMap(scenario), seed, Random(np.random.default_rng(seed)))
    assert driven.touched == set()
    assert unguarded.touched
    assert np.ptp(driven.path_m, axis=0).max() > 2.0


BOX = {"shape": "box", "position_m": (7.0, 5.0), "footprint_m": (1.0, 1.0)}
UNMAPPED: dict[str, list[dict[str, Any]]] = {
    "box": [BOX],
    "wall": [{**BOX, "footprint_m": (0.4, 4.0), "yaw_deg": 10.0}],
    "pole": [{"shape": "cylinder", "position_m": (7.0, 5.0), "radius_m": 0.05}],
    "pocket": [
        {**BOX, "position_m": (9.0, 5.0), "footprint_m": (0.3, 3.3)},
        {**BOX, "position_m": (7.6, 6.5), "footprint_m": (2.8, 0.3)},
        {**BOX, "position_m": (7.6, 3.5), "footprint_m": (2.8, 0.3)},
    ],
}


@pytest.mark.parametrize("name", UNMAPPED)
def test_unmapped_obstacle_is_driven_around(name: str) -> None:
    driven = drive(with_equipment(OPEN_YARD, *UNMAPPED[name]), SiteMap(OPEN_YARD))
    assert (driven.touched, driven.visited, driven.is_docked) == (set(), (1,), True)
    assert driven.time_s < 60.0 * len(UNMAPPED[name])


def test_robot_backs_off_from_obstacle_below_lidar() -> None:
    sill = {**BOX, "footprint_m": (0.3, 0.8), "height_m": 0.1}  # below the beams
    driven = drive(with_equipment(OPEN_YARD, sill), SiteMap(OPEN_YARD))
    assert "equipment/piece_0" in driven.touched
    assert "back off" in driven.phases
    assert (driven.visited, driven.is_docked) == ((1,), True)


def test_blocked_waypoint_is_given_up() -> None:
    planned = OPEN_YARD.model_copy(update={"route": route((9.0, 5.0), (5.0, 8.0))})
    box = {**BOX, "position_m": (9.0, 5.0), "footprint_m": (2.0, 2.0)}
    data = with_equipment(OPEN_YARD, box).model_copy(update={"route": planned.route})  # not a valid scenario
    driven = drive(data, SiteMap(planned))
    assert (driven.touched, driven.visited, driven.unreachable) == (set(), (2,), (1,))
    assert driven.time_s < 150.0


def complete(seed: int, robot: str = "inspector") -> None:
    scenario = random_yard(seed, seed % 8).model_copy(update={"robot": RobotConfig(model=robot)})
    site_map = SiteMap(scenario)
    driven = drive(scenario, site_map, seed)
    assert driven.touched == set()
    assert sorted([*driven.visited, *driven.unreachable]) == [1, 2, 3, 4]
    reach = site_map.reach(np.array(scenario.route.dock_m))
    cells = [site_map.cell(stop) for stop in scenario.route.waypoints_m]
    assert len(driven.unreachable) == np.isinf(reach.length_m[cells]).sum()
    assert driven.is_docked or driven.unreachable


@pytest.mark.parametrize(("seed", "robot"), [(15, "inspector"), (23, "crawler")])
def test_obstacle_course_is_completed_without_contact(seed: int, robot: str) -> None:
    complete(seed, robot)


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["inspector", "crawler"])
@pytest.mark.parametrize("first", range(0, 50, 10))
def test_fifty_obstacle_courses_are_completed(first: int, robot: str) -> None:
    for seed in range(first, first + 10):
        complete(seed, robot)


class Ahead:
    """Policy that drives straight ahead at full speed."""

    phase, unreachable = Phase("ahead"), ()

    def __init__(self) -> None:
        self.obstacles_m = np.empty((0, 2))

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action:
        self.obstacles_m = site_map.obstacles_m
        return np.array([1.0, 0.0], dtype=np.float32)


@pytest.mark.parametrize(
    ("left_mps", "yaw_radps", "is_bump"),
    [
        (0.05, 0.0, True),
        (0.4, 0.0, True),
        (0.55, 0.0, False),
        (0.75, 0.8, True),
        (0.75, -0.8, True),
        (0.75, 0.2, False),
    ],
)
def test_collision_is_mapped_and_backed_off_from(left_mps: float, yaw_radps: float, is_bump: bool) -> None:
    """An overhang is above the lidar's plane, and meets the mast or the hull, which it stops or turns."""
    env, inner = PatrolEnv(OPEN_YARD, terminate_on_approach=False), Ahead()
    observation, site_map = env.reset(seed=0)[0], SiteMap(OPEN_YARD)
    guard = CollisionGuard(inner)

    def at(speed_mps: float, time_s: float = 0.0, yaw_radps: float = 0.0) -> Observation:
        values = {"velocity": [speed_mps, yaw_radps], "time": [time_s], "lidar": NOTHING}
        moving = {name: np.array(value, dtype=np.float32) for name, value in values.items()}
        return {**observation, **moving}  # pyright: ignore[reportReturnType]

    guard(at(0.8), [], site_map)
    guard(at(left_mps, yaw_radps=yaw_radps), [], site_map)
    assert (guard.phase.name == "back off") == is_bump
    guard(at(0.0, BACK_OFF_S + 0.1), [], site_map)
    ahead_m = inner.obstacles_m - observation["pose"][:2]
    assert bool(len(ahead_m)) == is_bump
    assert np.all((ahead_m[:, 0] > 0.0) & (np.abs(ahead_m[:, 1]) < 0.2))
    assert not is_bump or ahead_m[:, 0].max() > ROBOT.footprint_radius_m - 0.1


def test_touched_places_are_kept_although_someone_passes() -> None:
    """Beams meet a standing obstacle again when someone has left, but never one above their plane."""
    seen, moving, plan = SeenObstacles(), MovingObstacles(), SiteMap(OPEN_YARD)
    seen.add(np.array([[5.0, 5.0]]), 0.0, TOUCHED_S)
    seen.add(np.array([[5.2, 5.0]]), 0.0, SEEN_S)
    moving.points_m = np.array([[5.1, 5.0]])
    seen.scan(Scan(1.0, np.array([2.0, 5.0, 0.0]), NOTHING), plan, moving)
    np.testing.assert_allclose(seen.on(plan).obstacles_m, [[5.0, 5.0]])
