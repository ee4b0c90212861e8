"""Errors of the elements of a real array: their model, priors, and estimates of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
import scipy  # its submodules are loaded when they are first used
from numpy.typing import NDArray

from dirmusic.array.manifold import GainManifold

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class ElementErrors:
    r"""Errors of the elements: :math:`h_i(\theta) = (1 + e_i) \, g(\theta - b_i - d_i) + o_i`.

    Attributes:
        gain: Relative errors e of the gains, shape (n_elements,).
        pointing_rad: Azimuth errors d of the boresights, shape (n_elements,).
        offset: Additions o to the gains, in units of gain, shape (n_elements,).
    """

    gain: FloatArray
    pointing_rad: FloatArray
    offset: FloatArray

    @classmethod
    def none(cls, n_elements: int) -> ElementErrors:
        """Return zero errors."""
        return cls(gain=np.zeros(n_elements), pointing_rad=np.zeros(n_elements), offset=np.zeros(n_elements))

    def correct(self, nominal: GainManifold) -> GainManifold:
        """Apply the errors to a nominal manifold."""
        return nominal.replaced(
            boresights_rad=nominal.boresights_rad + self.pointing_rad,
            gain_factors=nominal.gain_factors * (1 + self.gain),
            gain_offsets=nominal.gain_offsets * (1 + self.gain) + self.offset,
        )


PATTERN_APART_RAD = np.radians(18.0)
"""Angle over which the correlation of the error of a pattern falls to 1/e; measured on computed helices."""

OFF_PLANE = 5.0
"""Growth of the error of a pattern with the sine of the elevation, relative to that in the plane. With 0.02 in the
plane it matches the difference of the computed helix in its ring from `gain_in_space`: 0.017, 0.03 to 0.04, 0.05 to
0.07 of the largest gain at 10, 20, 40 degrees, depending on the band; for a single helix two thirds of that."""

FAR_OFF_PLANE = 12.0
"""Growth of the same error with the squared sine, more than the gains show: beyond 30 degrees, bearings fall on the
wrong one of several nearly equally likely directions. Measured as above."""


def off_by_pattern(sin2: FloatArray) -> FloatArray:
    """Compute the variance of the error of a pattern relative to the plane, for squared sines of the elevation."""
    return 1.0 + OFF_PLANE**2 * sin2 + FAR_OFF_PLANE**2 * np.square(sin2)


UNEXPLAINED = 0.02
"""Share of a channel's strength that no model explains in a yard; assumed, see `ElementSpread`."""


@dataclass(frozen=True, kw_only=True)
class ElementSpread:
    """Standard deviations of normal errors of the elements, all >= 0.

    Attributes:
        gain: Relative gain errors.
        pointing_rad: Pointing errors.
        offset: Additions to the gain, in units of gain.
        pattern: Errors of the pattern in one direction in the plane, in units of its largest gain; correlated over
            `PATTERN_APART_RAD`.
        unexplained: Errors of a strength relative to it that no model explains: reflections within the gate, edges of
            the gate, mutual coupling; outside a laboratory `UNEXPLAINED`. Only the joint solver uses it, with the
            correlation time of the pose error.
    """

    gain: float = 0.0
    pointing_rad: float = 0.0
    offset: float = 0.0
    pattern: float = 0.0
    unexplained: float = 0.0

    def __post_init__(self) -> None:
        """Check the standard deviations."""
        for name in ("gain", "pointing_rad", "offset", "pattern", "unexplained"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0):
                raise ValueError(f"`{name}` must be a standard deviation, finite and >= 0, got {value!r}")

    def variance(self, gain: FloatArray, slope: FloatArray) -> FloatArray:
        """Compute the variance of each gain, of the shape of the nominal `gain` and its `slope` per radian."""
        return np.square(self.gain * gain) + np.square(self.pointing_rad * slope) + self.offset**2 + self.pattern**2

    def log_density(
        self, mismatch: FloatArray, gain: FloatArray, slope: FloatArray, noise_variance: FloatArray
    ) -> FloatArray:
        """Compute the log density of the difference between an element's gain and the nominal one.

        Args:
            mismatch: Strength over amplitude, minus the nominal gain.
            gain: Nominal gain.
            slope: Slope of the nominal gain per radian.
            noise_variance: Variance of the strength by noise, over the squared amplitude.
        """
        variance = np.maximum(self.variance(gain, slope) + noise_variance, np.finfo(np.float64).tiny)
        return -0.5 * (np.square(mismatch) / variance + np.log(variance))


@dataclass(frozen=True, kw_only=True)
class UniformOffsets:
    """Additions to the gain, uniform in [-half_width, half_width]: the errors of the Dir-MUSIC paper.

    References:
        Dir-MUSIC, eq. (16)-(17) and section 3.2.
    """

    half_width: float

    def __post_init__(self) -> None:
        """Check the width."""
        if not (np.isfinite(self.half_width) and self.half_width > 0):
            raise ValueError(f"`half_width` must be finite and > 0, in units of gain, got {self.half_width!r}")

    def variance(self, gain: FloatArray, slope: FloatArray) -> FloatArray:
        """Compute the variance of each gain; see `ElementSpread.variance`."""
        return np.broadcast_to(np.float64(self.half_width**2 / 3), np.broadcast_shapes(gain.shape, slope.shape))

    def log_density(
        self, mismatch: FloatArray, gain: FloatArray, slope: FloatArray, noise_variance: FloatArray
    ) -> FloatArray:
        """Compute the log density as `ElementSpread`: a box with normal edges, no sharper than 1/50 of its width."""
        std = np.sqrt(np.maximum(noise_variance, (self.half_width / 50) ** 2))
        above, below = (scipy.special.ndtr((mismatch + half) / std) for half in (self.half_width, -self.half_width))
        return np.log(np.maximum(above - below, 1e-300))


ManifoldPrior = ElementSpread | UniformOffsets
"""Prior distribution of the errors of an array; elements are independent."""

N_KINDS = 3
"""Number of kinds of errors; states are ordered gains, pointings, offsets."""

DRIFT = 0.2
"""Normal change of the errors from one mission to the next, as a share of the spread. Assumed: 1 % of gain and 0.4
degrees, for connectors that are mated again, amplifiers that age and warm up, and mounts that are knocked."""

CONTRADICTION = 1.5
"""Root mean square change of the errors, in prior standard deviations, above which the array must be another one.
Measured in 14 pairs of missions in `one_source`: at most 1.3 and in the median 0.7 for the same array; 2.5 to 4.6 for
another, beyond 1.5 before the source was confirmed in 11."""


@dataclass(frozen=True, kw_only=True)
class EstimatedErrors:
    """Normal distribution of the errors of one array.

    Attributes:
        mean: Most likely errors.
        covariance: Covariance of the gain errors of all elements, their pointing errors in radians and their offsets
            in units of gain, in this order; shape (3 n_elements, 3 n_elements), positive semi-definite, zero for kinds
            of errors that the array does not have.

    Raises:
        ValueError: If the covariance has another shape.
    """

    mean: ElementErrors
    covariance: FloatArray

    def __post_init__(self) -> None:
        """Check the shape of the covariance."""
        n_states = N_KINDS * self.mean.gain.size
        if self.covariance.shape != (n_states, n_states):
            raise ValueError(f"`covariance` must have shape ({n_states}, {n_states}), got {self.covariance.shape}")

    @classmethod
    def of_spread(cls, spread: ElementSpread, n_elements: int) -> Self:
        """Make the prior of a data sheet: zero mean, independent elements."""
        std = np.repeat([spread.gain, spread.pointing_rad, spread.offset], n_elements)
        return cls(mean=ElementErrors.none(n_elements), covariance=np.diag(np.square(std)))

    @classmethod
    def of_states(cls, state: FloatArray, covariance: FloatArray, n_elements: int) -> Self:
        """Make it from states ordered by kind; offsets are zero if the states do not contain them.

        Args:
            state: Errors, shape (n_kinds n_elements,), n_kinds 2 or 3.
            covariance: Covariance of the state, shape (n_kinds n_elements, n_kinds n_elements).
            n_elements: Number of elements.
        """
        kinds, n = np.zeros((N_KINDS, n_elements)), state.size
        kinds.ravel()[:n] = state
        padded = np.zeros((kinds.size, kinds.size))
        padded[:n, :n] = covariance
        return cls(mean=ElementErrors(gain=kinds[0], pointing_rad=kinds[1], offset=kinds[2]), covariance=padded)

    @property
    def state(self) -> FloatArray:
        """Mean as a vector ordered by kind, shape (3 n_elements,)."""
        return np.concatenate([self.mean.gain, self.mean.pointing_rad, self.mean.offset])

    def take(self, elements: Sequence[int] | NDArray[np.intp]) -> Self:
        """Select elements by index."""
        states = np.arange(self.covariance.shape[0], dtype=np.intp).reshape(N_KINDS, -1)
        rows: NDArray[np.intp] = states[:, elements].ravel()
        return self.of_states(self.state[rows], self.covariance[rows][:, rows], len(elements))

    def drifted(self, spread: ElementSpread) -> Self:
        r"""Predict the errors at the next mission, with covariance :math:`C + (\mathrm{DRIFT}\, \sigma)^2 I`."""
        grown = DRIFT**2 * self.of_spread(spread, self.mean.gain.size).covariance
        return type(self)(mean=self.mean, covariance=self.covariance + grown)

    def contradicts(self, before: EstimatedErrors) -> bool:
        r"""Test whether this posterior contradicts the prior that it was computed from.

        .. math:: (m - m_0)^T C_0^{-1} (m - m_0) > \mathrm{CONTRADICTION}^2 \, n

        over the n states with a variance. If the prior holds, the left side is less than n on average.
        """
        free = np.flatnonzero(np.diag(before.covariance) > 0.0)
        moved = (self.state - before.state)[free]
        square = moved @ np.linalg.solve(before.covariance[free][:, free], moved)
        return bool(square > CONTRADICTION**2 * free.size)
