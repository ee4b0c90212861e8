"""Missions that pass on a calibration of their array."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from dirmusic.locating.finding import ellipse95
from pdpatrol.envs import Scenario, load_scenario
from pdpatrol.envs.scenario.array import ArrayCalibration
from pdpatrol.envs.scenario.base import as_tuples
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.runner import run_mission

LOCATED_M = 0.3
"""Semi-major axis of the 95 % ellipse below which a source counts as located."""

NEAR_M = 2.0
"""Distance from the source within which a finding belongs to it."""


def scenario(number: int, calibration: ArrayCalibration | None = None, limit_s: float = 600.0) -> Scenario:
    settings: dict[str, Any] = {"array.serial_number": number, "task.time_limit_s": limit_s}
    if calibration is not None:
        settings["locating.calibration"] = calibration
    return load_scenario("one_source", settings)


def calibration_of(log: MissionLog) -> ArrayCalibration:
    return ArrayCalibration.model_validate(as_tuples(log.meta["calibration"]))


def relabelled(calibration: ArrayCalibration, number: int) -> ArrayCalibration:
    """Return the calibration with another serial number."""
    return calibration.model_copy(update={"serial_number": number})


def test_serial_number_fixes_the_array() -> None:
    truths = [run_mission(scenario(number, limit_s=0.2), seed=seed).meta["truth"] for number, seed in NUMBERED]
    assert truths[0]["array"] == truths[1]["array"] != truths[2]["array"]
    assert truths[0]["sources"] != truths[1]["sources"]
    assert truths[0]["sources"] == truths[2]["sources"]


NUMBERED = ((7, 0), (7, 1), (8, 0))


@pytest.fixture(scope="module")
def first() -> MissionLog:
    """Return the log of a mission that confirms its source within 60 s."""
    return run_mission(scenario(10, limit_s=60.0), seed=1010)


def test_estimated_array_errors_match_the_truth(first: MissionLog) -> None:
    errors, truth = calibration_of(first).errors(), first.meta["truth"]["array"]
    pointing = np.array(truth["boresights_rad"]) - np.array(first.meta["array"]["boresights_rad"])
    miss = errors.state[:12] - np.concatenate([np.array(truth["gain_factors"]) - 1.0, pointing])
    assert miss @ np.linalg.solve(errors.covariance[:12, :12], miss) < 26.2  # 99 % quantile, 12 degrees of freedom
    assert np.sqrt(np.diag(errors.covariance)[6:12].mean()) < 0.9 * np.radians(np.hypot(2.0, 1.0))  # elements and mount


def test_mission_without_findings_has_no_calibration() -> None:
    assert "calibration" not in run_mission(scenario(10, limit_s=2.0), seed=1010).meta


@pytest.mark.whole
def test_calibrated_missions_are_deterministic(first: MissionLog) -> None:
    calibrated = scenario(10, calibration_of(first), limit_s=60.0)
    logs = [run_mission(calibrated, seed=1010) for _ in range(2)]
    assert logs[0].meta["calibration"] == logs[1].meta["calibration"]
    for column in ("position_m", "covariance_m2"):
        assert logs[0].column("finding", column).tobytes() == logs[1].column("finding", column).tobytes()
    assert calibration_of(logs[0]).n_missions == 2
    assert make_report(logs[0], 0.0).calibration == ()


@pytest.mark.whole
def test_calibration_of_another_array_is_detected(first: MissionLog) -> None:
    wrong = scenario(5010, relabelled(calibration_of(first), 5010), limit_s=60.0)
    log = run_mission(wrong, seed=1010)
    (message,) = make_report(log, 0.0).calibration
    assert "contradict" in message
    assert calibration_of(log).n_missions == 1
    (match,) = make_report(log, 0.0).scores.matches
    assert match.is_inside(0.95)[0]


def located_s(log: MissionLog) -> float:
    """Return the time at which the source was located, or the end of the mission if it was not."""
    table, time_s = log.table("finding"), log.column("step", "time_s")
    source_m = np.array(log.meta["truth"]["sources"][0]["position_m"])
    for row in range(table["id"].size):
        is_near = np.linalg.norm((table["position_m"][row] - source_m)[:2]) < NEAR_M
        if is_near and ellipse95(table["covariance_m2"][row, :2, :2]).semi_major_m <= LOCATED_M:
            return float(time_s[table["step"][row]])
    return float(time_s[-1])


def location_time_ratios(numbers: Sequence[int], limit_s: float) -> list[float]:
    """Return the ratios of the location times with and without a calibration, for the same pulses."""
    ratios: list[float] = []
    for number in numbers:
        learned = calibration_of(run_mission(scenario(number), "seek", seed=number))
        without, with_it = (
            located_s(run_mission(scenario(number, calibration, limit_s), "patrol", seed=1000 + number))
            for calibration in (None, learned)
        )
        ratios.append(with_it / without)
    return ratios


@pytest.mark.parametrize(
    ("numbers", "limit_s"),
    [((3, 4, 10), 80.0), pytest.param(range(12), 600.0, marks=pytest.mark.slow)],
    ids=["a_few", "twelve"],
)
@pytest.mark.whole
def test_calibrated_mission_locates_no_later(numbers: Sequence[int], limit_s: float) -> None:
    ratios = location_time_ratios(numbers, limit_s)
    assert np.median(ratios) < 1.0
    assert max(ratios) < 1.1
