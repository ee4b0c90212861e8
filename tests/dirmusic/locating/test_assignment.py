"""Which pulse belongs to which finding: direction, strength over range, and what the map obstructs."""

import numpy as np
import pytest

from dirmusic import ArrayModel, GainManifold
from dirmusic.array.element_errors import ElementErrors, ElementSpread
from dirmusic.locating.association.assignment import NoOwner, assign
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


def finding(x: float, y: float, state: str = "confirmed") -> Finding:
    return Finding(
        id=1,
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


def assigned(
    findings: list[Finding], *, bearing_deg: float, excess_db: float, range_m: float, in_sight: bool = True
) -> int:
    """Owner of pulses detected at the origin from one direction, so far above what `LEVEL_DB` at a range would give."""

    def the_map(points: np.ndarray, target: np.ndarray, ignore_m: float) -> np.ndarray:
        return np.full(len(points), float(in_sight))

    sight: Sight = the_map
    record = PulseRecord(ARRAY, POSE_ERROR, sight)
    azimuth = np.full(5, np.radians(bearing_deg))
    gain = NOMINAL.gain(azimuth).T
    strengths = gain / np.linalg.norm(gain, axis=-1, keepdims=True)
    strengths *= 10 ** ((LEVEL_DB + excess_db) / 20) / range_m
    pulses = PulseBatch.detected(np.zeros(5), strengths, np.full((5, 6), 1e-12))
    record.add(0.0, np.zeros(3), pulses._replace(azimuth_rad=azimuth, std_rad=np.full(5, np.radians(0.3))))
    owner = assign(record, findings, NO_ERRORS, AssignmentRules()).owner
    assert (owner == owner[0]).all()
    return int(owner[0])


def test_a_pulse_belongs_to_the_finding_that_it_points_to_and_to_none_in_another_direction() -> None:
    west_and_north = [finding(-8.0, 0.0), finding(0.0, 8.0)]
    assert assigned(west_and_north, bearing_deg=180.0, excess_db=0.0, range_m=8.0) == 0
    assert assigned(west_and_north, bearing_deg=90.0, excess_db=0.0, range_m=8.0) == 1
    assert assigned(west_and_north, bearing_deg=-45.0, excess_db=0.0, range_m=8.0) == UNASSIGNED


def test_a_pulse_that_two_findings_in_one_direction_explain_belongs_to_neither() -> None:
    behind_each_other = [finding(8.0, 0.0), finding(10.0, 0.0)]
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
