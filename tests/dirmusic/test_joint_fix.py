"""Sources and array fitted together."""

import numpy as np
import pytest

from dirmusic import ArrayModel, ElementSpread, GainManifold, PoseError, PulseBatch
from dirmusic.locating.joint_fix import locate_jointly

NOMINAL = GainManifold.ring(6)
RING_M = 0.12 * np.column_stack([np.cos(NOMINAL.boresights_rad), np.sin(NOMINAL.boresights_rad)])
SPREAD = ElementSpread(gain=0.05, pointing_rad=np.radians(2.0))
NO_POSE_ERROR = PoseError(position_m=0.0, heading_rad=0.0, correlation_s=1.0)


def test_ten_times_the_pulses_from_the_same_places_make_the_ellipse_no_smaller_for_what_no_model_explains_stays() -> (
    None
):
    array = ArrayModel(manifold=NOMINAL, positions_m=RING_M, spread=SPREAD)
    east = np.linspace(-6.0, 6.0, 13)
    pose = np.column_stack([east, np.zeros(13), np.linspace(0.0, 2.0, 13)])
    bearing = np.arctan2(5.0, -east)
    strengths = NOMINAL.gain(bearing - pose[:, 2]).T
    strengths /= np.linalg.norm(strengths, axis=-1, keepdims=True)

    def area_m2(times: int) -> float:
        rows = np.repeat(np.arange(13), times)
        quiet = np.full((rows.size, 6), 1e-10)
        pulses = PulseBatch.detected(10.0 * rows.astype(np.float64), strengths[rows], quiet)
        fix = locate_jointly(pulses, pose[rows], np.zeros_like(rows), np.array([[0.3, 4.8]]), array, NO_POSE_ERROR)
        return float(np.sqrt(np.linalg.det(fix.covariances_m2[0])))

    assert area_m2(10) == pytest.approx(area_m2(1), rel=0.1)
