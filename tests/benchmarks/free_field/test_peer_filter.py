"""Positions compared with those of a filter of Stone Soup: `uv run --group peers pytest -m benchmark -n 0 -s`."""

from datetime import datetime, timedelta
from importlib import import_module
from typing import Any

import numpy as np
import pytest

from dirmusic import total_std, triangulate
from dirmusic.angles import wrap
from dirmusic.locating.rules import LocatingRules
from pdpatrol.envs.simulation import STEP_S
from tests.benchmarks.free_field.cases import FENCE_M, Case, draw_case
from tests.benchmarks.free_field.figures import compare_with_truth, locate, usable

N_CASES = 40
START = datetime(2000, 1, 1)


def sight_lines(case: Case) -> tuple[np.ndarray, ...]:
    """Return times, positions (n, 2), world-frame bearings and their standard deviations, for the usable pulses."""
    rows = np.flatnonzero(usable(case, LocatingRules()))
    pulses, pose = case.pulses.take(rows), case.pose[case.step[rows]]
    std_rad = np.hypot(total_std(pulses, case.array), case.pose_error.heading_rad)
    return STEP_S * case.step[rows], pose[:, :2], wrap(pulses.azimuth_rad + pose[:, 2]), std_rad


def of_peer(name: str) -> Any:  # noqa: ANN401 - a module of a library that need not be installed
    """Import a module of Stone Soup, or skip the test if it is not installed."""
    pytest.importorskip("stonesoup", reason="Stone Soup is not installed: uv run --group peers")
    return import_module(f"stonesoup.{name}")


def peer_position(lines: tuple[np.ndarray, ...]) -> np.ndarray:
    """Return the position, shape (2,), by an unscented Kalman filter that starts from the middle of the yard.

    An extended filter, a filter that starts where two lines cross, and a particle filter are not better.
    """
    linear, array = of_peer("models.transition.linear"), of_peer("types.array")
    still = linear.CombinedLinearGaussianTransitionModel([linear.RandomWalk(1e-9)] * 2)  # with 0 it would be singular
    predictor = of_peer("predictor.kalman").KalmanPredictor(still)
    updater = of_peer("updater.kalman").UnscentedKalmanUpdater(None)
    fence_m = np.asarray(FENCE_M)
    state = of_peer("types.state").GaussianState(
        0.5 * fence_m.reshape(2, 1), np.diag(np.square(fence_m) / 12.0), timestamp=START
    )
    for time_s, from_m, bearing_rad, std_rad in zip(*lines, strict=True):
        detection = of_peer("types.detection").Detection(
            array.StateVector([of_peer("types.angle").Bearing(bearing_rad)]),
            timestamp=START + timedelta(seconds=float(time_s)),
            measurement_model=of_peer("models.measurement.nonlinear").Cartesian2DToBearing(
                2, (0, 1), array.CovarianceMatrix([[std_rad**2]]), translation_offset=array.StateVector(from_m)
            ),
        )
        predicted = predictor.predict(state, timestamp=detection.timestamp)
        state = updater.update(of_peer("types.hypothesis").SingleHypothesis(predicted, detection))
    return np.asarray(state.mean, dtype=np.float64).ravel()


@pytest.mark.benchmark
def test_positions_are_no_worse_than_those_of_a_peer() -> None:
    names = "Locator", "triangulate", "Stone Soup"
    misses_m = np.empty((N_CASES, 3))
    for seed in range(N_CASES):
        case = draw_case(seed)
        lines = sight_lines(case)
        misses_m[seed, 0] = compare_with_truth([(case, locate(case))]).miss_m[0]
        for column, place_m in ((1, triangulate(*lines[1:]).position_m), (2, peer_position(lines))):
            misses_m[seed, column] = np.linalg.norm(place_m - case.sources_m[0, :2])
    by_strengths, by_bearings, peer = medians_m = np.median(misses_m, axis=0)
    print(f"\n{N_CASES} cases, the same pulses; median error, and relative to Stone Soup")
    for name, median_m in zip(names, medians_m, strict=True):
        print(f"{name:24} {median_m:.3f} m  {median_m / peer:.2f}")
    assert by_strengths <= peer
    assert by_bearings <= 1.1 * peer  # equal within the statistics of so few cases
