"""A survey of half an hour on one way round a source: what has just come up is fitted before it is several findings."""

from pathlib import Path

import numpy as np
import pytest

from dirmusic import ElementSpread, GainManifold, PoseError
from pdpatrol.missions.field.array_model import array_model
from pdpatrol.missions.field.field_data import FieldData
from pdpatrol.missions.field.locate_field_data import locate_field_data

N_POSES, N_PULSES, SOURCE_M = 4000, 5, np.array([12.0, 8.0])
CORNERS_M = np.array([[0.0, 0.0], [20.0, 0.0], [20.0, 15.0], [0.0, 15.0], [0.0, 0.0]])


@pytest.mark.parametrize("seed", range(3))
def test_one_source_is_one_finding_however_long_the_survey(seed: int) -> None:
    rng, manifold = np.random.default_rng(seed), GainManifold.ring(6)
    time_s = 0.5 * np.arange(N_POSES, dtype=np.float64)
    way_m = np.concatenate([[0.0], np.linalg.norm(np.diff(CORNERS_M, axis=0), axis=-1).cumsum()])
    at_m = (0.4 * time_s) % way_m[-1]
    place_m = np.column_stack([np.interp(at_m, way_m, corner_m) for corner_m in CORNERS_M.T])
    yaw_rad = np.array([0.0, 0.5, 1.0, -0.5])[np.searchsorted(way_m, at_m, side="right") - 1] * np.pi
    pose = np.column_stack([place_m, yaw_rad])
    real = pose + rng.normal(0.0, [0.03, 0.03, np.radians(0.5)], pose.shape)
    step = np.repeat(np.arange(N_POSES), N_PULSES)
    sight_m = SOURCE_M - real[step, :2]
    azimuth_rad = np.arctan2(sight_m[:, 1], sight_m[:, 0]) - real[step, 2]
    level_v = 0.27 / np.linalg.norm(sight_m, axis=-1) * 10 ** (rng.normal(0.0, 0.1, step.size))
    gain = manifold.gain(azimuth_rad).T * np.exp(rng.normal(0.0, 0.03, 6))
    strengths_v = np.abs(level_v[:, np.newaxis] * gain + rng.normal(0.0, 1e-3, gain.shape))
    data = FieldData(
        path=Path("survey.csv"),
        time_s=time_s,
        pose=pose,
        step=step,
        strengths_v=strengths_v,
        variance_v2=np.full(gain.shape, 1e-6),
        mains_phase_rad=np.full(step.size, np.nan),
        channels=np.arange(6),
        n_recorded=6,
    )
    spread = ElementSpread(gain=0.05, pointing_rad=np.radians(2.0), unexplained=0.02)
    array = array_model(data, spread, None, None, 0.12, 0.6)
    log = locate_field_data(data, array, PoseError(position_m=0.05, heading_rad=np.radians(0.5), correlation_s=5.0))
    findings = log.table("finding")
    last = findings["step"] == findings["step"].max()
    confirmed = last & (findings["state"] == "confirmed")
    assert np.count_nonzero(confirmed) == 1
    assert np.linalg.norm(findings["position_m"][confirmed][0, :2] - SOURCE_M) < 0.3
