"""Stone Soup's bearings-only filters for a source that stands still; `uv run --group peers` installs it."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

START = datetime(2000, 1, 1)
WANDER_M2_PER_S = 1e-9
"""Process noise: nearly zero, as the source stands still; without any, some filters lose rank."""

N_PARTICLES = 2000

CROSSING_STD_M = 2.0
"""Standard deviation of the crossing of two lines of sight: ample for lines that cross at nearly 90 degrees at 10 m."""


class SightLines(NamedTuple):
    """Bearings of one source, by time.

    Attributes:
        time_s: Shape (n,).
        from_m: Positions at which the bearings were taken, shape (n, 2).
        bearing_rad: World frame, shape (n,).
        std_rad: Shape (n,).
    """

    time_s: FloatArray
    from_m: FloatArray
    bearing_rad: FloatArray
    std_rad: FloatArray


def of_peer(name: str) -> Any:  # noqa: ANN401 - a module of a library that need not be installed
    """Import a module of Stone Soup, or skip the test if it is not installed."""
    pytest.importorskip("stonesoup", reason="Stone Soup is not installed: uv run --group peers")
    return import_module(f"stonesoup.{name}")


def peer_fixes(lines: SightLines, fence_m: tuple[float, float]) -> dict[str, FloatArray]:
    """Return the position of each of the peer's filters after all bearings, shape (2,), by filter and start.

    They start from the middle of the yard, or from the crossing of two lines of sight.
    """
    starts = {
        "fence": (0.5 * np.asarray(fence_m), np.square(np.asarray(fence_m)) / 12.0),
        "crossing": (crossing(lines), np.full(2, CROSSING_STD_M**2)),
    }
    kalman = of_peer("updater.kalman")
    fixes: dict[str, FloatArray] = {}
    for start, (mean_m, variance_m2) in starts.items():
        for name, updater in (
            ("EKF", kalman.ExtendedKalmanUpdater),
            ("UKF", kalman.UnscentedKalmanUpdater),
        ):
            fixes[f"{name} from {start}"] = _kalman(lines, updater(None), mean_m, variance_m2)
    fixes["particle filter from crossing"] = _particles(lines, *starts["crossing"])
    return fixes


def crossing(lines: SightLines) -> FloatArray:
    """Return the crossing of the first line of sight and the one most perpendicular to it, shape (2,)."""
    square = np.abs(np.sin(lines.bearing_rad - lines.bearing_rad[0])).argmax()
    pair = np.array([0, square])
    ahead = np.column_stack([np.cos(lines.bearing_rad[pair]), np.sin(lines.bearing_rad[pair])])
    along_m = np.linalg.solve(np.column_stack([ahead[0], -ahead[1]]), np.subtract(*lines.from_m[pair[::-1]]))
    return lines.from_m[0] + along_m[0] * ahead[0]


def _standing_still() -> Any:  # noqa: ANN401
    linear = of_peer("models.transition.linear")
    return linear.CombinedLinearGaussianTransitionModel([linear.RandomWalk(WANDER_M2_PER_S)] * 2)


def _detections(lines: SightLines) -> list[Any]:
    """Make a detection of each bearing, with the measurement model of the place where it was taken."""
    model, array = of_peer("models.measurement.nonlinear").Cartesian2DToBearing, of_peer("types.array")
    detection, bearing = of_peer("types.detection").Detection, of_peer("types.angle").Bearing
    return [
        detection(
            array.StateVector([bearing(angle)]),
            timestamp=START + timedelta(seconds=float(time_s)),
            measurement_model=model(
                2,
                (0, 1),
                array.CovarianceMatrix([[std**2]]),
                translation_offset=array.StateVector(place.reshape(2, 1)),
            ),
        )
        for time_s, place, angle, std in zip(*lines, strict=True)
    ]


def _filtered(lines: SightLines, predict: Callable[..., Any], updater: Any, state: Any) -> Any:  # noqa: ANN401
    hypothesis = of_peer("types.hypothesis").SingleHypothesis
    for detection in _detections(lines):
        state = updater.update(hypothesis(predict(state, timestamp=detection.timestamp), detection))
    return state


def _kalman(lines: SightLines, updater: Any, mean_m: FloatArray, variance_m2: FloatArray) -> FloatArray:  # noqa: ANN401
    state = of_peer("types.state").GaussianState(mean_m.reshape(2, 1), np.diag(variance_m2), timestamp=START)
    predictor = of_peer("predictor.kalman").KalmanPredictor(_standing_still())
    return np.asarray(_filtered(lines, predictor.predict, updater, state).mean, dtype=np.float64).ravel()


def _particles(lines: SightLines, mean_m: FloatArray, variance_m2: FloatArray) -> FloatArray:
    """Run a particle filter that resamples and regularises when the effective number of particles is small."""
    normal = np.random.default_rng(0).standard_normal((2, N_PARTICLES))
    at_m = mean_m[:, np.newaxis] + np.sqrt(variance_m2)[:, np.newaxis] * normal
    state = of_peer("types.state").ParticleState(
        of_peer("types.array").StateVectors(at_m), weight=np.full(N_PARTICLES, 1.0 / N_PARTICLES), timestamp=START
    )
    still = _standing_still()
    updater = of_peer("updater.particle").ParticleUpdater(
        None,
        resampler=of_peer("resampler.particle").ESSResampler(),
        regulariser=of_peer("regulariser.particle").MCMCRegulariser(transition_model=still),
    )
    predictor = of_peer("predictor.particle").ParticlePredictor(still)
    return np.asarray(_filtered(lines, predictor.predict, updater, state).mean, dtype=np.float64).ravel()
