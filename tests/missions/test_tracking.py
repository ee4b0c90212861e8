"""Pulses and findings that the Tracker logs."""

from dataclasses import replace

import numpy as np

from dirmusic import ArrayModel, ElementSpread, Finding, GainManifold, PoseError, PulseBatch
from dirmusic.bearing.maximum_likelihood import maximum_likelihood
from dirmusic.locating.association import Unassociated
from dirmusic.locating.rules import CredibilityRules
from pdpatrol.envs import load_scenario
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.tracking import Tracker
from pdpatrol.missions.runner import run_mission
from tests.missions.steps import candidate

MANIFOLD = GainManifold.ring(6)
ARRAY = ArrayModel(manifold=MANIFOLD, positions_m=np.zeros((6, 3)), spread=ElementSpread(gain=0.05))
FINDING = candidate((1.0, 2.0, 1.5), np.eye(3))


class FixedLocator:
    """A Locator whose findings the test sets."""

    def __init__(self) -> None:
        self.findings: tuple[Finding, ...] = ()

    def update(self, time_s: float, pose: np.ndarray, pulses: PulseBatch) -> tuple[Finding, ...]:
        return self.findings

    def refit(self, time_s: float) -> tuple[Finding, ...]:
        return self.findings

    def association(self) -> np.ndarray:
        return np.empty(0, dtype=np.intp)


def test_findings_are_logged_when_their_values_change() -> None:
    log, locator = MissionLog({"n_elements": 6, "bounds_m": [[0, 0], [1, 1]]}), FixedLocator()
    pose_error = PoseError(position_m=0.05, heading_rad=0.01, correlation_s=5.0)
    tracker = Tracker(log, locator, ARRAY, pose_error, maximum_likelihood, CredibilityRules())
    once = (FINDING,)
    for findings in (once, once, (replace(FINDING),), (replace(FINDING, n_bearings=9),), ()):
        locator.findings = findings
        tracker.track(0.1, np.zeros(3), PulseBatch.none(6))
    assert log.column("finding", "state").tolist() == ["candidate", "candidate", "dropped"]
    assert np.isnan(log.column("finding", "confirmed_s")).all()
    assert log.column("event", "kind").tolist() == ["candidate", "dropped"]


def test_each_credible_pulse_has_an_association() -> None:
    log = run_mission(load_scenario("two_sources", {"task.time_limit_s": 40.0}), seed=5)
    np.testing.assert_array_equal(log.column("association", "pulse"), log.column("bearing", "pulse"))
    np.testing.assert_array_equal(log.column("bearing", "pulse"), np.flatnonzero(log.column("pulse", "is_credible")))
    alive = log.column("finding", "id")[log.column("finding", "step") == log.column("finding", "step")[-1]]
    assert alive.size > 0
    assert set(log.column("association", "finding").tolist()) <= {*alive.tolist(), *Unassociated}
    owned = (log.column("association", "finding") > 0).mean()
    assert owned > 0.3


def test_total_deviation_exceeds_that_of_noise_and_heading() -> None:
    bearing = run_mission(load_scenario("two_sources", {"task.time_limit_s": 10.0}), seed=5).table("bearing")
    least_rad = np.hypot(bearing["std_rad"], np.radians(2.0))  # an array with 5 % of gain error, and 0.5 deg of heading
    assert bearing["pulse"].size > 50
    assert np.all(bearing["total_std_rad"] > least_rad)
