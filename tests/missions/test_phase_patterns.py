"""Phase-resolved patterns of findings."""

import math

import numpy as np
import pytest

from pdpatrol.envs import load_scenario
from pdpatrol.missions.record.finding_pulses import phase_patterns
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.runner import run_mission
from tests.missions.campaign.surveys import SurveyedSource, along, survey
from tests.missions.replay.short_mission import copy_of

KINDS = {1: "corona", 2: "void"}


def log_of_two_findings(seed: int, mains_hz: float = 50.0, unexplained_every: int = 0) -> MissionLog:
    """Return the log of a drive past a corona and a void twice as strong, with all pulses associated."""
    sources = SurveyedSource((10.0, 10.0, 0.6), kind="corona"), SurveyedSource((0.0, 12.0, 0.6), 6.02, kind="void")
    poses = along((0.0, 2.0), (6.0, 2.0), speed_mps=1.0)
    return survey(poses, *sources, seed=seed, mains_hz=mains_hz, unexplained_every=unexplained_every)


def test_patterns_hold_pulses_and_levels_of_their_finding() -> None:
    patterns, offset_hz = phase_patterns(log_of_two_findings(1))
    assert offset_hz == 0.0
    assert set(patterns) == {1, 2}
    for number, (pulses, pattern) in patterns.items():
        assert pattern.kind == KINDS[number]
        assert 70 < pulses.phase_rad.size < 180
        assert np.median(pulses.level_db) == pytest.approx(20 * np.log10(number), abs=2.0)
    assert np.std(patterns[1][0].level_db) < 1.5  # corona: equal pulses from near and far


def test_patterns_exclude_unassociated_pulses() -> None:
    whole, half = (phase_patterns(log_of_two_findings(2, unexplained_every=every))[0] for every in (0, 2))
    for number in KINDS:
        assert half[number][0].time_s.size == pytest.approx(whole[number][0].time_s.size / 2, abs=20)


@pytest.mark.parametrize("offset_hz", [0.02, -0.1])
def test_offset_of_the_mains_is_reported_and_corrected(offset_hz: float) -> None:
    """A receiver that believes in 50 Hz recognises the kinds of discharge at another frequency."""
    log = log_of_two_findings(4, mains_hz=50.0 - offset_hz)
    report = make_report(log, 1.0)
    assert [finding.discharge and finding.discharge.kind for finding in report.findings] == list(KINDS.values())
    (note,) = report.notes
    assert float(note.split()[2]) == pytest.approx(offset_hz, abs=0.006)  # the drive takes 6 s


@pytest.mark.whole
def test_mission_with_an_unlocked_clock_states_offset_and_kinds() -> None:
    settings = {"nature.receiver.mains_offset_hz": 0.02}
    report = make_report(run_mission(load_scenario("two_sources", settings), "seek", 5000), 1.0)
    kinds = {finding.discharge.kind for finding in report.findings if finding.discharge}
    assert kinds == {"surface", "floating"}
    assert [float(note.split()[2]) for note in report.notes] == [pytest.approx(0.02, abs=0.002)]


def test_killed_mission_has_no_patterns() -> None:
    assert phase_patterns(copy_of(log_of_two_findings(2), "step", "pulse", "bearing", "finding")) == ({}, 0.0)


def test_report_states_kind_of_discharge() -> None:
    report = make_report(log_of_two_findings(3), 1.0)
    for finding, kind in zip(report.findings, KINDS.values(), strict=True):
        discharge, strength = finding.discharge, finding.strength
        assert discharge is not None
        assert strength is not None
        assert discharge.kind == kind
        assert 0.5 < discharge.confidence <= 1.0
        counts = np.array(discharge.counts)
        assert counts.shape[1] * discharge.phase_step_deg == 360.0
        assert counts.sum() == strength.n_pulses
    without = make_report(log_of_two_findings(3, mains_hz=math.nan), 1.0)
    assert [finding.discharge for finding in without.findings] == [None, None]
