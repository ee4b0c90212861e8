"""Charge for the drive home: stated and measured consumption."""

import numpy as np
import pytest

from pdpatrol.envs import Scenario
from pdpatrol.envs.scenario.robot import BatteryConfig
from pdpatrol.missions.driving.energy import Consumption, DriveHome
from pdpatrol.missions.driving.site_map import SiteMap

BATTERY = BatteryConfig(capacity_wh=10.0, idle_w=80.0, drive_j_per_m=25.0)


def test_consumption_approaches_what_is_measured() -> None:
    consumption, stated_per_s = Consumption(BATTERY, 0.8), 100.0 / 36_000.0
    assert consumption.driving_per_s == pytest.approx(stated_per_s)
    errors = list[float]()
    for _ in range(6000):
        consumption.measure(0.1 * 1.5 * stated_per_s, 0.1)
        errors.append(1.5 - consumption.driving_per_s / stated_per_s)
    assert np.all(np.diff(errors) < 0.0)
    assert errors[599] == pytest.approx(0.25)  # after a minute
    assert errors[-1] < 0.05


def test_needed_charge_grows_along_the_path_around_a_wall() -> None:
    wall = {"name": "wall", "kind": "wall", "shape": "box", "position_m": (10.0, 7.0), "footprint_m": (0.4, 14.0),
            "height_m": 2.0}  # fmt: skip
    data = {"name": "yard", "route": {"dock_m": (8.0, 3.0)}, "array": {}, "battery": BATTERY}
    walled, free = (
        SiteMap(Scenario.model_validate({**data, "yard": {"size_m": (20.0, 16.0), "equipment": pieces}}))
        for pieces in ((wall,), ())
    )
    consumption = Consumption(BATTERY, free.robot.max_speed_mps)
    for place_m, least_m in (((12.0, 3.0), 22.0), ((8.0, 10.0), 7.0)):
        needs = [DriveHome(site_map).needed_charge(place_m, consumption, 0.2) for site_map in (walled, free)]
        straight_m = np.hypot(place_m[0] - 8.0, place_m[1] - 3.0)
        for need, path_m in zip(needs, (least_m, straight_m), strict=True):
            driving_s = path_m / free.robot.max_speed_mps
            assert need - 0.2 >= driving_s * 100.0 / 36_000.0
            assert need - 0.2 < (1.7 * driving_s + 5.0) * 100.0 / 36_000.0


def test_drive_home_takes_longer_through_a_slow_zone() -> None:
    zone = {"name": "gravel", "polygon_m": ((9.0, 0.0), (13.0, 0.0), (13.0, 16.0), (9.0, 16.0)), "limit_mps": 0.2}
    data = {"name": "yard", "route": {"dock_m": (3.0, 8.0)}, "array": {}, "yard": {"size_m": (20.0, 16.0)}}
    free, slow = (SiteMap(Scenario.model_validate({**data, "zones": zones})) for zones in ((), (zone,)))
    assert free.robot.max_speed_mps == pytest.approx(0.8)
    longer_s = DriveHome(slow).duration_s((17.0, 8.0)) - DriveHome(free).duration_s((17.0, 8.0))
    assert 4.0 / 0.2 - 4.0 / 0.8 < longer_s < 2.0 * (4.0 / 0.2 - 4.0 / 0.8)
    assert DriveHome(slow).duration_s((8.0, 8.0)) == DriveHome(free).duration_s((8.0, 8.0))
