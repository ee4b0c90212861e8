"""People and vehicles on the route: the robot gives way, goes on, and its map and localisation stay right."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dirmusic.angles import unit_vector
from pdpatrol.envs import Scenario
from pdpatrol.missions.driving.lidar_stop import BEAM_RAD
from pdpatrol.missions.driving.moving_obstacles import MovingObstacles, Scan
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.policies.collision_guard import SEEN_S, TOUCHED_S, SeenObstacles
from pdpatrol.missions.policies.patrol import Patrol
from pdpatrol.missions.policies.recharging import Recharging
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.runner import Mission, run_mission
from tests.missions.driving.crossings import crossing_scenario
from tests.missions.replay.read_back import recorded


def run(scenario: Scenario, seed: int) -> MissionLog:
    return run_mission(scenario, "patrol", seed)


def with_moving(**table: Any) -> Scenario:  # noqa: ANN401 - values of many types
    """Return the yard of the crossings with one person or vehicle, as a table of the scenario."""
    plain = crossing_scenario(0, 0).model_dump()
    return Scenario.model_validate(plain | {"nature": {"moving": ({"name": "body", **table},)}})


def check_crossing(seed: int) -> float:
    """Run a mission with three people on the route, check it, and return the smallest distance."""
    log = run(crossing_scenario(seed), seed)
    report = make_report(log, 0.0)
    assert report.ending == "docked", seed
    assert report.waypoints.missed == (), seed
    assert report.collisions == 0, seed
    assert "frame" not in log.column("event", "kind"), seed
    assert (log.column("frame", "offset") == 0.0).all(), seed
    return min(body.closest_m or 0.0 for body in report.scores.moving)


@pytest.mark.whole
@pytest.mark.parametrize("seed", [36, 12])
def test_robot_gives_way_to_people(seed: int) -> None:
    check_crossing(seed)


@pytest.mark.slow
def test_twenty_missions_have_no_contact() -> None:
    """Without giving way, several of these missions have contacts."""
    closest_m = [check_crossing(seed) for seed in range(20)]
    assert min(closest_m) > 0.05
    assert np.median(closest_m) < 2.0  # the people do cross the route


@pytest.mark.whole
def test_robot_drives_round_a_parked_vehicle() -> None:
    log = run(with_moving(kind="vehicle", path_m=((12.0, 4.0), (12.0, 6.0)), speed_mps=2.0, pause_s=(900.0, 900.0)), 0)
    report = make_report(log, 0.0)
    assert (report.ending, report.waypoints.missed, report.collisions) == ("docked", (), 0)
    assert report.sim_time_s < 110.0


@pytest.mark.whole
def test_robot_gives_up_a_waypoint_under_a_vehicle() -> None:
    log = run(with_moving(kind="vehicle", path_m=((20.0, 3.0), (18.0, 3.0)), speed_mps=2.0, pause_s=(900.0, 900.0)), 0)
    report = make_report(log, 0.0)
    assert (report.waypoints.missed, report.waypoints.unreachable, report.collisions) == ((1,), (1,), 0)
    assert report.sim_time_s < 150.0


@pytest.mark.whole
def test_robot_steps_aside_for_a_person_on_its_line() -> None:
    """The person walks against the robot on its own line, and would run into it."""
    report = make_report(run(with_moving(kind="person", path_m=((20.0, 3.0), (5.0, 3.0)), speed_mps=1.2), 0), 0.0)
    (encounter,) = report.scores.moving
    assert (report.ending, encounter.contacts) == ("docked", 0)
    assert encounter.closest_m is not None
    assert 0.1 < encounter.closest_m < 1.5


def test_moving_points_do_not_become_obstacles_of_the_map() -> None:
    """A person walks across in front of a standing robot; the map shows it only once it stands."""
    plan, moving, seen = SiteMap(crossing_scenario(0, 0)), MovingObstacles(), SeenObstacles()
    pose = np.array([10.0, 8.0, 0.0])
    for time_s in np.arange(0.0, 6.0, 0.2).tolist():
        y_m = min(time_s - 2.0, 0.5)
        off_m = 2.0 * unit_vector(BEAM_RAD) - (2.0, y_m)  # each beam ends at the person or far away
        hits = np.linalg.norm(off_m, axis=-1) < 0.25
        scan = Scan(time_s, pose, np.where(hits, 2.0, 12.0))
        moving.scan(scan, plan)
        seen.scan(scan, plan, moving)
        assert (seen.on(plan) is plan) or time_s > 3.0
    assert seen.on(plan).obstacles_m.size > 0


@pytest.mark.parametrize(("path_m", "who"), [(((8.0, 3.0), (1.0, 3.0)), "person"), (((8.0, 3.0), (8.0, 8.0)), "robot")])
def test_contacts_state_who_ran_into_whom(path_m: tuple[tuple[float, float], ...], who: str) -> None:
    """A person walks into a robot that stands at its dock, or a robot without collision guard drives into a person."""
    pause_s = (0.0, 0.0) if who == "person" else (900.0, 900.0)
    scenario = with_moving(kind="person", path_m=path_m, speed_mps=1.0, pause_s=pause_s).model_dump()
    route = {"dock_m": (3.0, 3.0), "dock_yaw_deg": 0.0, "waypoints_m": () if who == "person" else ((20.0, 3.0),)}
    changes = {"route": route, "task": {"time_limit_s": 9.0}}
    changed = Scenario.model_validate(scenario | changes)
    mission = Mission(changed, "patrol", 0)
    mission.policy = Recharging(Patrol(), changed.battery)
    log = mission.run()
    events = log.table("event")
    assert set(events["subject"][events["kind"] == "contact"].tolist()) == {"moving/body"}
    (encounter,) = make_report(log, 0.0).scores.moving
    assert encounter.closest_m is not None
    assert encounter.closest_m < 0.05
    assert encounter.contacts >= 1
    assert (encounter.ran_into_robot > 0) == (who == "person")


def test_recording_shows_the_bodies_on_their_tracks(tmp_path: Path) -> None:
    plain = with_moving(kind="person", path_m=((8.0, 3.0), (8.0, 9.0)), speed_mps=1.0).model_dump()
    scenario = Scenario.model_validate(plain | {"task": {"time_limit_s": 3.0}})
    drawn = recorded(run(scenario, 0), tmp_path)["world/truth/moving/body"]["translation"]
    for step, (place_m,) in drawn.items():
        assert step is not None
        np.testing.assert_allclose(place_m, [8.0, 3.0 + 0.1 * (step + 1), 0.0], atol=1e-5)
    assert len(drawn) == 30


def test_place_that_was_touched_is_remembered_longer_than_one_that_was_seen() -> None:
    """No beam meets the piece that the robot touched, so only its memory keeps it from touching it again."""
    plan, seen = SiteMap(crossing_scenario(0, 0)), SeenObstacles()
    seen.add(np.array([[10.0, 8.0]]), 0.0, TOUCHED_S)
    seen.add(np.array([[10.0, 8.0], [12.0, 8.0]]), 5.0, SEEN_S)
    assert len(seen.on(plan).obstacles_m) == 2
    seen.add(np.empty((0, 2)), 100.0, SEEN_S)
    np.testing.assert_allclose(seen.on(plan).obstacles_m, [[10.0, 8.0]])
    seen.add(np.empty((0, 2)), TOUCHED_S, SEEN_S)
    assert seen.on(plan) is plan
