"""The phase of the mains: what it tells apart, and that it tells nothing where there is nothing to tell."""

import numpy as np
import pytest
from numpy.typing import NDArray

from dirmusic.locating.association import Assigner, Unassociated, may_share_phase
from dirmusic.locating.protocol import LineOfSight
from dirmusic.locating.pulse_record import PulseRecord, PulsesAtPose
from dirmusic.locating.rules import AssignmentRules
from tests.dirmusic.locating.test_assignment import (
    ARRAY,
    LEVEL_DB,
    NO_ERRORS,
    POSE_ERROR,
    finding,
    pulses_from,
)

FloatArray = NDArray[np.float64]
N_SURE = 600


def corona(rng: np.random.Generator, n: int, at_deg: float) -> FloatArray:
    return np.mod(np.radians(rng.normal(at_deg, 14.0, n)), 2 * np.pi)


def phases_of(kind: str, rng: np.random.Generator, n: int) -> FloatArray:
    """Of pulses of two sources, one after the other."""
    if kind == "any":
        return rng.uniform(0.0, 2 * np.pi, n)
    if kind == "unknown":
        return np.full(n, np.nan)
    return np.concatenate([corona(rng, n // 2, 270.0), corona(rng, n - n // 2, 150.0)])


def in_line(kind: str, rng: np.random.Generator) -> NDArray[np.intp]:
    """Owners of pulses of two findings, seen from aside first, and then from where they stand in one line."""
    findings = [finding(8.0, 0.0), finding(11.0, 0.0, number=2)]
    record = PulseRecord(ARRAY, POSE_ERROR, None, AssignmentRules())
    for k, at_deg in enumerate((270.0, 150.0)):
        phase_rad = corona(rng, N_SURE, at_deg) if kind == "corona" else phases_of(kind, rng, N_SURE)
        pose = np.array([9.5, -4.0, 0.0])
        sight_m = findings[k].position_m[:2] - pose[:2]
        azimuth = np.full(N_SURE, np.arctan2(sight_m[1], sight_m[0]))
        strength_v = 10 ** (LEVEL_DB / 20) / np.hypot(*sight_m)
        pulses = pulses_from(azimuth, strength_v)._replace(mains_phase_rad=phase_rad)
        record.extend([PulsesAtPose(10.0 * k, pose, pulses)])
    aligned = pulses_from(np.zeros(100), 10 ** (LEVEL_DB / 20) / 9.5)
    record.extend([PulsesAtPose(20.0, np.zeros(3), aligned._replace(mains_phase_rad=phases_of(kind, rng, 100)))])
    return Assigner(record, AssignmentRules()).assign(findings, NO_ERRORS).finding


def test_of_two_findings_in_one_line_the_phase_tells_whose_a_pulse_is() -> None:
    owner = in_line("corona", np.random.default_rng(0))
    assert (owner[:N_SURE] == 0).all()
    assert (owner[N_SURE:-100] == 1).all()
    told = owner[-100:]
    assert (told == np.repeat([0, 1], 50))[told >= 0].all()
    assert (told >= 0).mean() > 0.9


@pytest.mark.parametrize("kind", ["any", "unknown"])
def test_findings_that_discharge_at_any_phase_are_told_apart_by_none(kind: str) -> None:
    owner = in_line(kind, np.random.default_rng(1))
    assert (owner[:N_SURE] == 0).all()
    assert (owner[N_SURE:-100] == 1).all()
    assert (owner[-100:] == Unassociated.AMBIGUOUS).all()


@pytest.mark.parametrize(("at_deg", "code"), [(270.0, Unassociated.ECHO), (90.0, Unassociated.UNASSIGNED)])
def test_what_comes_at_another_phase_than_a_hidden_finding_is_no_echo_of_it(at_deg: float, code: Unassociated) -> None:
    def only_from_the_south(points_m: FloatArray, target_m: FloatArray, within_m: float) -> FloatArray:
        return (points_m[:, 1] < -2.0).astype(np.float64)

    rng, sight = np.random.default_rng(2), only_from_the_south
    the_map: LineOfSight = sight
    record = PulseRecord(ARRAY, POSE_ERROR, the_map, AssignmentRules())
    before = pulses_from(np.full(N_SURE, np.pi / 2), 10 ** (LEVEL_DB / 20) / 8.0)
    before = before._replace(mains_phase_rad=corona(rng, N_SURE, 270.0))
    record.extend([PulsesAtPose(0.0, np.array([8.0, -8.0, 0.0]), before)])
    later = pulses_from(np.full(20, np.radians(60.0)), 10 ** (LEVEL_DB / 20) / 8.0)
    record.extend([PulsesAtPose(20.0, np.zeros(3), later._replace(mains_phase_rad=corona(rng, 20, at_deg)))])
    owner = Assigner(record, AssignmentRules()).assign([finding(8.0, 0.0)], NO_ERRORS).finding
    assert (owner[:N_SURE] == 0).all()
    assert (owner[N_SURE:] == code).all()


def test_few_pulses_rule_nothing_out_and_no_bin_of_pulses_at_any_phase_is_empty_enough() -> None:
    rng = np.random.default_rng(3)
    for n in (10, 100, 210, 300, 1000, 5000):
        phase_rad = rng.uniform(0.0, 2 * np.pi, n)
        assert may_share_phase(phase_rad, np.zeros(n, dtype=np.intp), 1).all()
    few = np.append(corona(rng, 200, 270.0), np.radians(90.0))
    assert may_share_phase(few, np.append(np.zeros(200, dtype=np.intp), -1), 1).all()
    many = np.append(corona(rng, 400, 270.0), np.radians(90.0))
    assert not may_share_phase(many, np.append(np.zeros(400, dtype=np.intp), -1), 1)[0, -1]
