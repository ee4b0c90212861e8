"""Tables of detected pulses and of their directions of arrival."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np

from dirmusic.arrays import BoolArray, FloatArray, IntArray

NO_DIRECTION = (0.0, np.pi, 1.0)
"""Azimuth, standard deviation and misfit of a pulse whose strengths are all 0; a `PulseBatch` never holds NaN there."""


class PulseBatch(NamedTuple):
    """Pulses that a receiver has detected, one per row, in order of time.

    The receiver fills all columns except those of the direction. The bearing estimator adds azimuth, standard
    deviation, misfit and elevation, and the channel monitor adds `is_usable`.

    Attributes:
        time_s: Time of the trigger, shape (n_pulses,).
        strengths_v: Square root of the energy in excess of the noise, shape (n_pulses, n_elements), volts, >= 0.
        variance_v2: Noise variance of the strengths, shape (n_pulses, n_elements), V^2.
        azimuth_rad: Direction of arrival, array frame, in (-pi, pi], shape (n_pulses,).
        std_rad: Standard deviation of the direction as the estimator reports it, shape (n_pulses,); pi for a pulse
            without strength.
        misfit: Fraction of the energy that no single direction in the plane explains, in [0, 1], shape (n_pulses,).
        is_usable: True for each channel that is not faulty, shape (n_pulses, n_elements).
        mains_phase_rad: Mains phase at the receiver at the time of the trigger, in [0, 2 pi), shape (n_pulses,); NaN
            where it was not recorded.
        is_clipped: True for each channel that reached full scale of the ADC, shape (n_pulses, n_elements).
        band_strengths_v: Strengths in sub-bands, shape (n_pulses, n_bands, n_elements), volts; n_bands is 0 if the
            receiver does not measure sub-bands.
        band_variance_v2: Noise variance of the strengths in sub-bands, same shape, V^2.
        elevation_rad: Elevation of arrival, shape (n_pulses,); 0 where a direction in the plane explains the pulse.
    """

    time_s: FloatArray
    strengths_v: FloatArray
    variance_v2: FloatArray
    azimuth_rad: FloatArray
    std_rad: FloatArray
    misfit: FloatArray
    is_usable: BoolArray
    mains_phase_rad: FloatArray
    is_clipped: BoolArray
    band_strengths_v: FloatArray
    band_variance_v2: FloatArray
    elevation_rad: FloatArray

    @classmethod
    def detected(
        cls,
        time_s: FloatArray,
        strengths_v: FloatArray,
        variance_v2: FloatArray,
        mains_phase_rad: FloatArray | None = None,
        band_strengths_v: FloatArray | None = None,
        band_variance_v2: FloatArray | None = None,
    ) -> Self:
        """Create pulses without a direction and with all channels usable; arguments as the attributes of the class."""
        n, shape = time_s.size, strengths_v.shape
        azimuth_rad, std_rad, misfit = NO_DIRECTION
        no_bands = np.empty((n, 0, strengths_v.shape[1]))
        return cls(
            time_s=time_s,
            strengths_v=strengths_v,
            variance_v2=variance_v2,
            azimuth_rad=np.full(n, azimuth_rad),
            std_rad=np.full(n, std_rad),
            misfit=np.full(n, misfit),
            is_usable=np.ones(shape, dtype=np.bool_),
            mains_phase_rad=np.full(n, np.nan) if mains_phase_rad is None else mains_phase_rad,
            is_clipped=np.zeros(shape, dtype=np.bool_),
            band_strengths_v=no_bands if band_strengths_v is None else band_strengths_v,
            band_variance_v2=no_bands if band_variance_v2 is None else band_variance_v2,
            elevation_rad=np.zeros(n),
        )

    @classmethod
    def room(cls, n_pulses: int, n_elements: int, n_bands: int = 0) -> Self:
        """Allocate arrays of pulses, to be filled by a compiled function."""
        strengths, variance = np.empty((2, n_pulses, n_elements))
        bands, band_variance = np.empty((2, n_pulses, n_bands, n_elements))
        time_s = np.empty(n_pulses)
        return cls.detected(time_s, strengths, variance, band_strengths_v=bands, band_variance_v2=band_variance)

    @classmethod
    def none(cls, n_elements: int, n_bands: int = 0) -> Self:
        """Return an empty batch."""
        return cls.room(0, n_elements, n_bands)

    @classmethod
    def join(cls, batches: Sequence[PulseBatch]) -> Self:
        """Concatenate batches."""
        columns: list[Any] = [np.concatenate(column) for column in zip(*batches, strict=True)]
        return cls(*columns)

    @property
    def n_pulses(self) -> int:
        """Number of pulses."""
        return self.time_s.size

    @property
    def is_overdriven(self) -> BoolArray:
        """True where a usable channel reached full scale of the ADC, shape (n_pulses,)."""
        return np.asarray((self.is_clipped & self.is_usable).any(axis=-1))

    def take(self, rows: slice | IntArray | BoolArray) -> Self:
        """Select pulses by slice, index or mask."""
        columns: list[Any] = [column[rows] for column in self]
        return type(self)(*columns)

    def without_bands(self) -> Self:
        """Return the pulses without sub-bands, which only the bearing estimator uses."""
        none = np.empty((self.n_pulses, 0, self.strengths_v.shape[1]))
        return self._replace(band_strengths_v=none, band_variance_v2=none)

    def take_channels(self, channels: IntArray | BoolArray) -> Self:
        """Select channels by index or mask."""
        return self._replace(
            strengths_v=self.strengths_v[:, channels],
            variance_v2=self.variance_v2[:, channels],
            is_usable=self.is_usable[:, channels],
            is_clipped=self.is_clipped[:, channels],
            band_strengths_v=self.band_strengths_v[:, :, channels],
            band_variance_v2=self.band_variance_v2[:, :, channels],
        )


LEAST_SHARE = 0.01
"""Minimum fraction of the pooled energy that is taken as signal, however weak the pulse is. Assumed; it bounds the
standard deviation."""

UNKNOWN_STD_RAD = np.pi / np.sqrt(3)
"""Standard deviation of a direction that is uniform on the circle: the largest that an estimator reports for a pulse
whose strengths are not all 0."""


class Bearings(NamedTuple):
    """Directions of arrival in the array frame.

    Attributes:
        azimuth_rad: Directions in (-pi, pi], shape (...); NaN where all strengths are zero.
        std_rad: Standard deviations, shape (...). They include only noise unless a prior of the manifold errors was
            given, because these errors are common to all pulses from one direction. NaN if neither the noise nor a
            prior was given.
        misfit: Fraction of the energy that no single direction in the plane explains, in [0, 1], shape (...). It is
            large where two sources overlap, a channel is dead, the wave comes from above, or there is only noise.
        elevation_rad: Elevations, shape (...) or (); 0 where a direction in the plane explains the pulse, or if the
            estimator searches the plane only.
    """

    azimuth_rad: FloatArray
    std_rad: FloatArray
    misfit: FloatArray
    elevation_rad: FloatArray = np.zeros(())

    def attached_to(self, pulses: PulseBatch) -> PulseBatch:
        """Return the pulses with these directions, one for each."""
        azimuth_rad, std_rad, misfit, elevation_rad = self
        if elevation_rad.ndim == 0:
            elevation_rad = np.full(pulses.n_pulses, elevation_rad)
        return pulses._replace(azimuth_rad=azimuth_rad, std_rad=std_rad, misfit=misfit, elevation_rad=elevation_rad)
