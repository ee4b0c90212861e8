"""The mission loop: runs environment, policy and Locator, and logs what happens."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from dirmusic import ArrayModel, Locator
from dirmusic.arrays import FloatArray
from dirmusic.locating.protocol import LocatorProtocol, MakesLocator
from pdpatrol.envs import Scenario
from pdpatrol.envs.observation import Observation
from pdpatrol.envs.patrol_env import STEP_S, PatrolEnv
from pdpatrol.envs.user_code import UserCodeError, calling, load_object, place_of
from pdpatrol.missions.driving.registration import Registration
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.planning.plan import with_planned_route
from pdpatrol.missions.policies.make_policy import Oracle, OwnPolicy, make_policy
from pdpatrol.missions.policies.recharging import Recharging
from pdpatrol.missions.record.events import ChargingStage, EventKind
from pdpatrol.missions.record.log_contents import describe_array
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.tracking import Tracker
from pdpatrol.robot_models.sensors import describe_lidar
from pdpatrol.robot_models.world import describe_equipment, describe_solids

LOCATOR = "a Locator: MyLocator(array, pose_error, fence_m=, rules=, sight=) with update, refit and association"

PART_S = 30.0
"""Simulated time between parts of the log on disk: the most that a killed mission loses."""


class Stopwatch:
    """Stopwatch of the wall time by activity, from its construction on.

    Attributes:
        spent_s: Seconds by activity, in the order in which each first ended.
    """

    def __init__(self) -> None:
        self._started_s = time.perf_counter()
        self.spent_s = defaultdict[str, float](float)

    @property
    def total_s(self) -> float:
        """Seconds since construction."""
        return time.perf_counter() - self._started_s

    @contextmanager
    def on(self, activity: str) -> Iterator[None]:
        """Add the time within the block to an activity."""
        began_s = time.perf_counter()
        yield
        self.spent_s[activity] += time.perf_counter() - began_s


class Mission:
    """One mission, which runs one control step at a time.

    Args:
        scenario: Scenario to run.
        policy: Name of the policy, see `make_policy`.
        seed: Seed of all random draws: the same seed gives the same mission, bit for bit.
        folder: Folder for parts of the growing log; None keeps the log in memory.
        stopwatch: Measures policy, environment and locating; by default a new one.

    Attributes:
        env: The environment.
        site_map: The map that the policy gets.
        registration: Estimator of the frame of the localisation, by which poses are corrected.
        policy: The policy, which is interrupted to charge the battery.
        log: The log so far.
        n_visited: Number of waypoints visited so far.
        stopwatch: Wall time of policy, environment and locating.
        is_over: True when the mission has ended.
        error: Error in user code that ended the mission.

    Raises:
        UserCodeError: If user code cannot be loaded or made.
        ScenarioError: If the route must be planned and no site is detectable.
    """

    @threadpool_limits.wrap(limits=1)
    def __init__(
        self,
        scenario: Scenario,
        policy: str,
        seed: int,
        folder: Path | None = None,
        stopwatch: Stopwatch | None = None,
    ) -> None:
        scenario = with_planned_route(scenario)
        self.env = PatrolEnv(scenario, terminate_on_approach=False, full_info=True)
        self.site_map = SiteMap(scenario)
        self.registration = Registration(scenario, self.site_map.yard)
        self.folder = folder
        self.stopwatch = stopwatch or Stopwatch()
        self.is_over = False
        self.error: UserCodeError | None = None
        self.n_visited = 0
        simulation = self.env.simulation
        locator = make_locator(scenario, self.site_map, simulation.array)
        observation, info = self.env.reset(seed=seed)
        driver = make_policy(policy, simulation.generators[0].policy)
        self.policy = Recharging(driver, scenario.battery)
        self._stage: ChargingStage = self.policy.stage
        self._has_charged_here = False
        self._happened: list[tuple[EventKind, str, int, str]] = []
        self.log = MissionLog(self._meta(scenario, policy, seed, info))
        self._tracker = Tracker(
            self.log,
            locator,
            simulation.array,
            scenario.pose_sensor.pose_error,
            scenario.locating.rules().max_std_rad,
        )
        if isinstance(driver, Oracle | OwnPolicy):
            driver.reveal(info["truth"])
        self._observation, _, _ = self._localise(observation, info)

    @property
    def time_s(self) -> float:
        """Simulated time, seconds."""
        return STEP_S * self.log.n_rows("step")

    def _meta(self, scenario: Scenario, policy: str, seed: int, info: dict[str, Any]) -> dict[str, Any]:
        array, known_yard = self.env.simulation.array, self.site_map.yard
        solids = describe_solids(self.env.simulation.robots.model)
        if wrong := [item for item in known_yard.equipment if item not in scenario.yard.equipment]:
            solids["map"] = describe_equipment(wrong)  # shown by the map only
        return {
            "versions": {name: version(name) for name in ("pdpatrol", "mujoco-core", "numpy", "scipy")},
            "name": scenario.name,
            "seed": seed,
            "policy": policy,
            "date": scenario.campaign.day,
            "scenario": scenario.model_dump(mode="json"),
            "n_elements": array.manifold.n_elements,
            "array": describe_array(array),
            "bounds_m": [[0.0, 0.0], list(scenario.yard.size_m)],
            "route": scenario.route.model_dump(mode="json"),
            "sites": {name: known_yard.site_position(name).tolist() for name in known_yard.site_names()},
            "solids": solids,
            "lidar": describe_lidar(self.site_map.robot),
            "truth": info["truth"],
        }

    @threadpool_limits.wrap(limits=1)
    def run(self, after_step: Callable[[Mission], None] | None = None) -> MissionLog:
        """Run the mission to its end; `after_step` is called after each control step and may end it.

        An error in user code ends the mission with events of kind `error` and `end`. Linear algebra runs in one thread:
        the matrices are small, and the result must not depend on the number of cores.
        """
        while not self.is_over:
            try:
                self.step()
            except UserCodeError as error:
                self._fail(error)
                self.end("error")
            if after_step is not None:
                after_step(self)
        return self.log

    def _localise(self, observation: Observation, info: dict[str, Any]) -> tuple[Observation, FloatArray, bool]:
        """Return observation and pose (3,) on the map, and whether the frame of the localisation was estimated anew.

        No other code corrects poses.
        """
        localised = info["believed_pose"]
        is_new = self.registration.update(info["time_s"], localised, observation["lidar"])
        return *self.registration.corrected(observation, localised), is_new

    def step(self) -> None:
        """Run one control step: decide, drive, detect, locate, and log all of it."""
        on = self.stopwatch.on
        with on("policy"):
            action = self.policy(self._observation, self._tracker.findings, self.site_map)
        if action is None:
            self.end("policy done")
            return
        with on("environment"):
            observation, _, terminated, truncated, info = self.env.step(action)
        with on("registration"):
            self._observation, pose, is_new_frame = self._localise(observation, info)
        self.log.append(
            "step",
            time_s=info["time_s"],
            pose=pose,
            true_pose=info["true_pose"],
            odometry=info["odometry"],
            battery=info["battery"],
            command=self.site_map.robot.command_from_action(action),
            phase=self.policy.phase.name,
            phase_target=self.policy.phase.target,
        )
        self.log.append(
            "scan",
            step=self.log.last_step,
            localised_pose=info["believed_pose"],
            range_m=np.round(observation["lidar"], 3),
        )
        if is_new_frame:
            self._log_frame()
        for suspect in info["suspects"]:
            self.log.event("channel fault", f"{suspect}: not used from here on", suspect.channel)
        with on("locating"):
            self._tracker.track(info["time_s"], pose, info["pulses"], self.registration.frame)
        self._log_events(info)
        if self.folder is not None and self.log.n_rows("step") % round(PART_S / STEP_S) == 0:
            self.log.write_part(self.folder)
        # After the route, the environment terminates at the dock, also where the robot only charges.
        self._has_charged_here = self.policy.stage != "continues" or (self._has_charged_here and terminated)
        if info["fell_over"]:
            self.end("fell over")
        elif info["battery"] == 0.0:
            self.end("battery empty")
        elif terminated and not self._has_charged_here:
            self.end("docked")
        elif truncated:
            self.end("time limit")

    def end(self, reason: str) -> None:
        """End the mission and log association, likelihood, calibration and the reason."""
        self.is_over = True
        scenario, meta = self.env.scenario, self.log.meta
        name = f"{meta['name']}, {meta['date']}, seed {meta['seed']}, {meta['policy']}, {self.time_s:.1f} s"
        try:
            self._tracker.finish(name, scenario.array.serial_number, scenario.locating.calibration)
        except UserCodeError as error:  # from a user's Locator
            if self.error is None:
                self._fail(error)
                reason = "error"
        self.log.event("end", f"mission over: {reason}", subject=reason)

    def _fail(self, error: UserCodeError) -> None:
        self.error = error
        self.log.event("error", str(error))

    def _log_frame(self) -> None:
        """Log the estimated frame of the localisation, and once that it disagrees with the map."""
        frame = self.registration.frame
        self.log.append(
            "frame",
            step=self.log.last_step,
            offset=frame.offset,
            covariance=frame.covariance,
            pose_std=(frame.pose_error.position_m, frame.pose_error.heading_rad),
        )
        if (text := self.registration.disagreement) and "frame" not in self.log.column("event", "kind"):
            self.log.event("frame", text)

    def _log_events(self, info: dict[str, Any]) -> None:
        """Log contacts, visited waypoints, waypoints given up and charges, each in the step in which it begins."""
        if self.policy.stage != self._stage:
            self._stage = self.policy.stage
            self.log.event(self._stage, f"{self._stage}: {100.0 * info['battery']:.0f} % of the battery left")
        visited = (np.flatnonzero(info["waypoints_visited"]) + 1).tolist()
        before = self._happened
        self._happened = [
            *(("contact", f"touched {name}", 0, name) for name in sorted(info["touched_names"])),
            *(("waypoint", f"reached waypoint {number}", number, "") for number in visited),
            *(("unreachable", f"gave up waypoint {number}", number, "") for number in sorted(self.policy.unreachable)),
        ]
        for event in self._happened:
            if event not in before:
                self.log.event(*event)
        self.n_visited = len(visited)


def make_locator(scenario: Scenario, site_map: SiteMap, array: ArrayModel) -> LocatorProtocol:
    """Make the Locator of the scenario. It is given the array, fence and map as planned, never the truth.

    Raises:
        UserCodeError: If it is a user's Locator and cannot be loaded or made.
    """
    name = scenario.locating.locator
    make: MakesLocator = load_object(name, LOCATOR) if name else Locator
    with calling(make, LOCATOR) if name else nullcontext():
        locator = make(
            array,
            scenario.pose_sensor.pose_error,
            fence_m=scenario.yard.size_m,
            rules=scenario.locating.rules(),
            sight=site_map.sight,
        )
    missing = [method for method in ("update", "refit", "association") if not hasattr(locator, method)]
    if missing:
        raise UserCodeError(f"{place_of(make)}: has no {', '.join(missing)}; expected {LOCATOR}")
    return locator


def run_mission(scenario: Scenario, policy: str = "seek", seed: int = 0) -> MissionLog:
    """Run a mission to its end; see `Mission` for the arguments."""
    return Mission(scenario, policy, seed).run()
