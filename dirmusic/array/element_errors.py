"""Errors of the elements of a real array: the error model, priors, and estimates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
import scipy  # its submodules are loaded when they are first used
from scipy.stats import chi2

from dirmusic.array.manifold import GainManifold
from dirmusic.arrays import FloatArray, IntArray


@dataclass(frozen=True, kw_only=True)
class ElementErrors:
    r"""Errors of the elements: :math:`h_i(\theta) = (1 + e_i) \, g(\theta - b_i - d_i) + o_i`.

    Attributes:
        gain: Relative errors e of the gains, shape (n_elements,).
        pointing_rad: Azimuth errors d of the boresights, shape (n_elements,).
        offset: Offsets o added to the gains, in units of gain, shape (n_elements,).
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


OFF_PLANE = 5.0
"""Coefficient of the sine of the elevation in the pattern error, relative to the error in the plane. With an error of
0.02 in the plane, it matches the difference between the helix computed in its ring and `gain_in_space`: 0.017, 0.03 to
0.04, and 0.05 to 0.07 of the largest gain at 10, 20 and 40 degrees, depending on the band. A single helix differs by
two thirds of that."""

FAR_OFF_PLANE = 12.0
"""Coefficient of the squared sine of the elevation in the same error. It is larger than the gains alone would require,
because beyond 30 degrees several directions are nearly equally likely and the wrong one may be chosen. Measured as
above."""


def off_by_pattern(sin2: FloatArray) -> FloatArray:
    """Compute the variance of the pattern error relative to that in the plane, from the squared sine of elevation."""
    return 1.0 + OFF_PLANE**2 * sin2 + FAR_OFF_PLANE**2 * np.square(sin2)


UNEXPLAINED = 0.02
"""Fraction of a channel's strength that no model explains in a yard. Assumed; see `ElementSpread.unexplained`."""


@dataclass(frozen=True, kw_only=True)
class ElementSpread:
    """Standard deviations of the errors of the elements, which are normally distributed; all >= 0.

    Attributes:
        gain: Relative gain error.
        pointing_rad: Pointing error.
        offset: Offset of the gain, in units of gain.
        pattern: Error of the pattern in one direction in the plane, in units of the largest gain.
        unexplained: Relative error of a strength that no model explains: reflections within the gate, edges of the
            gate, mutual coupling. Outside a laboratory, use `UNEXPLAINED`. `total_std` uses this value; the Locator
            estimates its own.
    """

    gain: float = 0.0
    pointing_rad: float = 0.0
    offset: float = 0.0
    pattern: float = 0.0
    unexplained: float = 0.0

    def __post_init__(self) -> None:
        """Check that the standard deviations are valid."""
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value >= 0):
                raise ValueError(f"`{name}` must be a standard deviation, finite and >= 0, got {value!r}")

    def variance(self, gain: FloatArray, slope: FloatArray) -> FloatArray:
        """Compute the variance of each gain from the nominal gain and its slope per radian, all of the same shape."""
        return np.square(self.gain * gain) + np.square(self.pointing_rad * slope) + self.offset**2 + self.pattern**2

    def log_density(
        self, mismatch: FloatArray, gain: FloatArray, slope: FloatArray, noise_variance: FloatArray
    ) -> FloatArray:
        """Compute the log density of the difference between an element's measured and nominal gain.

        Args:
            mismatch: Strength divided by amplitude, minus the nominal gain.
            gain: Nominal gain.
            slope: Slope of the nominal gain per radian.
            noise_variance: Noise variance of the strength, divided by the squared amplitude.
        """
        variance = np.maximum(self.variance(gain, slope) + noise_variance, np.finfo(np.float64).tiny)
        return -0.5 * (np.square(mismatch) / variance + np.log(variance))


@dataclass(frozen=True, kw_only=True)
class UniformOffsets:
    """Offsets of the gains, uniform in [-half_width, half_width]: the error model of the Dir-MUSIC paper.

    References:
        Dir-MUSIC, eq. (16)-(17) and section 3.2.
    """

    half_width: float

    def __post_init__(self) -> None:
        """Check that the width is valid."""
        if not (np.isfinite(self.half_width) and self.half_width > 0):
            raise ValueError(f"`half_width` must be finite and > 0, in units of gain, got {self.half_width!r}")

    def variance(self, gain: FloatArray, slope: FloatArray) -> FloatArray:
        """Compute the variance of each gain; see `ElementSpread.variance`."""
        return np.full(np.broadcast_shapes(gain.shape, slope.shape), self.half_width**2 / 3)

    def log_density(
        self, mismatch: FloatArray, gain: FloatArray, slope: FloatArray, noise_variance: FloatArray
    ) -> FloatArray:
        """Compute the log density; arguments as in `ElementSpread.log_density`.

        The density is uniform, with edges blurred by the noise: the convolution with a normal density whose standard
        deviation is at least 1/50 of the half-width.
        """
        std = np.sqrt(np.maximum(noise_variance, (self.half_width / 50) ** 2))
        above, below = (scipy.special.ndtr((mismatch + half) / std) for half in (self.half_width, -self.half_width))
        return np.log(np.maximum(above - below, 1e-300))


ManifoldPrior = ElementSpread | UniformOffsets
"""Prior distribution of the errors of an array, independent between elements."""

N_KINDS = 3
"""Number of kinds of errors; the states are ordered gains, pointings, offsets."""

DRIFT = 0.2
"""Standard deviation of the change of the errors from one mission to the next, as a fraction of the spread. Assumed:
1 % of gain and 0.4 degrees, for reconnected cables, ageing and warming amplifiers, and mounts that have been knocked.
"""

CONTRADICTION = 0.995
"""Probability of the chi-squared distribution beyond which two estimates of the same errors contradict each other. Both
estimates share the prior of the data sheet, so false alarms are rarer than 0.5 %."""


@dataclass(frozen=True, kw_only=True)
class EstimatedErrors:
    """Normal distribution of the errors of one array.

    Attributes:
        state: Mean of the gain errors of all elements, their pointing errors in radians and their offsets in units of
            gain, in this order, shape (3 n_elements,).
        covariance: Covariance of the state, shape (3 n_elements, 3 n_elements), positive semi-definite, zero for kinds
            of errors that the array does not have.
    """

    state: FloatArray
    covariance: FloatArray

    @classmethod
    def of_spread(cls, spread: ElementSpread, n_elements: int) -> Self:
        """Create the prior for a data sheet: zero mean and independent elements."""
        std = np.repeat([spread.gain, spread.pointing_rad, spread.offset], n_elements)
        return cls(state=np.zeros(std.size), covariance=np.diag(np.square(std)))

    @classmethod
    def of_states(cls, state: FloatArray, covariance: FloatArray, n_elements: int) -> Self:
        """Create the distribution from states ordered by kind; offsets are 0 if the states do not contain them.

        Args:
            state: Errors, shape (n_kinds n_elements,), with n_kinds = 2 or 3.
            covariance: Covariance of the state, shape (n_kinds n_elements, n_kinds n_elements).
            n_elements: Number of elements.
        """
        missing = (0, N_KINDS * n_elements - state.size)
        return cls(state=np.pad(state, missing), covariance=np.pad(covariance, missing))

    @property
    def mean(self) -> ElementErrors:
        """Mean of the errors, by kind."""
        gain, pointing_rad, offset = self.state.reshape(N_KINDS, -1)
        return ElementErrors(gain=gain, pointing_rad=pointing_rad, offset=offset)

    def take(self, elements: Sequence[int] | IntArray) -> Self:
        """Select elements by index."""
        rows: IntArray = np.arange(self.state.size, dtype=np.intp).reshape(N_KINDS, -1)[:, elements].ravel()
        return type(self)(state=self.state[rows], covariance=self.covariance[np.ix_(rows, rows)])

    def drifted(self, spread: ElementSpread) -> Self:
        r"""Predict the errors in the next mission, with covariance :math:`C + (\mathrm{DRIFT}\, \sigma)^2 I`."""
        grown = DRIFT**2 * self.of_spread(spread, self.state.size // N_KINDS).covariance
        return type(self)(state=self.state, covariance=self.covariance + grown)

    def contradicts(self, other: EstimatedErrors) -> bool:
        r"""Test whether this estimate contradicts another one that was made from other data.

        .. math:: (m - m')^T (C + C')^{-1} (m - m')

        over the n states whose variances are not zero is chi-squared with n degrees of freedom if they agree.
        """
        covariance = self.covariance + other.covariance
        free = np.flatnonzero(np.diag(covariance) > 1e-9)
        apart = (self.state - other.state)[free]
        square = apart @ np.linalg.solve(covariance[np.ix_(free, free)], apart)
        return bool(square > chi2.ppf(CONTRADICTION, free.size))
