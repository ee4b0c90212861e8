"""Pulses and findings that the Tracker logs."""

from dataclasses import replace

import numpy as np
import pytest

from dirmusic import ArrayModel, ElementSpread, Finding, GainManifold, Locator, PoseError, PulseBatch
from dirmusic.frame import FrameEstimate
from dirmusic.locating.finding import State
from dirmusic.locating.protocol import LocatorProtocol
from pdpatrol.envs import Scenario, load_scenario
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.tracking import Tracker
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.runner import run_mission
from tests.missions.steps import append_step, candidate

MANIFOLD = GainManifold.ring(6)
ARRAY = ArrayModel(manifold=MANIFOLD, positions_m=np.zeros((6, 3)), spread=ElementSpread(gain=0.05))
POSE_ERROR = PoseError(position_m=0.05, heading_rad=0.01, correlation_s=5.0)
FINDING = candidate((1.0, 2.0, 1.5), np.eye(3))


class FixedLocator:
    """A Locator whose findings the test sets, and which notes how many pulses it was given."""

    def __init__(self) -> None:
        self.findings: tuple[Finding, ...] = ()
        self.given = PulseBatch.none(6)

    def update(self, time_s: float, pose: np.ndarray, pulses: PulseBatch) -> tuple[Finding, ...]:
        self.given = pulses
        return self.findings

    def refit(self, time_s: float) -> tuple[Finding, ...]:
        return self.findings

    def association(self) -> np.ndarray:
        return np.empty(0, dtype=np.intp)


def tracker_of(locator: LocatorProtocol) -> tuple[MissionLog, Tracker]:
    """Make a log and a tracker of findings and pulses that the test sets."""
    log = MissionLog({"n_elements": 6, "bounds_m": [[0, 0], [1, 1]]})
    append_step(log, 0.0, np.zeros(3))
    return log, Tracker(log, locator, ARRAY, POSE_ERROR, np.radians(25.0))


def test_findings_are_logged_when_their_values_change() -> None:
    locator = FixedLocator()
    log, tracker = tracker_of(locator)
    once = (FINDING,)
    for findings in (once, once, (replace(FINDING),), (replace(FINDING, n_bearings=9),), ()):
        locator.findings = findings
        tracker.track(0.1, np.zeros(3), PulseBatch.none(6))
    assert log.column("finding", "state").tolist() == ["candidate", "candidate", "dropped"]
    assert np.isnan(log.column("finding", "confirmed_s")).all()
    assert log.column("finding", "existence").tolist() == [FINDING.existence] * 3
    assert log.column("event", "kind").tolist() == ["candidate", "dropped"]


@pytest.mark.parametrize(
    ("state", "name"), [("candidate", "candidate"), ("confirmed", "finding"), ("outside", "source")]
)
def test_event_calls_only_what_is_confirmed_a_finding(state: State, name: str) -> None:
    locator = FixedLocator()
    log, tracker = tracker_of(locator)
    for findings in ((replace(FINDING, state=state, possibly_two=True),), ()):
        locator.findings = findings
        tracker.track(0.1, np.zeros(3), PulseBatch.none(6))
    text = dict(zip(log.column("event", "kind"), log.column("event", "text"), strict=True))
    assert text["possibly two"].startswith(f"{name} {FINDING.id} ")
    assert text["dropped"].startswith(f"{name} {FINDING.id} ")


def test_covariance_of_a_finding_includes_that_of_the_frame() -> None:
    locator = FixedLocator()
    locator.findings = (FINDING,)
    log, tracker = tracker_of(locator)
    root = np.array([[0.2, 0.0, 0.0], [0.1, 0.3, 0.0], [0.0, 0.01, 0.02]])
    for variance in (0.0, 1.0, 1.0, 0.25):
        frame = FrameEstimate(np.array([9.0, 5.0]), np.zeros(3), variance * root @ root.T, POSE_ERROR)
        tracker.track(0.1, np.zeros(3), PulseBatch.none(6), frame)
    off_x, off_y = FINDING.position_m[:2] - frame.pivot_m
    jacobian = np.array([[1.0, 0.0, -off_y], [0.0, 1.0, off_x]])  # of a small rotation about the pivot
    added = log.column("finding", "covariance_m2") - FINDING.covariance_m2
    expected = jacobian @ root @ root.T @ jacobian.T
    np.testing.assert_allclose(added[:, :2, :2], [0.0 * expected, expected, 0.25 * expected], atol=1e-12)
    assert not added[:, 2].any()
    assert tracker.findings[0].covariance_m2[0, 0] > FINDING.covariance_m2[0, 0]


def test_pose_error_that_the_scans_show_is_used() -> None:
    """Bearings have a larger deviation by that of the heading, and the Locator is given the error."""
    locator, worse = Locator(ARRAY, POSE_ERROR), replace(POSE_ERROR, position_m=0.1, heading_rad=0.03)
    log, tracker = tracker_of(locator)
    strengths = MANIFOLD.gain(np.array([0.3])).T
    pulses = PulseBatch.detected(np.zeros(1), strengths, np.full((1, 6), 1e-6))._replace(std_rad=np.array([0.01]))
    for pose_error in (POSE_ERROR, worse):
        frame = FrameEstimate(np.zeros(2), np.zeros(3), np.zeros((3, 3)), pose_error)
        tracker.track(0.1, np.zeros(3), pulses, frame)
        assert locator.pose_error == pose_error
    before, after = np.square(log.column("bearing", "total_std_rad"))
    assert after - before == pytest.approx(0.03**2 - 0.01**2)


def test_weak_and_clipped_pulses_are_not_used() -> None:
    """A pulse that is clipped in a channel of no use is kept."""
    locator = FixedLocator()
    log, tracker = tracker_of(locator)
    strengths = np.tile(MANIFOLD.gain(np.array([0.3])).T, (4, 1))
    is_clipped, is_usable = np.zeros((4, 6), bool), np.ones((4, 6), bool)
    is_clipped[2:, 1], is_usable[3, 1] = True, False
    pulses = PulseBatch.detected(np.zeros(4), strengths, np.full((4, 6), 1e-6))._replace(
        std_rad=np.radians([24.0, 26.0, 1.0, 1.0]), is_clipped=is_clipped, is_usable=is_usable
    )
    tracker.track(0.1, np.zeros(3), pulses)
    assert log.column("pulse", "is_used").tolist() == [True, False, False, True]
    assert log.column("bearing", "pulse").tolist() == [0, 3]
    np.testing.assert_array_equal(locator.given.std_rad, np.radians([24.0, 1.0]))


@pytest.mark.whole
def test_each_used_pulse_has_an_association() -> None:
    log = run_mission(load_scenario("two_sources", {"task.time_limit_s": 40.0}), seed=5)
    np.testing.assert_array_equal(log.column("association", "pulse"), log.column("bearing", "pulse"))
    np.testing.assert_array_equal(log.column("bearing", "pulse"), np.flatnonzero(log.column("pulse", "is_used")))
    alive = log.column("finding", "id")[log.column("finding", "step") == log.column("finding", "step")[-1]]
    assert alive.size > 0
    assert set(log.column("association", "finding").tolist()) <= {0, *alive.tolist()}
    owned = (log.column("association", "finding") > 0).mean()
    assert owned > 0.3


@pytest.mark.whole
def test_report_says_that_poses_are_worse_than_believed() -> None:
    believed = load_scenario("one_source", {"task.time_limit_s": 60.0})
    doubled = {"position_std_m": 0.1, "heading_std_deg": 1.0}
    worse = Scenario.model_validate(believed.model_dump() | {"nature": {"pose_sensor": doubled}})
    for scenario, least in ((believed, 0), (worse, 1)):
        log = run_mission(scenario, seed=2)
        assert sum("worse poses than believed" in note for note in make_report(log, 0.0).notes) == least
    heading_rad = log.column("frame", "pose_std")[-1, 1]
    assert heading_rad > 1.5 * believed.pose_sensor.pose_error.heading_rad


def test_total_deviation_exceeds_that_of_noise_and_heading() -> None:
    bearing = run_mission(load_scenario("two_sources", {"task.time_limit_s": 10.0}), seed=5).table("bearing")
    least_rad = np.hypot(bearing["std_rad"], np.radians(2.0))  # an array with 5 % of gain error, and 0.5 deg of heading
    assert bearing["pulse"].size > 50
    assert np.all(bearing["total_std_rad"] > least_rad)
