"""A ring of six elements, its pulses and findings, for the tests of locating."""

from typing import Any

import numpy as np

from dirmusic import (
    ArrayModel,
    BearingEstimator,
    ElementErrors,
    ElementSpread,
    Finding,
    GainManifold,
    PoseError,
    PulseBatch,
)
from dirmusic.bearing.maximum_likelihood import maximum_likelihood

RING = GainManifold.ring(6)
RING_M = np.column_stack([0.12 * np.cos(RING.boresights_rad), 0.12 * np.sin(RING.boresights_rad), np.full(6, 0.6)])
SPREAD = ElementSpread(gain=0.05, pointing_rad=np.radians(2.0))
ARRAY = ArrayModel(manifold=RING, positions_m=RING_M, spread=SPREAD)
SMALL_ARRAY = ArrayModel(
    manifold=RING, positions_m=np.zeros((6, 3)), spread=ElementSpread(gain=0.01, pointing_rad=np.radians(0.5))
)
"""Ring without extent, and with small errors."""

POSE_ERROR = PoseError(position_m=0.05, heading_rad=np.radians(0.5), correlation_s=5.0)
NO_POSE_ERROR = PoseError(position_m=0.0, heading_rad=0.0, correlation_s=1.0)
LEVEL_DB = -10.0


def with_bearings(
    pulses: PulseBatch, array: ArrayModel = ARRAY, estimator: BearingEstimator = maximum_likelihood
) -> PulseBatch:
    """Add the directions that an estimator finds."""
    return estimator(pulses, array).attached_to(pulses)


def drawn_errors(rng: np.random.Generator) -> ElementErrors:
    """Draw errors of an array by `SPREAD`."""
    return ElementErrors(
        gain=rng.normal(0.0, SPREAD.gain, 6), pointing_rad=rng.normal(0.0, SPREAD.pointing_rad, 6), offset=np.zeros(6)
    )


def make_finding(**values: Any) -> Finding:  # noqa: ANN401 - any attribute of a finding
    """Make a candidate at the origin, with other values where they are given."""
    usual: dict[str, Any] = {
        "id": 1,
        "state": "candidate",
        "position_m": np.zeros(3),
        "covariance_m2": 0.01 * np.eye(3),
        "n_bearings": 100,
        "first_detected_s": 0.0,
        "last_detected_s": 0.0,
        "confirmed_s": None,
        "aperture_rad": 1.0,
        "nearest_m": 3.0,
        "level_db": LEVEL_DB,
    }
    return Finding(**usual | values)


def pulses_from(azimuth: np.ndarray, strength_v: np.ndarray | float) -> PulseBatch:
    """Make pulses from azimuths (n,) with norms of their strengths, and a deviation of 0.3 degrees."""
    n, gain = azimuth.size, RING.gain(azimuth)
    strengths = (gain / np.linalg.norm(gain, axis=0) * strength_v).T
    pulses = PulseBatch.detected(np.zeros(n), strengths, np.full((n, 6), 1e-12))
    return pulses._replace(azimuth_rad=azimuth, std_rad=np.full(n, np.radians(0.3)))
