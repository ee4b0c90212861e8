"""Shift plan: energy of a round along a planned tour, and where the robot returns to charge."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dirmusic.arrays import FloatArray
from pdpatrol.envs import Scenario
from pdpatrol.missions.driving.energy import Consumption, DriveHome, driving_power_w
from pdpatrol.missions.driving.site_map import SiteMap, distances_along


@dataclass(frozen=True)
class PlannedCharge:
    """Charge of the battery during a round.

    Attributes:
        next_stop: Number, from 1, of the stop to which the robot drives when it turns back, and from the dock later.
        place_m: Place where it turns back, world frame.
        time_s: Time since the start of the round, with earlier charges.
        battery_left: State of charge at the dock.
        duration_s: Time that it charges.
    """

    next_stop: int
    place_m: tuple[float, float]
    time_s: float
    battery_left: float
    duration_s: float


@dataclass(frozen=True)
class ShiftPlan:
    """Energy and charges of a round, as the robot believes them.

    Attributes:
        energy_wh: Energy of the round from the battery, with the drives to the charger and back.
        duration_s: Duration of the round with all charges.
        charges: Charges in order.
        out_of_reach: Number, from 1, of the first stop that the robot cannot reach and leave again on one charge; the
            plan ends there. 0 if it reaches all stops.
    """

    energy_wh: float
    duration_s: float
    charges: tuple[PlannedCharge, ...]
    out_of_reach: int


@dataclass(frozen=True)
class PlannedRoute:
    """Closed path past the stops of a round.

    Attributes:
        path_m: Path from the dock and back, shape (n, 2), world frame.
        stops_m: Stops on the path in order, shape (n_stops, 2).
        dwell_s: Time to stand at each stop.
        halt_s: Time to halt at each stop and at the dock.
    """

    path_m: FloatArray
    stops_m: FloatArray
    dwell_s: float
    halt_s: float

    def legs_m(self) -> Iterator[FloatArray]:
        """Yield the paths to the stops and from the last one to the dock, each of shape (n, 2)."""
        start = 0
        for stop_m in self.stops_m:
            end = start + int(np.linalg.norm(self.path_m[start:] - stop_m, axis=1).argmin())
            yield self.path_m[start : end + 1]
            start = end
        yield self.path_m[start:]


class Shift:
    """Round in progress: time, energy and state of charge by the stated consumption.

    Args:
        scenario: Scenario with the battery and the robot.
        site_map: Map with the dock.

    Attributes:
        home: Drives to the dock.
        time_s: Time since the start.
        energy_wh: Energy that was taken from the battery.
        left: State of charge.
    """

    def __init__(self, scenario: Scenario, site_map: SiteMap) -> None:
        self._battery, self._speed_mps = scenario.battery, scenario.robot.description.max_speed_mps
        self._consumption = Consumption(self._battery, self._speed_mps)
        self._radius_m = scenario.task.waypoint_radius_m
        self.home = DriveHome(site_map)
        self.time_s, self.energy_wh, self.left = 0.0, 0.0, 1.0

    def stand(self, duration_s: float) -> None:
        """Stand for a time."""
        self._use(self._battery.idle_w, duration_s)

    def drive(self, path_m: FloatArray) -> None:
        """Drive along a path (n, 2)."""
        duration_s = float(distances_along(path_m)[-1]) / self._speed_mps
        self._use(driving_power_w(self._battery, self._speed_mps), duration_s)

    def visit(self, path_m: FloatArray, dwell_s: float) -> FloatArray | None:
        """Drive along a path (n, 2) and dwell at its end, as long as the charge lasts for the drive to the dock.

        Returns:
            Place (2,) where the robot turned back before that, or None.
        """
        for before_m, place_m in pairwise(path_m):
            self.drive(np.array([before_m, place_m]))
            is_reached = np.linalg.norm(path_m[-1] - place_m) <= self._radius_m
            if not is_reached and self._spare(place_m) <= 0.0:
                return place_m
        spare_s = max(self._spare(path_m[-1]), 0.0) * 3600.0 * self._battery.capacity_wh / self._battery.idle_w
        self.stand(min(dwell_s, spare_s))
        return path_m[-1] if spare_s < dwell_s else None

    def _spare(self, place_m: FloatArray) -> float:
        """Return the state of charge above that which the drive from a place (2,) to the dock needs."""
        return self.left - self.home.needed_charge(place_m, self._consumption, self._battery.reserve)

    def charge(self) -> float:
        """Charge the battery fully, and return the time that it takes."""
        duration_s = 3600.0 * (1.0 - self.left) * self._battery.capacity_wh / self._battery.charge_w
        self.time_s, self.left = self.time_s + duration_s, 1.0
        return duration_s

    def _use(self, power_w: float, duration_s: float) -> None:
        self.time_s += duration_s
        self.energy_wh += power_w * duration_s / 3600.0
        self.left -= power_w * duration_s / (3600.0 * self._battery.capacity_wh)


def plan_shift(scenario: Scenario, site_map: SiteMap, route: PlannedRoute) -> ShiftPlan:
    """Plan the charges of one round.

    The robot drives at the top speed and returns to charge by the rule of a mission, but not while it drives to the
    dock at the end. From the dock it goes on to the stop by the shortest path, and dwells there anew.
    """
    shift, charges = Shift(scenario, site_map), list[PlannedCharge]()
    legs_m = list(route.legs_m())
    for number, leg_m in enumerate(legs_m, start=1):
        if number == len(legs_m):
            shift.drive(leg_m)
            shift.stand(route.halt_s)
            break
        is_from_dock = number == 1
        while (place_m := shift.visit(leg_m, route.dwell_s)) is not None:
            if is_from_dock:
                return ShiftPlan(shift.energy_wh, shift.time_s, tuple(charges), number)
            turned_s = shift.time_s
            shift.drive(shift.home.paths.path(site_map.cell(place_m)))
            shift.stand(route.halt_s)
            left = shift.left
            charges.append(PlannedCharge(number, tuple(place_m.tolist()), turned_s, left, shift.charge()))
            leg_m, is_from_dock = shift.home.paths.path(site_map.cell(leg_m[-1])), True
        shift.stand(route.halt_s)
    return ShiftPlan(shift.energy_wh, shift.time_s, tuple(charges), 0)


def shift_text(shift: ShiftPlan) -> str:
    """State energy, duration and charges of a round."""
    text = f"{shift.energy_wh:.3g} Wh and {shift.duration_s:.0f} s per round"
    if shift.charges:
        stops, plural = ", ".join(str(charge.next_stop) for charge in shift.charges), "s" * (len(shift.charges) > 1)
        text += f", with {len(shift.charges)} charge{plural} on the way to stop {stops}"
    if shift.out_of_reach:
        text += f"; stop {shift.out_of_reach} is out of reach of one charge"
    return text
