"""Association of pulses with findings: direction, strength over range, map, multipath and mains phase."""

from dataclasses import replace

import numpy as np
import pytest

from dirmusic.array.element_errors import ElementErrors
from dirmusic.arrays import FloatArray
from dirmusic.locating.association import Assigner, Unassociated, may_share_phase, too_many_for_multipath
from dirmusic.locating.finding import Finding, State
from dirmusic.locating.locator import rows_of_candidate
from dirmusic.locating.plane_wave import bearing_error_table
from dirmusic.locating.pulse_record import PulsesAtPose
from dirmusic.locating.rules import AssignmentRules, LocatingRules
from dirmusic.pulses.batch import PulseBatch
from tests.dirmusic.scenes import (
    LEVEL_DB,
    NO_ERRORS,
    RING,
    SMALL_ARRAY,
    detected,
    make_finding,
    owners,
    pulses_from,
    record_of,
    uniform_sight,
    with_bearings,
)

UNASSIGNED, AMBIGUOUS, BIASED, DIFFRACTED, ECHO = Unassociated


def finding(x: float, y: float, state: State = "confirmed", number: int = 1) -> Finding:
    return make_finding(id=number, state=state, position_m=np.array([x, y, 0.0]), confirmed_s=0.0)


AHEAD = finding(8.0, 0.0)


def strengths_at(range_m: float, excess_db: float = 0.0) -> float:
    """Return the strength of a pulse `excess_db` above `LEVEL_DB` at a range."""
    return 10 ** ((LEVEL_DB + excess_db) / 20) / range_m


def assigned(
    findings: list[Finding], *, bearing_deg: float, excess_db: float = 0.0, range_m: float = 8.0, in_sight: bool = True
) -> int:
    """Return the finding of pulses at the origin, `excess_db` above `LEVEL_DB` at a range."""
    pulses = pulses_from(np.full(5, np.radians(bearing_deg)), strengths_at(range_m, excess_db))
    owner = owners(record_of((0.0, np.zeros(3), pulses), sight=uniform_sight(float(in_sight))), findings)
    assert (owner == owner[0]).all()
    return int(owner[0])


def test_pulse_belongs_to_the_finding_it_points_to() -> None:
    west_and_north = [finding(-8.0, 0.0), finding(0.0, 8.0, number=2)]
    assert assigned(west_and_north, bearing_deg=180.0) == 0
    assert assigned(west_and_north, bearing_deg=90.0) == 1
    assert assigned(west_and_north, bearing_deg=-45.0) == UNASSIGNED


def test_pulse_of_two_aligned_findings_is_ambiguous() -> None:
    assert assigned([AHEAD, finding(10.0, 0.0, number=2)], bearing_deg=0.0, range_m=9.0) == AMBIGUOUS


def test_vague_candidate_takes_no_pulse_of_a_known_one() -> None:
    known = finding(8.0, 0.0, "candidate")
    vague = replace(finding(9.0, 1.0, "candidate", number=2), covariance_m2=np.diag([25.0, 25.0, 1.0]))
    assert assigned([known, vague], bearing_deg=0.0) == 0
    assert assigned([known, vague], bearing_deg=15.0) == 1
    assert assigned([AHEAD, vague], bearing_deg=0.0) == AMBIGUOUS


def test_pulse_too_weak_for_its_range_is_diffracted() -> None:
    assert assigned([AHEAD], bearing_deg=0.0, excess_db=-11.0) == DIFFRACTED
    assert assigned([AHEAD], bearing_deg=0.0, excess_db=-6.0) == 0


@pytest.mark.parametrize("bearing_deg", [60.0, -120.0])
def test_pulses_of_obstructed_finding_are_multipath(bearing_deg: float) -> None:
    assert assigned([AHEAD], bearing_deg=bearing_deg, in_sight=False) == ECHO
    assert assigned([AHEAD], bearing_deg=bearing_deg, excess_db=6.0, in_sight=False) == UNASSIGNED
    assert assigned([AHEAD], bearing_deg=bearing_deg) == UNASSIGNED
    assert assigned([finding(8.0, 0.0, "candidate")], bearing_deg=bearing_deg, in_sight=False) == UNASSIGNED


def test_strong_pulse_next_to_a_finding_is_biased() -> None:
    assert assigned([AHEAD], bearing_deg=15.0) == BIASED
    assert assigned([AHEAD], bearing_deg=15.0, excess_db=-8.0) == UNASSIGNED


@pytest.mark.parametrize(("n_own", "code"), [(0, BIASED), (40, UNASSIGNED)])
def test_biased_pulses_are_no_more_than_those_missing(n_own: int, code: Unassociated) -> None:
    """40 pulses a window point past a finding that is detected `n_own` times instead of 40."""
    detections = []
    for window in range(12):
        past = 40 if window >= 6 else 0
        azimuth = np.repeat([0.0, np.radians(15.0)], [n_own if past else 40, past])
        detections.append((5.0 * window + 1.0, np.zeros(3), pulses_from(azimuth, strengths_at(8.0))))
    record = record_of(*detections)
    assert (owners(record, [AHEAD])[record.pulses.azimuth_rad > 0.1] == code).all()


def test_assignment_in_steps_equals_assignment_at_once() -> None:
    rng = np.random.default_rng(11)
    findings = [AHEAD, finding(-3.0, 6.0, number=2), finding(4.0, 4.0, "candidate", number=3)]
    record = record_of()
    bit_by_bit = Assigner(record, AssignmentRules())
    for step in range(200):
        pose = np.array([0.02 * step, 0.01 * step, 0.03 * step])
        aim = findings[rng.integers(3)].position_m[:2] - pose[:2]
        azimuth = np.arctan2(aim[1], aim[0]) - pose[2] + rng.normal(0.0, np.radians(4.0), 4)
        pulses = pulses_from(azimuth, 10 ** (rng.normal(LEVEL_DB, 6.0, 4) / 20) / np.hypot(*aim))
        record.extend([PulsesAtPose(0.3 * step, pose, pulses)])
        if rng.random() < 0.5:
            little_by_little = bit_by_bit.assign(findings, NO_ERRORS)
    little_by_little = bit_by_bit.assign(findings, NO_ERRORS)
    at_once = Assigner(record, AssignmentRules()).assign(findings, NO_ERRORS)
    assert np.unique(at_once.finding).size > 4
    for in_steps, whole in zip(little_by_little[:3], at_once[:3], strict=True):
        np.testing.assert_array_equal(in_steps, whole)


def test_changed_finding_or_array_changes_assignment() -> None:
    record = record_of((0.0, np.zeros(3), pulses_from(np.zeros(5), strengths_at(8.0))))
    assigner = Assigner(record, AssignmentRules())
    turned = bearing_error_table(RING, replace(ElementErrors.none(6), pointing_rad=np.full(6, np.radians(30.0))))
    for y_m, errors, code in (
        (0.0, NO_ERRORS, 0),
        (8.0, NO_ERRORS, UNASSIGNED),
        (0.0, NO_ERRORS, 0),
        (0.0, turned, UNASSIGNED),
    ):
        assert (assigner.assign([finding(8.0, y_m)], errors).finding == code).all()


def bearings_from_above(azimuth: np.ndarray, elevation_rad: float) -> PulseBatch:
    """Make strong pulses from one elevation, with the bearings that are estimated from them in the plane."""
    off = azimuth[:, np.newaxis] - RING.boresights_rad
    strengths = RING.response_in_space(off, np.full((azimuth.size, 1), elevation_rad)).gain
    return with_bearings(detected(strengths, 1e-4), SMALL_ARRAY)


@pytest.mark.parametrize("elevation_deg", [10.0, 30.0, 45.0, 60.0, 70.0])
def test_bearings_off_the_plane_belong_to_the_finding_above(elevation_deg: float) -> None:
    elevation = np.radians(elevation_deg)
    for azimuth in np.radians(np.arange(3.0, 360.0, 17.0)):
        place_m = 4.0 / np.tan(elevation) * np.array([np.cos(azimuth), np.sin(azimuth), np.tan(elevation)])
        above = make_finding(position_m=place_m, level_db=np.nan)
        record = record_of((0.0, np.zeros(3), bearings_from_above(np.array([azimuth]), elevation)))
        assert owners(record, [above]).tolist() == [0]


def test_pulse_from_above_initiates_only_the_first_candidate() -> None:
    azimuth = np.zeros(20)
    from_above = bearings_from_above(azimuth, np.radians(60.0))._replace(azimuth_rad=azimuth)
    record = record_of((0.0, np.zeros(3), from_above))
    unassigned = owners(record, [replace(finding(8.0, 0.0, "candidate"), level_db=np.nan)]) == UNASSIGNED
    assert unassigned.all()
    for is_first in (False, True):
        rows = rows_of_candidate(record, unassigned, NO_ERRORS, LocatingRules(), 0.0, is_first=is_first)
        assert rows.size == (20 if is_first else 0)
    level = record_of((0.0, np.zeros(3), bearings_from_above(azimuth, 0.0)))
    assert rows_of_candidate(level, unassigned, NO_ERRORS, LocatingRules(), 0.0, is_first=False).size == 20


@pytest.mark.parametrize("is_detected", [True, False])
def test_multipath_is_limited_by_missing_direct_pulses(is_detected: bool) -> None:
    wall_db, detections = -6.0, []
    for second in range(40):
        bearings = [0.0] if second < 20 else [0.0, 0.5 * np.pi] if is_detected else [0.5 * np.pi]
        pulses = pulses_from(np.repeat(bearings, 20), strengths_at(8.0, wall_db))
        detections.append((float(second), np.zeros(3), pulses))
    record = record_of(*detections, sight=uniform_sight(10 ** (wall_db / 20)))
    owner = owners(record, [AHEAD])
    assert (owner[record.pulses.azimuth_rad > 1.0] == (UNASSIGNED if is_detected else ECHO)).all()


def test_source_of_unknown_rate_may_have_any_multipath() -> None:
    suspects, nobody = np.ones(50, dtype=np.bool_), np.full(50, -1)
    assert not too_many_for_multipath(np.zeros(50), np.zeros(50), suspects, nobody, 1).any()


@pytest.mark.parametrize(("n_missing", "most"), [(0, 3), (3, 9), (8, 17)])
def test_multipath_is_limited_to_three_poisson_deviations(n_missing: int, most: int) -> None:
    """N > b + 3 sqrt(b + 1) with b pulses missing."""
    for n_echoes in (most, most + 1):
        n_direct = 20 - n_missing
        time_s = np.concatenate([np.repeat([2.0, 7.0, 12.0], 20), np.full(n_direct + n_echoes, 17.0)])
        is_suspect = np.arange(time_s.size) >= 60 + n_direct
        bearing_rad, owner = np.where(is_suspect, 1.2, 0.0), np.where(is_suspect, -1, 0)
        too_many = too_many_for_multipath(time_s, bearing_rad, is_suspect, owner, 1)
        np.testing.assert_array_equal(too_many, is_suspect & (n_echoes > most))


N_SURE = 600


def corona(rng: np.random.Generator, n: int, at_deg: float | FloatArray) -> FloatArray:
    return np.mod(np.radians(rng.normal(at_deg, 14.0, n)), 2 * np.pi)


def phases_of(kind: str, rng: np.random.Generator, n: int, at_deg: float | FloatArray) -> FloatArray:
    if kind == "any":
        return rng.uniform(0.0, 2 * np.pi, n)
    return corona(rng, n, at_deg) if kind == "corona" else np.full(n, np.nan)


@pytest.mark.parametrize("kind", ["corona", "any", "unknown"])
def test_mains_phase_separates_aligned_findings(kind: str) -> None:
    """The robot views two findings from the side and then in line; uniform or unknown phases do not separate them."""
    rng = np.random.default_rng(0)
    findings = [AHEAD, finding(11.0, 0.0, number=2)]
    detections = []
    for k, at_deg in enumerate((270.0, 150.0)):
        pose = np.array([9.5, -4.0, 0.0])
        sight_m = findings[k].position_m[:2] - pose[:2]
        pulses = pulses_from(np.full(N_SURE, np.arctan2(sight_m[1], sight_m[0])), strengths_at(np.hypot(*sight_m)))
        detections.append((10.0 * k, pose, pulses._replace(mains_phase_rad=phases_of(kind, rng, N_SURE, at_deg))))
    mains_phase_rad = phases_of(kind, rng, 100, np.repeat([270.0, 150.0], 50))
    aligned = pulses_from(np.zeros(100), strengths_at(9.5))._replace(mains_phase_rad=mains_phase_rad)
    owner = owners(record_of(*detections, (20.0, np.zeros(3), aligned)), findings)
    assert (owner[:N_SURE] == 0).all()
    assert (owner[N_SURE:-100] == 1).all()
    last = owner[-100:]
    if kind == "corona":
        assert (last == np.repeat([0, 1], 50))[last >= 0].all()
        assert (last >= 0).mean() > 0.9
    else:
        assert (last == AMBIGUOUS).all()


@pytest.mark.parametrize(("at_deg", "code"), [(270.0, ECHO), (90.0, UNASSIGNED)])
def test_multipath_has_the_phase_of_its_source(at_deg: float, code: Unassociated) -> None:
    def only_from_the_south(points_m: FloatArray, target_m: FloatArray, within_m: float) -> FloatArray:
        return (points_m[:, 1] < -2.0).astype(np.float64)

    rng = np.random.default_rng(2)
    before = pulses_from(np.full(N_SURE, np.pi / 2), strengths_at(8.0))
    before = before._replace(mains_phase_rad=corona(rng, N_SURE, 270.0))
    later = pulses_from(np.full(20, np.radians(60.0)), strengths_at(8.0))
    later = later._replace(mains_phase_rad=corona(rng, 20, at_deg))
    detections = (0.0, [8.0, -8.0, 0.0], before), (20.0, np.zeros(3), later)
    owner = owners(record_of(*detections, sight=only_from_the_south), [AHEAD])
    assert (owner[:N_SURE] == 0).all()
    assert (owner[N_SURE:] == code).all()


def test_few_or_uniform_phases_exclude_nothing() -> None:
    rng = np.random.default_rng(3)
    for n in (10, 100, 210, 300, 1000, 5000):
        phase_rad = rng.uniform(0.0, 2 * np.pi, n)
        assert may_share_phase(phase_rad, np.zeros(n, dtype=np.intp), 1).all()
    for n, is_shared in ((200, True), (400, False)):
        phase_rad, owner = np.append(corona(rng, n, 270.0), 0.5 * np.pi), np.append(np.zeros(n, dtype=np.intp), -1)
        may_share = may_share_phase(phase_rad, owner, 1)
        assert may_share.all() == may_share[0, -1] == is_shared
