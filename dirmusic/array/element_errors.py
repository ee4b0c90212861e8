"""How the elements of a real array differ from the data sheet: known errors, and what is known of unknown ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
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
        from scipy.special import ndtr  # here, so that a command line help need not wait for it

        std = np.sqrt(np.maximum(noise_variance, (self.half_width / 50) ** 2))
        inside = ndtr((mismatch + self.half_width) / std) - ndtr((mismatch - self.half_width) / std)
        return np.log(np.maximum(inside, 1e-300))
