"""Whether bearings from many places agree on one as well as their deviations say."""

import numpy as np
import pytest

from dirmusic import ArrayModel, ElementErrors, ElementSpread, Finding, GainManifold, PoseError, PulseBatch
from dirmusic.locating.confirmation import disagreement
from dirmusic.locating.plane_wave import bearing_error_table
from dirmusic.locating.pulse_record import PulseRecord, PulsesAtPose
from dirmusic.locating.rules import AssignmentRules

RING = GainManifold.ring(6)
ARRAY = ArrayModel(
    manifold=RING, positions_m=np.zeros((6, 3)), spread=ElementSpread(gain=0.05, pointing_rad=np.radians(2.0))
)
POSE_ERROR = PoseError(position_m=0.05, heading_rad=np.radians(0.5), correlation_s=5.0)
NOISE_RAD = np.radians(7.0)
FINDING = Finding(
    id=1,
    state="candidate",
    position_m=np.zeros(3),
    covariance_m2=0.01 * np.eye(3),
    n_bearings=100,
    first_detected_s=0.0,
    last_detected_s=0.0,
    confirmed_s=None,
    aperture_rad=1.0,
    nearest_m=3.0,
    level_db=np.nan,
)


def disagreement_of(wandering_rad: float, seed: int, n_pulses: int = 15) -> float:
    """Of weak pulses from forty places round a finding, whose bearings are off by another angle at each place."""
    rng = np.random.default_rng(seed)
    record = PulseRecord(ARRAY, POSE_ERROR, None, AssignmentRules())
    for k, angle in enumerate(np.linspace(0.0, 5.0, 40)):
        place, yaw = 5.0 * np.array([np.cos(angle), np.sin(angle)]), rng.uniform(-np.pi, np.pi)
        off = rng.normal(0.0, wandering_rad) + rng.normal(0.0, NOISE_RAD, n_pulses)
        azimuth = np.mod(angle + np.pi - yaw + off + np.pi, 2 * np.pi) - np.pi
        pulses = PulseBatch.detected(np.zeros(n_pulses), RING.gain(azimuth).T, np.full((n_pulses, 6), 1e-6))
        pulses = pulses._replace(azimuth_rad=azimuth, std_rad=np.full(n_pulses, NOISE_RAD))
        record.extend([PulsesAtPose(float(k), np.array([*place, yaw]), pulses)])
    return disagreement(
        record, np.arange(record.pulses.n_pulses), FINDING, bearing_error_table(RING, ElementErrors.none(6))
    )


def test_bearings_of_a_source_disagree_by_what_they_should_and_pulses_of_one_place_average() -> None:
    assert np.mean([disagreement_of(0.0, seed, 1) for seed in range(5)]) == pytest.approx(1.0, abs=0.2)
    assert np.mean([disagreement_of(0.0, seed) for seed in range(5)]) < 1.0  # of array and pose, no error was drawn


def test_bearings_that_wander_from_place_to_place_disagree_though_each_is_within_its_own_deviation() -> None:
    assert min(disagreement_of(1.2 * NOISE_RAD, seed) for seed in range(5)) > 1.5
