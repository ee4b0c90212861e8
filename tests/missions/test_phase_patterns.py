"""Phase-resolved patterns of findings."""

import numpy as np
import pytest

from dirmusic import GainManifold
from dirmusic.angles import wrap
from dirmusic.locating.association import Unassociated
from pdpatrol.missions.record.finding_pulses import phase_patterns
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.sensing import PulseTrain
from tests.missions.replay.short_mission import copy_of
from tests.missions.steps import append_step

SOURCES = {1: ("corona", (10.0, 10.0)), 2: ("void", (0.0, 12.0))}


def log_of_two_findings(seed: int, mains: bool = True, ghosts_every: int = 0) -> MissionLog:
    """Return the log of a drive past a corona and a void, with all pulses associated."""
    rng = np.random.default_rng(seed)
    ring = GainManifold.ring(6)
    log = MissionLog(
        {
            "name": "two", "seed": 0, "policy": "seek", "n_elements": 6,
            "array": {"boresights_rad": ring.boresights_rad.tolist(), "positions_m": np.zeros((6, 3)).tolist()},
        }
    )  # fmt: skip
    trains = {k: PulseTrain.of_kind(kind, 50.0, 0.0, rng) for k, (kind, _) in SOURCES.items()}  # pyright: ignore
    for step in range(60):
        pose = np.array([0.1 * step, 2.0, 0.03 * step])
        append_step(log, 0.1 * step, pose)
        for number, (_, place) in SOURCES.items():
            sight = np.array(place) - pose[:2]
            azimuth = float(wrap(np.arctan2(sight[1], sight[0]) - pose[2]))
            _, times, amplitudes = trains[number].times(20.0).draw(0.1 * step, 0.1, rng)
            for time_s, amplitude in zip(times, amplitudes, strict=True):
                strengths = abs(amplitude) * number / np.hypot(*sight) * ring.gain(azimuth)
                phase = 2 * np.pi * 50.0 * time_s if mains else np.nan
                pulse = log.append(
                    "pulse", step=step, strengths_v=strengths, mains_phase_rad=phase, is_clipped=False, is_credible=True
                )
                log.append(
                    "bearing", pulse=pulse, azimuth_rad=azimuth,
                    bearing_rad=wrap(azimuth + pose[2]), std_rad=0.02,
                )  # fmt: skip
                is_ghost = ghosts_every > 0 and pulse % ghosts_every == 0
                log.append("association", pulse=pulse, finding=Unassociated.ECHO if is_ghost else number)
    for number, (_, place) in SOURCES.items():
        log.append(
            "finding", step=59, id=number, position_m=np.array([*place, 0.6]), covariance_m2=0.01 * np.eye(3),
            state="confirmed", n_bearings=100, first_detected_s=0.0, confirmed_s=1.0, aperture_rad=1.0,
        )  # fmt: skip
    return log


def test_patterns_hold_pulses_and_levels_of_their_finding() -> None:
    patterns = phase_patterns(log_of_two_findings(1))
    assert set(patterns) == {1, 2}
    for number, (pulses, pattern) in patterns.items():
        assert pattern.kind == SOURCES[number][0]
        assert 70 < pulses.phase_rad.size < 180
        assert np.median(pulses.level_db) == pytest.approx(20 * np.log10(number), abs=2.0)
    assert np.std(patterns[1][0].level_db) < 1.5  # corona: equal pulses from near and far


def test_patterns_exclude_unassociated_pulses() -> None:
    whole, half = (phase_patterns(log_of_two_findings(2, ghosts_every=every)) for every in (0, 2))
    for number in SOURCES:
        assert half[number][0].time_s.size == pytest.approx(whole[number][0].time_s.size / 2, abs=20)


def test_killed_mission_has_no_patterns() -> None:
    assert phase_patterns(copy_of(log_of_two_findings(2), "step", "pulse", "bearing", "finding")) == {}


def test_report_states_kind_of_discharge() -> None:
    report = make_report(log_of_two_findings(3), 1.0)
    for finding, (kind, _) in zip(report.findings, SOURCES.values(), strict=True):
        discharge, strength = finding.discharge, finding.strength
        assert discharge is not None
        assert strength is not None
        assert discharge.kind == kind
        assert 0.5 < discharge.confidence <= 1.0
        counts = np.array(discharge.counts)
        assert counts.shape[1] * discharge.phase_step_deg == 360.0
        assert counts.sum() == strength.n_pulses
    without = make_report(log_of_two_findings(3, mains=False), 1.0)
    assert [finding.discharge for finding in without.findings] == [None, None]
