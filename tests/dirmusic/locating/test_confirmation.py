"""States of findings according to their detections: missing pulses count only where the finding is in sight."""

from dataclasses import replace

import numpy as np
import pytest

from dirmusic.angles import wrap
from dirmusic.locating.association import Assigner
from dirmusic.locating.confirmation import disagreement, updated_state
from dirmusic.locating.finding import Finding
from dirmusic.locating.rules import LocatingRules
from tests.dirmusic.scenes import (
    ARRAY,
    LEVEL_DB,
    NO_ERRORS,
    make_finding,
    pulses_from,
    record_of,
    uniform_sight,
)

RULES = LocatingRules()
WEAK_DB = -RULES.assignment.obstruction_db - 5.0
FAR_M, NEAR_M = 10.0, 4.0
CANDIDATE = make_finding(covariance_m2=0.05 * np.eye(3), n_bearings=20, nearest_m=FAR_M)


def judged(
    *detections: tuple[float, float, float, float], finding: Finding = CANDIDATE, transmission: float = 1.0
) -> Finding:
    """Return a finding at the origin with its state after pulses that are detected from the west, one per second.

    Args:
        detections: Number of seconds, range, level above `LEVEL_DB` at that range, and bearing in degrees.
        finding: The finding before.
        transmission: Transmission from everywhere according to the map.
    """
    batches, time_s = [], 0.0
    for n_seconds, range_m, excess_db, bearing_deg in detections:
        pulses = pulses_from(np.radians([bearing_deg]), 10 ** ((LEVEL_DB + excess_db) / 20) / range_m)
        for _ in range(int(n_seconds)):
            batches.append((time_s, [-range_m, 0.0, 0.0], pulses))
            time_s += 1.0
    record = record_of(*batches, sight=uniform_sight(transmission))
    assignment = Assigner(record, RULES.assignment).assign([finding], NO_ERRORS)
    return updated_state(finding, 0, assignment, record, NO_ERRORS, RULES, None, time_s)


@pytest.mark.parametrize(("excess_db", "bearing_deg", "state"), [(WEAK_DB, 0.0, "candidate"), (0.0, 90.0, "ghost")])
def test_candidate_is_a_ghost_if_only_others_are_detected(excess_db: float, bearing_deg: float, state: str) -> None:
    near = 2 * RULES.ghost_silent_s, NEAR_M, excess_db, bearing_deg
    assert judged((40, FAR_M, 0.0, 0.0), near).state == state


@pytest.mark.parametrize(("n_weak", "excess_db"), [(30, 0.0), (200, WEAK_DB)])
def test_candidate_level_follows_the_majority_of_pulses(n_weak: int, excess_db: float) -> None:
    far = 40, FAR_M, 0.0, 0.0
    before_db, after_db = judged(far).level_db, judged(far, (n_weak, NEAR_M, WEAK_DB, 0.0)).level_db
    assert after_db == pytest.approx(before_db + excess_db, abs=0.1)


def test_detected_finding_stays_confirmed_out_of_sight() -> None:
    confirmed = replace(CANDIDATE, state="confirmed")
    assert judged((40, NEAR_M, 0.0, 0.0), finding=confirmed, transmission=0.0).state == "confirmed"


NOISE_RAD = np.radians(7.0)


def disagreement_of(wandering_rad: float, seed: int, n_pulses: int = 15) -> float:
    """Return the disagreement of weak pulses from forty places, with another bearing error at each place."""
    rng = np.random.default_rng(seed)
    detections = []
    for k, angle in enumerate(np.linspace(0.0, 5.0, 40)):
        place, yaw = 5.0 * np.array([np.cos(angle), np.sin(angle)]), rng.uniform(-np.pi, np.pi)
        off = rng.normal(0.0, wandering_rad) + rng.normal(0.0, NOISE_RAD, n_pulses)
        pulses = pulses_from(wrap(angle + np.pi - yaw + off), 1.0)._replace(std_rad=np.full(n_pulses, NOISE_RAD))
        detections.append((float(k), [*place, yaw], pulses))
    record = record_of(*detections, array=replace(ARRAY, positions_m=np.zeros((6, 3))))
    return disagreement(record, np.arange(record.pulses.n_pulses), CANDIDATE, NO_ERRORS)


def test_disagreement_of_one_source_is_one_and_of_wandering_bearings_large() -> None:
    assert np.mean([disagreement_of(0.0, seed, 1) for seed in range(5)]) == pytest.approx(1.0, abs=0.2)
    assert np.mean([disagreement_of(0.0, seed) for seed in range(5)]) < 1.0  # array and pose have no errors here
    assert min(disagreement_of(1.2 * NOISE_RAD, seed) for seed in range(5)) > 1.5
