"""Recharging: drives any policy's robot to the dock in time, charges, and lets the policy go on."""

from collections.abc import Sequence

import numpy as np

from dirmusic import Finding
from pdpatrol.envs.patrol_env import STEP_S, Observation
from pdpatrol.envs.scenario.robot import BatteryConfig
from pdpatrol.missions.driving.energy import Consumption, DriveHome
from pdpatrol.missions.driving.path_follower import PathFollower
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.policies.collision_guard import CollisionGuard
from pdpatrol.missions.policies.protocol import (
    Action,
    ReportingPolicy,
    believed_pose,
    resume,
    time_of,
)
from pdpatrol.missions.record.events import ChargingStage, Phase

DOCKED = 0.3
"""Distance from the dock at which the robot stops to be charged, as a share of the distance within which the dock
counts as reached. Assumed; the rest is for the error of the pose."""


class DriveToDock(ReportingPolicy):
    """Policy that drives to the dock and stands there."""

    def __init__(self) -> None:
        self.phase = Phase("return to charge")
        self._drive: PathFollower | None = None

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """Follow the path to the dock; start anew if the drive takes too long."""
        pose, time_s, drive = believed_pose(observation), time_of(observation, site_map), self._drive
        if drive is None or time_s > drive.deadline_s:
            radius_m = DOCKED * site_map.task.waypoint_radius_m
            drive = PathFollower(site_map.reach(pose), np.asarray(site_map.route.dock_m), time_s, radius_m)
            self._drive = drive
        drive.update_map(site_map, pose)
        return np.zeros(2, dtype=np.float32) if drive.has_arrived(pose) else drive.action(pose)


class Recharging(ReportingPolicy):
    """Wrapper of a policy that returns to the dock to charge while the charge lasts for the drive and the reserve.

    The charge that the drive needs follows from the path on the map and the consumption, which the robot measures while
    it drives. A policy in the phase `return to dock` is not interrupted: it is on its way.

    Args:
        policy: Policy that drives while the battery lasts. Its `resume` is called after each charge.
        battery: Battery as the robot believes it.

    Attributes:
        stage: Current stage; `continues` while the policy drives.
    """

    def __init__(self, policy: ReportingPolicy, battery: BatteryConfig) -> None:
        self.phase, self.unreachable = policy.phase, policy.unreachable
        self.stage: ChargingStage = "continues"
        self._policy = policy
        self._battery = battery
        self._home: DriveHome | None = None
        self._consumption: Consumption | None = None
        self._charge = np.nan
        self._return: CollisionGuard | None = None

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """Return the policy's action, or one that drives to the dock or stands there."""
        self._advance(observation, site_map)
        if self.stage == "charging":
            self.phase = Phase("charge")
            return np.zeros(2, dtype=np.float32)
        if self._return is not None:
            self.phase = Phase("return to charge")
            return self._return(observation, findings, site_map)
        action = self._policy(observation, findings, site_map)
        self.phase, self.unreachable = self._policy.phase, self._policy.unreachable
        return action

    def _advance(self, observation: Observation, site_map: SiteMap) -> None:
        """Measure the consumption, and go on to the next stage when it is due."""
        if self._home is None or self._consumption is None:
            self._home = DriveHome(site_map)
            self._consumption = Consumption(self._battery, site_map.robot.max_speed_mps)
        charge, before = float(observation["state_of_charge"][0]), self._charge
        self._charge = charge
        if charge < before and abs(observation["velocity"][0]) > 0.5 * site_map.robot.max_speed_mps:
            self._consumption.measure(before - charge, STEP_S)
        if self.stage == "continues" and self.phase.name != "return to dock":
            place_m = believed_pose(observation)[:2]
            if charge <= self._home.needed_charge(place_m, self._consumption, self._battery.reserve):
                self.stage, self._return = "returns to charge", CollisionGuard(DriveToDock())
        elif self.stage == "returns to charge" and charge > before:
            self.stage = "charging"
        elif self.stage == "charging" and charge >= 1.0:
            self.stage, self._return = "continues", None
            resume(self._policy)
