"""How the elements of a real array differ from the data sheet: known errors, and what is known of unknown ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np
import scipy  # its submodules are loaded when they are first used
from numpy.typing import NDArray

from dirmusic.array.manifold import GainManifold

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class ElementErrors:
    r"""Errors of each element: :math:`h_i(\theta) = (1 + e_i) \, g(\theta - b_i - d_i) + o_i`.

    Attributes:
        gain: Relative errors e of the gains, shape (n_elements,).
        pointing_rad: Azimuth of each boresight beyond the nominal one, d, shape (n_elements,).
        offset: Additions o to the gains, in units of gain, shape (n_elements,).
    """

    gain: FloatArray
    pointing_rad: FloatArray
    offset: FloatArray

    @classmethod
    def none(cls, n_elements: int) -> ElementErrors:
        """An array that is as its data sheet says."""
        return cls(gain=np.zeros(n_elements), pointing_rad=np.zeros(n_elements), offset=np.zeros(n_elements))

    def correct(self, nominal: GainManifold) -> GainManifold:
        """The manifold of an array with these errors."""
        return GainManifold(
            nominal.pattern,
            nominal.boresights_rad + self.pointing_rad,
            boresight_elevations_rad=nominal.boresight_elevations_rad,
            gain_factors=nominal.gain_factors * (1 + self.gain),
            gain_offsets=nominal.gain_offsets * (1 + self.gain) + self.offset,
            elevation_rad=nominal.elevation_rad,
        )


PATTERN_APART_RAD = np.radians(18.0)
"""Azimuths so far apart share exp(-1) of what the pattern there is off by (measured on the computed helices)."""

OFF_PLANE = 5.0
"""How what a pattern is off by grows with the sine of the elevation, from the plane where it was measured. With 0.02 in
the plane it is what the computed helix in its ring is off by from its cut and the law of `gain_in_space`: 0.017, 0.03
to 0.04, 0.05 to 0.07 of the largest gain at 10, 20, 40 degrees, by band; alone two thirds of that (measured)."""

FAR_OFF_PLANE = 12.0
"""The same with the squared sine: more than gains show, but beyond 30 degrees bearings take the wrong of several
directions that are nearly as likely, and are off by what this makes of them (measured as above)."""


def off_by_pattern(sin2: FloatArray) -> FloatArray:
    """Variance of what a pattern is off by, over that in the plane, for squared sines of the elevation; any shape."""
    return 1.0 + OFF_PLANE**2 * sin2 + FAR_OFF_PLANE**2 * np.square(sin2)


class ManifoldPrior(Protocol):
    """What is known of the errors of an array before it detects anything; elements are independent."""

    def variance(self, gain: FloatArray, slope: FloatArray) -> FloatArray:
        """Variance of each element's gain about the data sheet's, of the shape of `gain` and `slope` (per radian)."""
        ...

    def log_density(
        self, mismatch: FloatArray, gain: FloatArray, slope: FloatArray, noise_variance: FloatArray
    ) -> FloatArray:
        """Log density of what an element gives beyond the data sheet's gain, in units of gain.

        Args:
            mismatch: Strength over amplitude, less the gain.
            gain: Gain of the data sheet.
            slope: Its slope per radian.
            noise_variance: Variance of the noise in the strength, over the amplitude squared.
        """
        ...


UNEXPLAINED = 0.02
"""Share of a channel's strength that no model explains in a yard (assumed); see `ElementSpread`."""


@dataclass(frozen=True, kw_only=True)
class ElementSpread(ManifoldPrior):
    """Normal errors of the elements: standard deviations, all >= 0.

    Attributes:
        gain: Of the relative gain errors.
        pointing_rad: Of the pointing errors.
        offset: Of additions to the gain, in units of gain.
        pattern: Of what the gain in any one direction differs from the pattern of the data sheet, in units of its
            largest gain; in the plane where the pattern was measured. Other directions differ otherwise, from
            `PATTERN_APART_RAD` on.
        unexplained: Share of a channel's strength that no model explains: reflections within the gate, its edges,
            mutual coupling; outside a laboratory `UNEXPLAINED`. It counts in the joint fix alone, and stays the same
            for as long as the error of the pose does, so that pulses from nearly one place share it.
    """

    gain: float = 0.0
    pointing_rad: float = 0.0
    offset: float = 0.0
    pattern: float = 0.0
    unexplained: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what is no spread."""
        for name in ("gain", "pointing_rad", "offset", "pattern", "unexplained"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0):
                raise ValueError(f"`{name}` must be a standard deviation, finite and >= 0, got {value!r}")

    def variance(self, gain: FloatArray, slope: FloatArray) -> FloatArray:
        """Variance of each element's gain about the data sheet's."""
        return np.square(self.gain * gain) + np.square(self.pointing_rad * slope) + self.offset**2 + self.pattern**2

    def log_density(
        self, mismatch: FloatArray, gain: FloatArray, slope: FloatArray, noise_variance: FloatArray
    ) -> FloatArray:
        """Normal, with the variances of errors and noise added."""
        variance = np.maximum(self.variance(gain, slope) + noise_variance, np.finfo(np.float64).tiny)
        return -0.5 * (np.square(mismatch) / variance + np.log(variance))


@dataclass(frozen=True, kw_only=True)
class UniformOffsets(ManifoldPrior):
    """Additions to the gain, uniform in [-half_width, half_width], > 0: the errors of the Dir-MUSIC paper.

    References:
        Dir-MUSIC, eq. (16)-(17) and section 3.2.
    """

    half_width: float

    def __post_init__(self) -> None:
        """Refuse what is no width."""
        if not (np.isfinite(self.half_width) and self.half_width > 0):
            raise ValueError(f"`half_width` must be finite and > 0, in units of gain, got {self.half_width!r}")

    def variance(self, gain: FloatArray, slope: FloatArray) -> FloatArray:
        """Variance of a uniform distribution."""
        return np.broadcast_to(np.float64(self.half_width**2 / 3), np.broadcast_shapes(gain.shape, slope.shape))

    def log_density(
        self, mismatch: FloatArray, gain: FloatArray, slope: FloatArray, noise_variance: FloatArray
    ) -> FloatArray:
        """A box with the noise's normal edges; never sharper than a fiftieth of its width, so that a grid sees them."""
        std = np.sqrt(np.maximum(noise_variance, (self.half_width / 50) ** 2))
        above, below = (scipy.special.ndtr((mismatch + half) / std) for half in (self.half_width, -self.half_width))
        return np.log(np.maximum(above - below, 1e-300))


N_KINDS = 3
"""Kinds of errors, in the order of their states: gains, pointings, offsets."""

DRIFT = 0.2
"""Assumed: errors change from one mission to the next by a normal step of this share of the data sheet's spread.
Connectors are mated again, amplifiers age and warm up, plates are knocked; 0.2 is 1 % of gain and 0.4 degrees."""

CONTRADICTION = 1.5
"""Errors that have moved by more than so many of the deviations that they were believed to have, root mean square over
all, are those of another array. In 14 pairs of missions in `one_source` those of the same array moved by 1.3 at most,
0.7 in the median; those of another by 2.5 to 4.6, and passed 1.5 before the source was confirmed in 11 (measured)."""


@dataclass(frozen=True, kw_only=True)
class EstimatedErrors:
    """Normal beliefs about the errors of one array.

    Attributes:
        mean: The likeliest errors.
        covariance: Of the gain errors of all elements, then of their pointing errors in radians, then of their offsets
            in units of gain; shape (3 n_elements, 3 n_elements), positive semi-definite. It is zero for kinds that the
            array is not believed to have.

    Raises:
        ValueError: If the covariance is of another shape.
    """

    mean: ElementErrors
    covariance: FloatArray

    def __post_init__(self) -> None:
        """Refuse a covariance of another number of elements."""
        n_states = N_KINDS * self.mean.gain.size
        if self.covariance.shape != (n_states, n_states):
            raise ValueError(f"`covariance` must have shape ({n_states}, {n_states}), got {self.covariance.shape}")

    @classmethod
    def of_spread(cls, spread: ElementSpread, n_elements: int) -> Self:
        """What a data sheet says: no error is the likeliest, and elements are independent."""
        std = np.repeat([spread.gain, spread.pointing_rad, spread.offset], n_elements)
        return cls(mean=ElementErrors.none(n_elements), covariance=np.diag(np.square(std)))

    @classmethod
    def of_states(cls, state: FloatArray, covariance: FloatArray, n_elements: int) -> Self:
        """From states by kind, and their covariance; offsets are zero where the states end before them.

        Args:
            state: Shape (n_kinds n_elements,), n_kinds of 2 or 3.
            covariance: Shape (n_kinds n_elements, n_kinds n_elements).
            n_elements: Of the array.
        """
        kinds, n = np.zeros((N_KINDS, n_elements)), state.size
        kinds.ravel()[:n] = state
        whole = np.zeros((kinds.size, kinds.size))
        whole[:n, :n] = covariance
        return cls(mean=ElementErrors(gain=kinds[0], pointing_rad=kinds[1], offset=kinds[2]), covariance=whole)

    @property
    def state(self) -> FloatArray:
        """The mean as states by kind, shape (3 n_elements,)."""
        return np.concatenate([self.mean.gain, self.mean.pointing_rad, self.mean.offset])

    def take(self, elements: Sequence[int] | NDArray[np.intp]) -> Self:
        """Beliefs about some of the elements alone, by index."""
        states = np.arange(self.covariance.shape[0], dtype=np.intp).reshape(N_KINDS, -1)
        rows: NDArray[np.intp] = states[:, elements].ravel()
        return self.of_states(self.state[rows], self.covariance[rows][:, rows], len(elements))

    def drifted(self, spread: ElementSpread) -> Self:
        r"""What is left of them at the next mission, :math:`C + (\mathrm{DRIFT}\, \sigma)^2 I`: nothing stays certain.

        Args:
            spread: Of the data sheet.
        """
        grown = DRIFT**2 * self.of_spread(spread, self.mean.gain.size).covariance
        return type(self)(mean=self.mean, covariance=self.covariance + grown)

    def contradicts(self, before: EstimatedErrors) -> bool:
        r"""Whether the errors that pulses have shown are not those that were believed before, of which they make use.

        .. math:: (m - m_0)^T C_0^{-1} (m - m_0) > \mathrm{CONTRADICTION}^2 \, n

        over the n states that have a variance. Pulses that bear the beliefs out move the mean by less than its
        deviation: the left side is less than n on average.

        Args:
            before: What was believed.
        """
        free = np.flatnonzero(np.diag(before.covariance) > 0.0)
        moved = (self.state - before.state)[free]
        square = moved @ np.linalg.solve(before.covariance[free][:, free], moved)
        return bool(square > CONTRADICTION**2 * free.size)
