"""Which pulse belongs to which finding: direction, strength over range, and what the map obstructs."""

import numpy as np
import pytest

from dirmusic import ArrayModel, GainManifold
from dirmusic.array.element_errors import ElementErrors, ElementSpread
from dirmusic.locating.association.assignment import Assigner, NoOwner
from dirmusic.locating.association.pulse_record import PulseRecord
from dirmusic.locating.association.sight_lines import Sight
from dirmusic.locating.finding import Finding
from dirmusic.locating.joint_fix import PoseError
from dirmusic.locating.rules import AssignmentRules
from dirmusic.pulses.batch import PulseBatch

NOMINAL = GainManifold.ring(6)
ARRAY = ArrayModel(
    manifold=NOMINAL, positions_m=np.zeros((6, 3)), spread=ElementSpread(gain=0.01, pointing_rad=np.radians(0.5))
)
NO_ERRORS = ElementErrors.none(6)
POSE_ERROR = PoseError(position_m=0.05, heading_rad=np.radians(0.5), correlation_s=5.0)
LEVEL_DB = -10.0
UNASSIGNED, AMBIGUOUS, GHOST = NoOwner


def finding(x: float, y: float, state: str = "confirmed", number: int = 1) -> Finding:
    return Finding(
        id=number,
        state=state,  # pyright: ignore[reportArgumentType]
        position_m=np.array([x, y, 0.0]),
        covariance_m2=0.01 * np.eye(3),
        n_bearings=100,
        first_detected_s=0.0,
        fixed_s=0.0,
        aperture_rad=1.0,
        nearest_m=3.0,
        level_db=LEVEL_DB,
    )


def pulses_from(azimuth: np.ndarray, strength_v: np.ndarray | float) -> PulseBatch:
    """Pulses from known azimuths (n,) with norms of their strengths, and a deviation of 0.3 degrees."""
    n, gain = azimuth.size, NOMINAL.gain(azimuth)
    strengths = (gain / np.linalg.norm(gain, axis=0) * strength_v).T
    pulses = PulseBatch.detected(np.zeros(n), strengths, np.full((n, 6), 1e-12))
    return pulses._replace(azimuth_rad=azimuth, std_rad=np.full(n, np.radians(0.3)))


def assigned(
    findings: list[Finding], *, bearing_deg: float, excess_db: float, range_m: float, in_sight: bool = True
) -> int:
    """Owner of pulses detected at the origin from one direction, so far above what `LEVEL_DB` at a range would give."""

    def the_map(points: np.ndarray, target: np.ndarray, ignore_m: float) -> np.ndarray:
        return np.full(len(points), float(in_sight))

    sight: Sight = the_map
    record = PulseRecord(ARRAY, POSE_ERROR, sight, AssignmentRules())
    azimuth = np.full(5, np.radians(bearing_deg))
    record.add(0.0, np.zeros(3), pulses_from(azimuth, 10 ** ((LEVEL_DB + excess_db) / 20) / range_m))
    owner = Assigner(record, AssignmentRules()).assign(findings, NO_ERRORS).owner
    assert (owner == owner[0]).all()
    return int(owner[0])


def test_a_pulse_belongs_to_the_finding_that_it_points_to_and_to_none_in_another_direction() -> None:
    west_and_north = [finding(-8.0, 0.0), finding(0.0, 8.0, number=2)]
    assert assigned(west_and_north, bearing_deg=180.0, excess_db=0.0, range_m=8.0) == 0
    assert assigned(west_and_north, bearing_deg=90.0, excess_db=0.0, range_m=8.0) == 1
    assert assigned(west_and_north, bearing_deg=-45.0, excess_db=0.0, range_m=8.0) == UNASSIGNED


def test_a_pulse_that_two_findings_in_one_direction_explain_belongs_to_neither() -> None:
    behind_each_other = [finding(8.0, 0.0), finding(10.0, 0.0, number=2)]
    assert assigned(behind_each_other, bearing_deg=0.0, excess_db=0.0, range_m=9.0) == AMBIGUOUS


def test_a_pulse_ten_decibels_too_weak_for_its_range_is_a_ghost() -> None:
    assert assigned([finding(8.0, 0.0)], bearing_deg=0.0, excess_db=-11.0, range_m=8.0) == GHOST
    assert assigned([finding(8.0, 0.0)], bearing_deg=0.0, excess_db=-6.0, range_m=8.0) == 0


@pytest.mark.parametrize("bearing_deg", [60.0, -120.0])
def test_while_a_confirmed_finding_is_obstructed_pulses_no_louder_than_it_are_its_ghosts_from_any_direction(
    bearing_deg: float,
) -> None:
    obstructed = [finding(8.0, 0.0)]
    assert assigned(obstructed, bearing_deg=bearing_deg, excess_db=0.0, range_m=8.0, in_sight=False) == GHOST
    assert assigned(obstructed, bearing_deg=bearing_deg, excess_db=6.0, range_m=8.0, in_sight=False) == UNASSIGNED
    assert assigned(obstructed, bearing_deg=bearing_deg, excess_db=0.0, range_m=8.0, in_sight=True) == UNASSIGNED
    candidate = [finding(8.0, 0.0, state="candidate")]
    assert assigned(candidate, bearing_deg=bearing_deg, excess_db=0.0, range_m=8.0, in_sight=False) == UNASSIGNED


def test_a_loud_pulse_a_little_past_a_finding_in_sight_is_its_own_biased_by_a_reflection() -> None:
    assert assigned([finding(8.0, 0.0)], bearing_deg=15.0, excess_db=0.0, range_m=8.0) == AMBIGUOUS
    assert assigned([finding(8.0, 0.0)], bearing_deg=15.0, excess_db=-8.0, range_m=8.0) == UNASSIGNED


def test_pulses_that_come_bit_by_bit_are_assigned_as_all_at_once_while_the_findings_stay() -> None:
    rng = np.random.default_rng(11)
    findings = [finding(8.0, 0.0), finding(-3.0, 6.0, number=2), finding(4.0, 4.0, "candidate", number=3)]
    record = PulseRecord(ARRAY, POSE_ERROR, None, AssignmentRules())
    bit_by_bit = Assigner(record, AssignmentRules())
    for step in range(200):
        pose = np.array([0.02 * step, 0.01 * step, 0.03 * step])
        aim = findings[rng.integers(3)].position_m[:2] - pose[:2]
        azimuth = np.arctan2(aim[1], aim[0]) - pose[2] + rng.normal(0.0, np.radians(4.0), 4)
        record.add(0.3 * step, pose, pulses_from(azimuth, 10 ** (rng.normal(LEVEL_DB, 6.0, 4) / 20) / np.hypot(*aim)))
        if rng.random() < 0.5:
            little_by_little = bit_by_bit.assign(findings, NO_ERRORS)
    little_by_little = bit_by_bit.assign(findings, NO_ERRORS)
    at_once = Assigner(record, AssignmentRules()).assign(findings, NO_ERRORS)
    assert np.unique(at_once.owner).size > 4
    np.testing.assert_array_equal(little_by_little.owner, at_once.owner)
    np.testing.assert_array_equal(little_by_little.in_sight, at_once.in_sight)
    np.testing.assert_array_equal(little_by_little.level_db, at_once.level_db)


def test_pulses_are_assigned_anew_by_a_finding_that_has_moved_changed_its_state_or_become_known() -> None:
    pulses = pulses_from(np.full(5, 0.0), 10 ** (LEVEL_DB / 20) / 8.0)
    record = PulseRecord(ARRAY, POSE_ERROR, None, AssignmentRules())
    record.add(0.0, np.zeros(3), pulses)
    assigner = Assigner(record, AssignmentRules())
    assert (assigner.assign([finding(8.0, 0.0)], NO_ERRORS).owner == 0).all()
    assert (assigner.assign([finding(0.0, 8.0)], NO_ERRORS).owner == UNASSIGNED).all()
    assert (assigner.assign([finding(8.0, 0.0)], NO_ERRORS).owner == 0).all()
    turned = ElementErrors(gain=np.zeros(6), pointing_rad=np.full(6, np.radians(30.0)), offset=np.zeros(6))
    assert (assigner.assign([finding(8.0, 0.0)], turned).owner == UNASSIGNED).all()
