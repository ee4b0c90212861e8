"""Shift plans: energy of a round and its charges, next to a mission that drives them."""

import json

import numpy as np
import pytest

from pdpatrol.envs import Scenario
from pdpatrol.missions.driving.energy import Consumption, DriveHome
from pdpatrol.missions.driving.site_map import SiteMap, distances_along
from pdpatrol.missions.planning.output import as_json, summary
from pdpatrol.missions.planning.shift import PlannedRoute, ShiftPlan, plan_shift, shift_text
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.runner import run_mission
from tests.missions.planning.one_plan import plan_of

STOPS_M = ((20.0, 4.0), (26.0, 15.0), (14.0, 17.0), (26.0, 10.0), (5.0, 12.0), (16.0, 5.0), (27.0, 3.0), (10.0, 10.0))
HALT_S = 2.0


def yard(capacity_wh: float, dwell_s: float) -> Scenario:
    return Scenario.model_validate(
        {
            "name": "yard",
            "yard": {"size_m": (30.0, 20.0)},
            "array": {},
            "route": {"dock_m": (3.0, 3.0), "waypoints_m": STOPS_M, "dwell_s": dwell_s},
            "battery": {"capacity_wh": capacity_wh},
            "task": {"time_limit_s": 3000.0},
        }
    )


def planned(scenario: Scenario) -> tuple[ShiftPlan, PlannedRoute]:
    """Return the shift plan of the given route, and its path."""
    site_map, path_m, stops_m = SiteMap(scenario), [], []
    for start_m, end_m in zip(
        (scenario.route.dock_m, *scenario.route.stops_m), (*scenario.route.stops_m, scenario.route.dock_m), strict=True
    ):
        path_m.append(site_map.reach(start_m).path(site_map.cell(end_m)))
        stops_m.append(path_m[-1][-1])
    route = PlannedRoute(np.concatenate(path_m), np.array(stops_m[:-1]), scenario.route.dwell_s, HALT_S)
    return plan_shift(scenario, site_map, route), route


def test_energy_is_that_of_path_and_time() -> None:
    scenario = yard(480.0, 10.0)
    shift, route = planned(scenario)
    length_m = distances_along(route.path_m)[-1]
    duration_s = length_m / scenario.robot.description.max_speed_mps + len(STOPS_M) * (HALT_S + 10.0) + HALT_S
    assert (shift.charges, shift.out_of_reach) == ((), 0)
    assert shift.duration_s == pytest.approx(duration_s)
    assert shift.energy_wh == pytest.approx((80.0 * duration_s + 20.0 * length_m) / 3600.0)


@pytest.mark.parametrize("capacity_wh", [3.2, 4.0, 5.0, 7.0])
def test_planned_charges_keep_the_reserve_and_add_up(capacity_wh: float) -> None:
    scenario = yard(capacity_wh, 10.0)
    shift, _ = planned(scenario)
    assert shift.out_of_reach == 0
    assert shift.charges
    stops = [charge.next_stop for charge in shift.charges]
    assert stops == sorted(set(stops))
    used = 0.0
    for charge in shift.charges:
        assert 0.2 <= charge.battery_left <= 0.4
        assert charge.duration_s == pytest.approx((1.0 - charge.battery_left) * 3600.0 * capacity_wh / 240.0)
        used += 1.0 - charge.battery_left
    assert 0.0 < shift.energy_wh / capacity_wh - used < 0.8
    without, _ = planned(yard(480.0, 10.0))
    assert shift.energy_wh > without.energy_wh
    assert shift.duration_s > without.duration_s + sum(charge.duration_s for charge in shift.charges)


def test_stop_that_needs_more_than_a_charge_is_named() -> None:
    shift, _ = planned(yard(1.6, 0.0))
    consumption = Consumption(yard(1.6, 0.0).battery, 0.8)
    far = [DriveHome(SiteMap(yard(1.6, 0.0))).needed_charge(stop_m, consumption, 0.2) for stop_m in STOPS_M]
    number = shift.out_of_reach
    assert number > 0
    assert far[number - 1] > 0.5  # there and back is more than a charge
    assert f"stop {number} is out of reach of one charge" in shift_text(shift)


@pytest.mark.whole
@pytest.mark.parametrize(("capacity_wh", "dwell_s"), [(2.9, 0.0), (3.6, 10.0)])
def test_mission_of_three_charges_ends_as_planned(capacity_wh: float, dwell_s: float) -> None:
    scenario = yard(capacity_wh, dwell_s)
    shift, _ = planned(scenario)
    log = run_mission(scenario, "patrol", seed=1)
    report, step = make_report(log, 0.0), log.table("step")
    assert report.ending == "docked"
    assert report.waypoints.missed == ()
    assert len(report.charges) == len(shift.charges) == 3
    assert report.sim_time_s == pytest.approx(shift.duration_s, rel=0.03)
    for charge, expected in zip(report.charges, shift.charges, strict=True):
        assert charge.battery_left == pytest.approx(expected.battery_left, abs=0.05)
        assert charge.returned_s == pytest.approx(expected.time_s, abs=10.0)
        last = int(np.searchsorted(step["time_s"], charge.returned_s)) - 1
        assert step["phase_target"][last] == expected.next_stop


@pytest.mark.whole
def test_plan_states_energy_and_duration() -> None:
    plan = plan_of("one_source")
    shift, n_stops = plan.shift, len(plan.stops_m)
    assert shift.duration_s == pytest.approx(plan.driving_s + n_stops * plan.dwell_s, abs=1.0)
    assert shift_text(shift) in summary(plan)
    assert json.loads(json.dumps(as_json(plan)))["shift"]["energy_wh"] == shift.energy_wh
