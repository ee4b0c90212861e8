"""Missions of several charges: the robot returns in time, charges, and goes on where it stopped."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pytest

from dirmusic import Finding
from pdpatrol.envs import Scenario
from pdpatrol.envs.patrol_env import Observation, PatrolEnv
from pdpatrol.envs.random_yard import random_yard
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.policies.collision_guard import CollisionGuard
from pdpatrol.missions.policies.make_policy import OwnPolicy
from pdpatrol.missions.policies.patrol import Patrol
from pdpatrol.missions.policies.recharging import Recharging
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.page import report_page
from pdpatrol.missions.report.wording import battery_text
from pdpatrol.missions.runner import run_mission

ABOVE = {"idle_w": 1.2 * 80.0, "drive_j_per_m": 1.2 * 20.0}
"""True loads that are 20 % above those that the robot believes."""

FAR_ABOVE = {"idle_w": 1.6 * 80.0, "drive_j_per_m": 1.6 * 20.0}
"""True loads so far above that the margin alone does not cover them: the robot has to measure its consumption."""

OPEN_YARD: dict[str, Any] = {
    "name": "open_yard",
    "yard": {"size_m": (24.0, 16.0)},
    "array": {},
    "route": {"dock_m": (3.0, 3.0), "waypoints_m": ((20.0, 4.0), (20.0, 12.0), (4.0, 12.0)) * 3},
    "battery": {"capacity_wh": 3.0},
    "task": {"time_limit_s": 1000.0},
}


class Ahead:
    """Policy that drives to the east, and notes where it is after it has resumed."""

    def __init__(self) -> None:
        self.n_resumed, self.farthest_m = 0, 0.0
        self.resumed_at_m = np.zeros(2)
        self._is_resumed = False

    def resume(self) -> None:
        self._is_resumed = True

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> list[float]:
        place_m = observation["pose"][:2]
        self.farthest_m = max(self.farthest_m, float(place_m[0]))
        if self._is_resumed:
            self.n_resumed += 1
            self.resumed_at_m = place_m.copy()
        return [0.7, 0.0]


class Driven(NamedTuple):
    """Course of a patrol without locating."""

    arrivals: list[float]
    has_visited_all: bool
    unreachable: tuple[int, ...]
    is_docked: bool
    battery: float


def rounds(seed: int, nature: dict[str, float], battery: dict[str, float]) -> Scenario:
    """Return a drawn yard without sources, in which the robot drives its route four times."""
    data = random_yard(seed, seed % 8).model_dump()
    route = {**data["route"], "waypoints_m": 4 * data["route"]["waypoints_m"]}
    changes = {"route": route, "sources": (), "interferers": (), "task": {"time_limit_s": 6000.0}}
    nature_of = {**data["nature"], "battery": nature}
    return Scenario.model_validate({**data, **changes, "battery": battery, "nature": nature_of})


def drive(scenario: Scenario, seed: int) -> Driven:
    """Drive until the policy is done, the battery is empty or the time is over."""
    env, site_map = PatrolEnv(scenario, terminate_on_approach=False), SiteMap(scenario)
    policy, arrivals, is_over = Recharging(CollisionGuard(Patrol()), scenario.battery), list[float](), False
    observation, info = env.reset(seed=seed)
    while not is_over:
        before = policy.stage
        action = policy(observation, [], site_map)
        if action is None:
            break
        if policy.stage != before and policy.stage == "charging":
            arrivals.append(info["battery"])
        observation, _, _, truncated, info = env.step(action)
        is_over = truncated or info["battery"] == 0.0
    visited, from_dock_m = info["waypoints_visited"], np.hypot(*(info["true_pose"][:2] - scenario.route.dock_m))
    return Driven(arrivals, visited.all(), policy.unreachable, not is_over and from_dock_m < 0.6, info["battery"])


@pytest.mark.whole
@pytest.mark.parametrize(
    ("seed", "nature", "battery"),
    [
        (3, {}, {"capacity_wh": 4.5}),
        (4, {}, {"capacity_wh": 4.5, "charge_w": 20.0}),
        (5, ABOVE, {"capacity_wh": 4.5}),
        (6, FAR_ABOVE, {"capacity_wh": 6.5}),
        (7, {"capacity_wh": 3.9}, {"capacity_wh": 4.5}),
    ],
)
def test_robot_comes_home_with_its_reserve(seed: int, nature: dict[str, float], battery: dict[str, float]) -> None:
    """Also if it uses more than stated; waiting for a slow charger makes it give up nothing."""
    driven = drive(rounds(seed, nature, battery), seed)
    assert len(driven.arrivals) >= 3
    assert min(driven.arrivals) >= 0.2
    assert max(driven.arrivals) < 0.35
    assert driven.has_visited_all
    assert driven.unreachable == ()
    assert driven.is_docked
    assert driven.battery >= 0.2


@pytest.fixture(scope="module")
def mission() -> MissionLog:
    return run_mission(Scenario.model_validate(OPEN_YARD), "patrol", seed=1)


@pytest.mark.whole
def test_log_and_report_state_the_charges(mission: MissionLog) -> None:
    report, step, events = make_report(mission, 0.0), mission.table("step"), mission.table("event")
    stages = [kind for kind in events["kind"].tolist() if kind in ("returns to charge", "charging", "continues")]
    assert report.ending == "docked"
    assert report.waypoints.missed == ()
    assert len(report.charges) >= 2
    assert stages == ["returns to charge", "charging", "continues"] * len(report.charges)
    last_s = 0.0
    for charge in report.charges:
        assert charge.arrived_s is not None
        assert charge.continued_s is not None
        assert charge.battery_left is not None
        assert last_s < charge.returned_s < charge.arrived_s < charge.continued_s
        last_s = charge.continued_s
        is_charging = (step["time_s"] > charge.arrived_s) & (step["time_s"] < charge.continued_s)
        assert set(step["phase"][is_charging]) == {"charge"}
        assert np.ptp(step["true_pose"][is_charging, :2], axis=0).max() < 0.05
        assert charge.battery_left >= 0.2
    text = battery_text(report)
    assert text is not None
    assert text.count(" left") == 1 + len(report.charges)
    assert text in report_page(mission, report)


@pytest.mark.whole
def test_mission_may_end_while_charging(mission: MissionLog) -> None:
    first = make_report(mission, 0.0).charges[0]
    assert first.arrived_s is not None
    task = {"time_limit_s": first.arrived_s + 5.0}
    cut = make_report(run_mission(Scenario.model_validate({**OPEN_YARD, "task": task}), "patrol", seed=1), 0.0)
    assert cut.ending == "time limit"
    assert cut.charges == (first.model_copy(update={"continued_s": None}),)


@pytest.mark.whole
def test_seek_confirms_a_candidate_over_several_charges() -> None:
    source = {"name": "pd", "position_m": (12.0, 8.0, 1.5), "pulse_rate_hz": 1.0}
    log = run_mission(Scenario.model_validate({**OPEN_YARD, "sources": (source,)}), "seek", seed=2)
    report = make_report(log, 0.0)
    assert report.scores.sources[0].found
    assert report.charges
    assert report.ending == "docked"
    assert min(charge.battery_left or 0.0 for charge in report.charges) >= 0.2


def test_policy_is_called_at_the_dock_after_resume() -> None:
    """The robot is charged at the dock, and `resume` is called before the policy goes on."""
    scenario = Scenario.model_validate({**OPEN_YARD, "battery": {"capacity_wh": 1.0}})
    env, site_map, policy = PatrolEnv(scenario), SiteMap(scenario), Ahead()
    recharging = Recharging(OwnPolicy(lambda _: policy, np.random.default_rng(0)), scenario.battery)
    observation, _ = env.reset(seed=0, options={"start_pose": (3.0, 3.0, 0.0)})
    while policy.n_resumed == 0 and (action := recharging(observation, [], site_map)) is not None:
        observation, _, terminated, truncated, _ = env.step(action)
        assert not terminated
        assert not truncated
    assert policy.farthest_m > 6.0
    assert np.hypot(*(policy.resumed_at_m - scenario.route.dock_m)) < 0.6
    assert recharging.stage == "continues"


@pytest.mark.whole
def test_mission_ends_when_the_battery_is_empty() -> None:
    """The robot believes that a charge lasts for long, but the true battery does not even last for the drive home."""
    empty = {**OPEN_YARD, "nature": {"battery": {"capacity_wh": 0.3}}}
    report = make_report(run_mission(Scenario.model_validate(empty), "patrol", seed=1), 0.0)
    assert report.ending == "battery empty"
    assert report.battery_left == 0.0


def test_stop_out_of_reach_of_a_charge_is_given_up() -> None:
    route = {"dock_m": (3.0, 3.0), "waypoints_m": ((6.0, 3.0), (37.0, 3.0), (3.0, 6.0))}
    changes = {"yard": {"size_m": (40.0, 9.0)}, "route": route, "battery": {"capacity_wh": 2.0}}
    driven = drive(Scenario.model_validate({**OPEN_YARD, **changes}), seed=1)
    assert driven.unreachable == (2,)
    assert 2 <= len(driven.arrivals) <= 3
    assert min(driven.arrivals) >= 0.2
    assert driven.is_docked
