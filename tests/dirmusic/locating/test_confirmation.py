"""What is heard of a finding, and where, makes its state: what does not come is missed only where it is in sight."""

from dataclasses import replace

import numpy as np
import pytest

from dirmusic import ArrayModel, GainManifold
from dirmusic.array.element_errors import ElementErrors, ElementSpread
from dirmusic.locating.association import Assigner
from dirmusic.locating.confirmation import updated_state
from dirmusic.locating.finding import Finding
from dirmusic.locating.plane_wave import bearing_error_table
from dirmusic.locating.protocol import LineOfSight, PoseError
from dirmusic.locating.pulse_record import PulseRecord, PulsesAtPose
from dirmusic.locating.rules import LocatingRules
from dirmusic.pulses.batch import PulseBatch

NOMINAL = GainManifold.ring(6)
ARRAY = ArrayModel(
    manifold=NOMINAL, positions_m=np.zeros((6, 3)), spread=ElementSpread(gain=0.01, pointing_rad=np.radians(0.5))
)
POSE_ERROR = PoseError(position_m=0.05, heading_rad=np.radians(0.5), correlation_s=5.0)
RULES = LocatingRules()
LEVEL_DB = -10.0
WEAK_DB = -RULES.assignment.obstruction_db - 5.0
FAR_M, NEAR_M = 10.0, 4.0
CANDIDATE = Finding(
    id=1, state="candidate", position_m=np.zeros(3), covariance_m2=0.05 * np.eye(3), n_bearings=20,
    first_detected_s=0.0, last_detected_s=0.0, confirmed_s=None, aperture_rad=1.0, nearest_m=FAR_M, level_db=LEVEL_DB,
)  # fmt: skip


def everything_in_sight(points: np.ndarray, target: np.ndarray, ignore_m: float) -> np.ndarray:
    """The map of an empty yard: so it looks from a position that is a little off beside an edge."""
    return np.ones(len(points))


def nothing_in_sight(points: np.ndarray, target: np.ndarray, ignore_m: float) -> np.ndarray:
    """The map of a yard in which equipment hides the place of the finding from everywhere."""
    return np.zeros(len(points))


class Listening:
    """Pulses, one a second, detected from the west of a finding at the origin."""

    def __init__(self, the_map: LineOfSight = everything_in_sight) -> None:
        self.record = PulseRecord(ARRAY, POSE_ERROR, the_map, RULES.assignment)
        self.time_s = 0.0

    def hear(self, n_seconds: int, range_m: float, excess_db: float = 0.0, bearing_deg: float = 0.0) -> None:
        """One direction, and a strength so far above what `LEVEL_DB` gives at that range."""
        azimuth = np.radians([bearing_deg])
        gain = NOMINAL.gain(azimuth)
        norm_v = 10 ** ((LEVEL_DB + excess_db) / 20) / range_m
        for _ in range(n_seconds):
            pulses = PulseBatch.detected(
                np.zeros(1), (gain / np.linalg.norm(gain, axis=0) * norm_v).T, np.full((1, 6), 1e-12)
            )
            pulses = pulses._replace(azimuth_rad=azimuth, std_rad=np.full(1, np.radians(0.3)))
            self.record.extend([PulsesAtPose(self.time_s, np.array([-range_m, 0.0, 0.0]), pulses)])
            self.time_s += 1.0

    def judged(self, finding: Finding = CANDIDATE) -> Finding:
        """The finding in the light of all that was heard."""
        errors = bearing_error_table(NOMINAL, ElementErrors.none(6))
        assignment = Assigner(self.record, RULES.assignment).assign([finding], errors)
        return updated_state(finding, 0, assignment, self.record, errors, RULES, None, self.time_s)


@pytest.mark.parametrize(("excess_db", "bearing_deg", "state"), [(WEAK_DB, 0.0, "candidate"), (0.0, 90.0, "ghost")])
def test_a_candidate_is_hidden_where_its_pulses_are_too_weak_and_a_ghost_where_others_come_without_them(
    excess_db: float, bearing_deg: float, state: str
) -> None:
    listening = Listening()
    listening.hear(40, FAR_M)
    listening.hear(2 * RULES.ghost_silent_s, NEAR_M, excess_db, bearing_deg)
    assert listening.judged().state == state


@pytest.mark.parametrize(("n_weak", "excess_db"), [(30, 0.0), (200, WEAK_DB)])
def test_a_candidate_is_as_loud_as_its_louder_pulses_unless_most_that_point_to_it_are_too_weak_for_that(
    n_weak: int, excess_db: float
) -> None:
    listening = Listening()
    listening.hear(40, FAR_M)
    before_db = listening.judged().level_db
    listening.hear(n_weak, NEAR_M, WEAK_DB)
    assert listening.judged().level_db == pytest.approx(before_db + excess_db, abs=0.1)


def test_a_confirmed_finding_stays_so_while_it_is_heard_though_the_map_has_it_in_sight_from_nowhere() -> None:
    listening = Listening(nothing_in_sight)
    listening.hear(40, NEAR_M)
    assert listening.judged(replace(CANDIDATE, state="confirmed")).state == "confirmed"
