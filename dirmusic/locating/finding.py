"""The finding, which is a located discharge, and the distribution of its position with its 95 % ellipse."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from scipy.stats import chi2, f, multivariate_t, norm
from scipy.stats.qmc import Sobol

from dirmusic.arrays import FloatArray

State = Literal["candidate", "confirmed", "outside"]

DEGREES_OF_FREEDOM = 8
"""Degrees of freedom of the errors of positions, see `log_density`. Chosen on 93 findings in all levels of the suite:
these regions of 50, 68, 90 and 95 % held 48, 71, 91 and 98 % of them in the plane and 44, 67, 95 and 99 % in space,
normal ones 55, 77, 91 and 96 %."""

OF_COVARIANCE = (DEGREES_OF_FREEDOM - 2) / DEGREES_OF_FREEDOM
"""Scale matrix of Student's t distribution relative to its covariance."""


def square_within(share: float, n_dimensions: int) -> float:
    """Return the squared Mahalanobis distance within which a share of the positions lies, in 1, 2 or 3 dimensions."""
    return float(n_dimensions * OF_COVARIANCE * f.ppf(share, n_dimensions, DEGREES_OF_FREEDOM))


def log_density(places_m: FloatArray, position_m: FloatArray, covariance_m2: FloatArray) -> FloatArray:
    """Return the logarithm of the density of a position at given places.

    It is Student's t distribution with the stated covariance. Its tails are heavier than those of a normal
    distribution, because the size of the errors is itself estimated, from few places and directions.

    Args:
        places_m: Places, shape (..., 3).
        position_m: Mean of the position, shape (3,).
        covariance_m2: Covariance of the position, shape (3, 3).
    """
    return np.asarray(multivariate_t.logpdf(places_m, position_m, OF_COVARIANCE * covariance_m2, DEGREES_OF_FREEDOM))


def draw_positions(position_m: FloatArray, covariance_m2: FloatArray, log2_n: int) -> FloatArray:
    """Draw quasi-random positions from the same distribution, shape (2**log2_n, 3)."""
    points = Sobol(4, rng=0).random_base2(log2_n)
    root = np.linalg.cholesky(OF_COVARIANCE * covariance_m2)
    stretch = np.sqrt(DEGREES_OF_FREEDOM / chi2.ppf(points[:, :1], DEGREES_OF_FREEDOM))
    return position_m + stretch * norm.ppf(points[:, 1:]) @ root.T


SQUARE_95 = square_within(0.95, 2)
"""Squared Mahalanobis distance of the 95 % ellipse."""


class Ellipse(NamedTuple):
    """Semi-axes and orientation of an ellipse.

    Attributes:
        semi_major_m: Semi-major axis.
        semi_minor_m: Semi-minor axis.
        angle_rad: Direction of the semi-major axis, world frame, in (-pi, pi], ambiguous by half a turn.
    """

    semi_major_m: float
    semi_minor_m: float
    angle_rad: float


def ellipse95(covariance_m2: FloatArray) -> Ellipse:
    """Compute the 95 % ellipse of a position covariance, shape (2, 2)."""
    values, vectors = np.linalg.eigh(covariance_m2)
    return Ellipse(
        semi_major_m=float(np.sqrt(SQUARE_95 * values[1])),
        semi_minor_m=float(np.sqrt(SQUARE_95 * values[0])),
        angle_rad=float(np.arctan2(vectors[1, 1], vectors[0, 1])),
    )


def outline95(position_m: FloatArray, covariance_m2: FloatArray, n_points: int) -> FloatArray:
    """Compute points on the 95 % ellipse of a position, as a closed line of shape (n_points, 2)."""
    angle = np.linspace(0, 2 * np.pi, n_points)
    root = np.linalg.cholesky(SQUARE_95 * covariance_m2)
    return position_m + np.stack([np.cos(angle), np.sin(angle)], axis=-1) @ root.T


def is_inside95(miss_m: FloatArray, covariance_m2: FloatArray) -> bool:
    """Return whether an offset, shape (2,), lies inside the 95 % ellipse of a covariance, shape (2, 2)."""
    return bool(miss_m @ np.linalg.solve(covariance_m2, miss_m) <= SQUARE_95)


def reaches95(position_m: FloatArray, covariance_m2: FloatArray, corner_m: FloatArray) -> bool:
    """Return whether the 95 % ellipse of a position overlaps a rectangle.

    Args:
        position_m: Centre of the ellipse, shape (2,).
        covariance_m2: Covariance of the position, shape (2, 2).
        corner_m: Corner of the rectangle opposite the origin, shape (2,).
    """
    if np.all((position_m >= 0.0) & (position_m <= corner_m)):
        return True
    corners = corner_m * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    root = np.linalg.inv(np.linalg.cholesky(covariance_m2))  # maps the ellipse to a circle
    starts = (corners - position_m) @ root.T
    edges = np.roll(starts, -1, axis=0) - starts
    along = np.clip(-(starts * edges).sum(axis=-1) / np.square(edges).sum(axis=-1), 0.0, 1.0)
    nearest = starts + along[:, np.newaxis] * edges
    return bool(np.square(nearest).sum(axis=-1).min() <= SQUARE_95)


@dataclass(frozen=True, kw_only=True, eq=False)
class Finding:
    """A discharge as located so far. Two findings are equal if all their values are equal.

    Attributes:
        id: Number of the finding, at least 1, which it keeps throughout the mission.
        state: `candidate` until the rules confirm it; `confirmed`; `outside` if its 95 % ellipse lies outside the
            fence, until half of it reaches the fence again.
        position_m: Position, world frame, shape (3,).
        covariance_m2: Covariance of the position, shape (3, 3), including the errors of the array.
        existence: Probability that a source exists there, in [0, 1].
        possibly_two: True if two sources close to each other explain its pulses better than one. The covariance then
            includes their distance.
        n_bearings: Number of its pulses; with a map, only those that were detected in sight of it.
        first_detected_s: Time of its first pulse.
        last_detected_s: Time of its latest pulse, whether in sight of it or not.
        confirmed_s: Time when it was first confirmed, or None.
        aperture_rad: Horizontal angle over which its lines of sight spread, seen from the finding.
        nearest_m: Smallest horizontal distance from which it was detected.
        level_db: Median level of its pulses 1 m from it, dB relative to 1 V, corrected for attenuation on the map; NaN
            until it has been detected in sight.

    Raises:
        ValueError: If the id is below 1, if position or covariance are not finite or have the wrong shape, if the
            covariance is not positive definite, or if `existence` is not a probability.
    """

    id: int
    state: State
    position_m: FloatArray
    covariance_m2: FloatArray
    existence: float
    possibly_two: bool = False
    n_bearings: int
    first_detected_s: float
    last_detected_s: float
    confirmed_s: float | None
    aperture_rad: float
    nearest_m: float
    level_db: float

    def __post_init__(self) -> None:
        """Reject ids below 1, which would mean "no finding", and invalid positions, covariances and probabilities."""
        if self.id < 1:
            raise ValueError(f"finding: `id` must be at least 1, got {self.id}")
        for name, shape in (("position_m", (3,)), ("covariance_m2", (3, 3))):
            value = getattr(self, name)
            if np.shape(value) != shape or not np.isfinite(value).all():
                raise ValueError(f"finding {self.id}: `{name}` must be finite with shape {shape}, got {value!r}")
        if np.linalg.eigvalsh(self.covariance_m2)[0] <= 0:
            raise ValueError(
                f"finding {self.id}: `covariance_m2` must be positive definite, got {self.covariance_m2!r}"
            )
        if not 0.0 <= self.existence <= 1.0:
            raise ValueError(f"finding {self.id}: `existence` must be a probability, got {self.existence}")

    def __eq__(self, other: object) -> bool:
        """Compare all values; NaN equals NaN."""
        return isinstance(other, Finding) and self._values == other._values

    def __hash__(self) -> int:
        """Hash all values."""
        return hash(self._values)

    @cached_property
    def _values(self) -> tuple[int, State, int, bytes]:
        times_s = (
            self.first_detected_s,
            self.last_detected_s,
            np.nan if self.confirmed_s is None else self.confirmed_s,
        )
        others = (*times_s, self.existence, self.possibly_two, self.aperture_rad, self.nearest_m, self.level_db)
        numbers = np.concatenate([self.position_m, np.ravel(self.covariance_m2), others], dtype=np.float64)
        return self.id, self.state, self.n_bearings, numbers.tobytes()

    @cached_property
    def semi_major_m(self) -> float:
        """Semi-major axis of the horizontal 95 % ellipse."""
        return ellipse95(self.covariance_m2[:2, :2]).semi_major_m

    @property
    def height_std_m(self) -> float:
        """Standard deviation of the height."""
        return float(np.sqrt(self.covariance_m2[2, 2]))
