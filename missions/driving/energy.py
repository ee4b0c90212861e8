"""Energy of the robot: the state of charge that it needs to drive to the dock, by stated and measured consumption."""

import numpy as np
from numpy.typing import ArrayLike

from pdpatrol.envs.scenario.robot import BatteryConfig
from pdpatrol.missions.driving.site_map import SiteMap

MARGIN = 0.3
"""Share that is added to the time of the drive home, for turns and detours. Assumed; patrols of random yards take up to
10 % longer than their path at the top speed. What a longer detour takes is taken from the reserve."""

TURN_S = 4.0
"""Time to stop, turn towards the dock and speed up again. Assumed; half a turn takes 2 to 4 s."""

TRUSTED_S = 60.0
"""Driving time after which the measured consumption counts as much as the stated one. Assumed."""


class Consumption:
    """Consumption of the driving robot, which starts as stated and approaches the measured one.

    Args:
        battery: Battery and loads as the robot believes them.
        speed_mps: Speed of the robot.

    Attributes:
        driving_per_s: State of charge that a second of driving takes.
    """

    def __init__(self, battery: BatteryConfig, speed_mps: float) -> None:
        self.driving_per_s = driving_power_w(battery, speed_mps) / (3600.0 * battery.capacity_wh)
        self._trusted_s = TRUSTED_S

    def measure(self, used: float, step_s: float) -> None:
        """Take in the state of charge that a step of driving has used."""
        self._trusted_s += step_s
        self.driving_per_s += (used - self.driving_per_s * step_s) / self._trusted_s


def driving_power_w(battery: BatteryConfig, speed_mps: float) -> float:
    """Return the stated power of a robot that drives at a speed."""
    return battery.idle_w + battery.drive_j_per_m * speed_mps


class DriveHome:
    """Drives to the dock from every place of the map.

    Args:
        site_map: Map as planned.
    """

    def __init__(self, site_map: SiteMap) -> None:
        self._site_map = site_map
        self.paths = site_map.reach(site_map.route.dock_m)
        slowness = 1.0 / site_map.speed_limit(site_map.centres_m) - 1.0 / site_map.robot.max_speed_mps
        self._in_zones_s = self.paths.integrate(slowness)

    def duration_s(self, place_m: ArrayLike) -> float:
        """Return the time of the drive from a place (2,), with the margin; ground near equipment counts twice."""
        cell = self._site_map.cell(place_m)
        if not np.isfinite(self.paths.length_m[cell]):
            cell = self.paths.nearest(place_m)
        at_top_speed_s = float(self.paths.length_m[cell]) / self._site_map.robot.max_speed_mps
        return TURN_S + (1.0 + MARGIN) * (at_top_speed_s + float(self._in_zones_s[cell]))

    def needed_charge(self, place_m: ArrayLike, consumption: Consumption, reserve: float) -> float:
        """Return the state of charge with which the robot has to leave a place (2,) to arrive with the reserve."""
        return reserve + consumption.driving_per_s * self.duration_s(place_m)
