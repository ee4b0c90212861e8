"""Comparison of the array with its data sheet, in missions in which nature has another array."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from pdpatrol.envs import load_scenario
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.records import Report
from pdpatrol.missions.runner import run_mission


@cache
def report_with(name: str = "", value: float | str = 0.0, limit_s: float = 60.0) -> Report:
    """Run a mission in which the array may differ from the one that the robot believes in."""
    nature = {f"nature.array.{name}": value} if name else {}
    return make_report(run_mission(load_scenario("one_source", {"task.time_limit_s": limit_s, **nature}), seed=42), 0.0)


CASES: list[tuple[tuple[Any, ...], str]] = [
    (("beam_width_scale", 1.15), "wider than that of the data sheet"),
    (("beam_width_scale", 0.85), "narrower than that of the data sheet"),
    (("mount_yaw_deg", -6.0, 300.0), "degrees clockwise against the robot"),
    (("pattern", "helix_in_ring", 600.0), "the gain pattern of the antennas differs"),
    ((), ""),
]


@pytest.mark.whole
@pytest.mark.parametrize(("nature", "message"), CASES, ids=["wider", "narrower", "turned", "helix", "sound"])
def test_report_names_how_the_array_differs(nature: tuple[Any, ...], message: str) -> None:
    report = report_with(*nature)
    assert report.array is not None
    found = report.array.contradictions
    assert any(message in text for text in found) if message else found == ()
    if "beam_width_scale" in nature:
        assert abs(report.array.beam_width - nature[1]) < 0.03
    if "mount_yaw_deg" in nature:
        assert abs(report.array.yaw_deg - nature[1]) < 2.0


@pytest.mark.whole
@pytest.mark.parametrize("scale", [0.85, 1.15])
def test_measured_gains_show_the_beam_width(scale: float) -> None:
    """From 100 to 150 degrees off boresight, a wider beam has more gain than the data sheet, relative to the front."""
    check = report_with("beam_width_scale", scale).array
    assert check is not None
    excess_db = {gain.off_boresight_deg: gain.measured_db - gain.data_sheet_db for gain in check.by_angle}
    behind = np.mean([value for angle, value in excess_db.items() if 100.0 < abs(angle) < 150.0])
    ahead = np.mean([value for angle, value in excess_db.items() if abs(angle) < 30.0])
    assert np.sign(behind - ahead) == np.sign(scale - 1.0)
    assert abs(behind - ahead) > 0.5


def test_without_findings_the_array_is_not_compared() -> None:
    assert report_with(limit_s=1.0).array is None
