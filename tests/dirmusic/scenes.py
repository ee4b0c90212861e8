"""A ring of six elements, its pulses and findings."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dirmusic import (
    ArrayModel,
    BearingEstimator,
    Bearings,
    ElementErrors,
    ElementSpread,
    Finding,
    GainManifold,
    PoseError,
    PulseBatch,
)
from dirmusic.angles import difference
from dirmusic.bearing.maximum_likelihood import maximum_likelihood
from dirmusic.locating.protocol import LineOfSight

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


def rho(snr_db: ArrayLike) -> np.ndarray:
    """Return the energy of a pulse over the noise variance, with unit gain, for an SNR of the paper; six elements."""
    return 28_070.0 * 10.0 ** (np.asarray(snr_db, dtype=np.float64) / 10)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def robust_std(values: np.ndarray) -> float:
    """Return the standard deviation about 0 of normal values from their median absolute value."""
    return float(1.4826 * np.median(np.abs(values)))


def rms_error(found: Bearings, azimuth_rad: np.ndarray) -> float:
    return rms(difference(found.azimuth_rad, azimuth_rad))


def normalised_error_variance(found: Bearings, azimuth_rad: np.ndarray) -> float:
    """Return the mean square of the errors divided by their stated standard deviations."""
    return rms(difference(found.azimuth_rad, azimuth_rad) / found.std_rad) ** 2


def detected(strengths: np.ndarray, noise_v: float | np.ndarray, time_s: float | np.ndarray = 0.0) -> PulseBatch:
    """Make pulses of strengths (n, n_elements) in white noise."""
    times_s = np.broadcast_to(np.asarray(time_s, dtype=np.float64), len(strengths))
    return PulseBatch.detected(times_s, strengths, np.broadcast_to(np.square(noise_v), strengths.shape))


def with_bearings(
    pulses: PulseBatch, array: ArrayModel = ARRAY, estimator: BearingEstimator = maximum_likelihood
) -> PulseBatch:
    """Add the directions that an estimator finds."""
    return estimator(pulses, array).attached_to(pulses)


def drawn_errors(rng: np.random.Generator, spread: ElementSpread = SPREAD) -> ElementErrors:
    """Draw gain and pointing errors of six elements."""
    return ElementErrors(
        gain=rng.normal(0.0, spread.gain, 6), pointing_rad=rng.normal(0.0, spread.pointing_rad, 6), offset=np.zeros(6)
    )


def make_finding(**values: Any) -> Finding:  # noqa: ANN401 - any attribute of a finding
    """Make a candidate at the origin, with other values where they are given."""
    usual = Finding(
        id=1,
        state="candidate",
        position_m=np.zeros(3),
        covariance_m2=0.01 * np.eye(3),
        existence=0.5,
        n_bearings=100,
        first_detected_s=0.0,
        last_detected_s=0.0,
        confirmed_s=None,
        aperture_rad=1.0,
        nearest_m=3.0,
        level_db=LEVEL_DB,
    )
    return replace(usual, **values)


def pulses_from(azimuth: np.ndarray, strength_v: np.ndarray | float) -> PulseBatch:
    """Make pulses from azimuths (n,) with given norms of their strengths, and a standard deviation of 0.3 degrees."""
    n, gain = azimuth.size, RING.gain(azimuth)
    strengths = (gain / np.linalg.norm(gain, axis=0) * strength_v).T
    return detected(strengths, 1e-6)._replace(azimuth_rad=azimuth, std_rad=np.full(n, np.radians(0.3)))


def rotation(turn_rad: float) -> np.ndarray:
    """Return the matrix that turns vectors of the plane."""
    cos, sin = np.cos(turn_rad), np.sin(turn_rad)
    return np.array([[cos, -sin], [sin, cos]])


def sights(pose: np.ndarray, place_m: np.ndarray, elements_m: np.ndarray = RING_M) -> tuple[np.ndarray, ...]:
    """Return azimuth and elevation in the array frame and distance of places (n, 3) from elements at poses (n, 3)."""
    cos, sin = np.cos(pose[:, 2:]), np.sin(pose[:, 2:])
    east, north = (place_m[..., :2] - pose[:, :2]).T[..., np.newaxis]
    forward, left = cos * east + sin * north - elements_m[:, 0], cos * north - sin * east - elements_m[:, 1]
    plan, up = np.hypot(forward, left), place_m[..., 2:] - elements_m[:, 2]
    return np.arctan2(left, forward), np.arctan2(up, plan), np.hypot(plan, up)


def around(centre: ArrayLike, radius_m: float, from_deg: float, to_deg: float, n: int = 250) -> np.ndarray:
    """Return places (n, 2) along a circle."""
    angle = np.radians(np.linspace(from_deg, to_deg, n))
    return np.asarray(centre) + radius_m * np.column_stack([np.cos(angle), np.sin(angle)])


def received(
    pose: np.ndarray,
    sources_m: ArrayLike,
    manifold: GainManifold,
    rng: np.random.Generator,
    *,
    volt_metres: float = 0.8,
) -> np.ndarray:
    """Draw strengths of two pulses of each source by a far-field model, shape (2 n_sources, 6), in noise of 1 mV."""
    sight_m = np.reshape(sources_m, (-1, 2)) - pose[:2]
    gain = manifold.gain(np.arctan2(sight_m[:, 1], sight_m[:, 0]) - pose[2]).T
    clean = volt_metres / np.linalg.norm(sight_m, axis=-1, keepdims=True) * gain
    return np.abs(np.repeat(clean, 2, axis=0) + rng.normal(0.0, 1e-3, (2 * len(clean), 6)))


def uniform_sight(transmission: float) -> LineOfSight:
    """Make a map with the same transmission from everywhere to everywhere."""
    return lambda places_m, target_m, within_m: np.full(len(places_m), transmission)
