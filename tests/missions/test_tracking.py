"""Tracker and logbook."""

from dataclasses import replace

import numpy as np

from dirmusic import ArrayModel, ElementSpread, Finding, GainManifold, PoseError, PulseBatch
from dirmusic.bearing.maximum_likelihood import MaximumLikelihood
from dirmusic.locating.association import Unassociated
from dirmusic.locating.rules import CredibilityRules
from dirmusic.locating.yard_likelihood import Grid, YardLikelihood
from pdpatrol.envs import load_scenario
from pdpatrol.missions.record.logbook import Logbook
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.tracking import Tracked, Tracker
from pdpatrol.missions.runner import run_mission

MANIFOLD = GainManifold.ring(6)
ARRAY = ArrayModel(manifold=MANIFOLD, positions_m=np.zeros((6, 3)), spread=ElementSpread(gain=0.05))
POSE = np.zeros(3)
FINDING = Finding(
    id=3, state="candidate", position_m=np.array([1.0, 2.0, 1.5]), covariance_m2=np.eye(3), n_bearings=1,
    first_detected_s=0.0, last_detected_s=0.0, confirmed_s=None, aperture_rad=0.0, nearest_m=1.0, level_db=0.0,
)  # fmt: skip


class Noted:
    """A Locator that records its input and returns fixed results."""

    def __init__(self, findings: tuple = (), association: object = None) -> None:
        self.findings, self.given = findings, []
        self._association = association

    def update(self, time_s: float, pose: np.ndarray, pulses: PulseBatch) -> tuple:
        self.given.append(pulses)
        return self.findings

    def refit(self, time_s: float) -> tuple:
        return self.findings

    def association(self) -> object:
        return self._association


def tracker_of(locator: Noted) -> Tracker:
    pose_error = PoseError(position_m=0.0, heading_rad=0.0, correlation_s=1.0)
    likelihood = YardLikelihood(ARRAY, pose_error, Grid.over(np.zeros(2), np.array([10.0, 8.0])))
    rules = CredibilityRules()
    return Tracker(locator, ARRAY, MaximumLikelihood(), rules, likelihood)  # pyright: ignore[reportArgumentType]


def pulses_of(*azimuth_rad: float) -> PulseBatch:
    """Return a strong pulse from each azimuth, and one that is not a plane wave."""
    strengths = np.concatenate([0.5 * MANIFOLD.gain(np.array(azimuth_rad)).T, [[1.0, 0.1, 1.0, 0.1, 1.0, 0.1]]])
    pulses = PulseBatch.detected(np.zeros(len(strengths)), strengths, np.full(strengths.shape, 1e-6))
    found = MaximumLikelihood()(pulses, ARRAY)
    return pulses._replace(azimuth_rad=found.azimuth_rad, std_rad=found.std_rad, misfit=found.misfit)


def test_tracker_passes_on_credible_pulses_only() -> None:
    locator = Noted()
    tracked = tracker_of(locator).track(0.0, POSE, pulses_of(0.3, 2.0))
    assert tracked.is_credible.tolist() == [True, True, False]
    np.testing.assert_allclose(locator.given[0].azimuth_rad, [0.3, 2.0], atol=1e-6)


def test_log_keeps_all_pulses_and_credible_bearings() -> None:
    log = MissionLog({"n_elements": 6})
    log.append(
        "step",
        time_s=0.1,
        pose=POSE,
        true_pose=POSE,
        odometry=POSE,
        battery=1.0,
        command=POSE[:2],
        phase="",
        phase_target=0,
    )
    book, tracker = Logbook(log), tracker_of(Noted(association=np.array([3, Unassociated.ECHO])))
    book.log_tracked(POSE, tracker.track(0.1, POSE, pulses_of(0.3, 2.0)))
    book.log_association(tracker.association())
    assert log.column("pulse", "is_credible").tolist() == [True, True, False]
    assert log.column("bearing", "pulse").tolist() == log.column("association", "pulse").tolist() == [0, 1]
    assert log.column("association", "finding").tolist() == [3, Unassociated.ECHO]


def test_findings_are_logged_when_their_values_change() -> None:
    log = MissionLog({"n_elements": 6})
    book, once = Logbook(log), (FINDING,)
    for findings in (once, once, (replace(FINDING),), (replace(FINDING, n_bearings=9),), ()):
        book.log_tracked(POSE, Tracked(PulseBatch.none(6), np.empty(0, dtype=np.bool_), findings))
    assert log.column("finding", "state").tolist() == ["candidate", "candidate", "dropped"]
    assert np.isnan(log.column("finding", "confirmed_s")).all()
    assert log.column("event", "kind").tolist() == ["candidate", "dropped"]


def test_each_credible_pulse_has_an_association() -> None:
    scenario = load_scenario("two_sources")
    task = scenario.task.model_copy(update={"time_limit_s": 40.0})
    log = run_mission(scenario.model_copy(update={"task": task}), seed=5)
    np.testing.assert_array_equal(log.column("association", "pulse"), log.column("bearing", "pulse"))
    alive = log.column("finding", "id")[log.column("finding", "step") == log.column("finding", "step")[-1]]
    assert alive.size > 0
    assert set(log.column("association", "finding").tolist()) <= {*alive.tolist(), *Unassociated}
    owned = (log.column("association", "finding") > 0).mean()
    assert owned > 0.3
