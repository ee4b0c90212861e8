"""Tracker and logbook."""

from dataclasses import replace

import numpy as np

from dirmusic import ArrayModel, ElementSpread, Finding, GainManifold, PulseBatch
from dirmusic.locating.association import Unassociated
from pdpatrol.envs import load_scenario
from pdpatrol.missions.record.logbook import Logbook
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.tracking import Tracked
from pdpatrol.missions.runner import run_mission

MANIFOLD = GainManifold.ring(6)
ARRAY = ArrayModel(manifold=MANIFOLD, positions_m=np.zeros((6, 3)), spread=ElementSpread(gain=0.05))
POSE = np.zeros(3)
FINDING = Finding(
    id=3, state="candidate", position_m=np.array([1.0, 2.0, 1.5]), covariance_m2=np.eye(3), n_bearings=1,
    first_detected_s=0.0, last_detected_s=0.0, confirmed_s=None, aperture_rad=0.0, nearest_m=1.0, level_db=0.0,
)  # fmt: skip


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
    np.testing.assert_array_equal(log.column("bearing", "pulse"), np.flatnonzero(log.column("pulse", "is_credible")))
    alive = log.column("finding", "id")[log.column("finding", "step") == log.column("finding", "step")[-1]]
    assert alive.size > 0
    assert set(log.column("association", "finding").tolist()) <= {*alive.tolist(), *Unassociated}
    owned = (log.column("association", "finding") > 0).mean()
    assert owned > 0.3
