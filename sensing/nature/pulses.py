"""Discharge pulses: their waveform, and pulse trains over the mains phase."""

from __future__ import annotations

from dataclasses import astuple
from functools import cache
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from dirmusic.arrays import BoolArray, FloatArray, IntArray
from dirmusic.pulses.phase_resolved import KINDS, KindName

DECAY_S, RISE_S, FREQUENCY_HZ = 1.0e-9, 0.2e-9, 1.75e9
"""Time constants and frequency of the waveform. Assumed, to agree with the measurements in the Dir-MUSIC paper: a pulse
is about 2.5 ns long and has 76 % of its energy between 1.5 and 2 GHz."""


def damped_pulse(time_s: ArrayLike, phase_rad: float = 0.0) -> FloatArray:
    r"""Return a damped oscillation that is 0 before time 0; if the phase is 0, its largest magnitude is 1.

    .. math:: s(t) = (e^{-t/\tau_d} - e^{-t/\tau_r}) \sin(2 \pi f t + \varphi) / \max_t |\cdot|_{\varphi = 0}

    Args:
        time_s: Time since the arrival of the pulse, any shape.
        phase_rad: Phase of the oscillation, which changes with polarisation, reflection and diffraction.

    Returns:
        Waveform for a peak of 1 V, same shape.

    References:
        Dir-MUSIC, section 3.1 (form) and 4.2 (duration and band).
    """
    return _unscaled_pulse(np.asarray(time_s, dtype=np.float64), phase_rad) / _peak()


def _unscaled_pulse(time_s: FloatArray, phase_rad: float) -> FloatArray:
    t = np.maximum(time_s, 0.0)
    return (np.exp(-t / DECAY_S) - np.exp(-t / RISE_S)) * np.sin(2 * np.pi * FREQUENCY_HZ * t + phase_rad)


@cache
def _peak() -> float:
    return float(np.abs(_unscaled_pulse(np.arange(0.0, 5 * DECAY_S, 1e-13), 0.0)).max())


def unit_pulse_energy(sample_rate_hz: float) -> float:
    """Return the sum of the squared samples of a pulse with a peak of 1 V, V^2.

    For a pulse with a peak of A volts and noise of standard deviation sigma, the energy-to-noise ratio of a unit-gain
    channel is A^2 times this sum over sigma^2.
    """
    return float(np.square(damped_pulse(np.arange(0.0, 20 * DECAY_S, 1 / sample_rate_hz))).sum())


class PulseTrain(NamedTuple):
    """Clusters of pulses over the mains phase, of one or several defects. All columns have the shape (n_clusters,).

    Attributes:
        rate_hz: Mean number of pulses per second.
        mains_hz: Mains frequency.
        lag: Lag of the voltage at the defect behind the mains phase of the receiver, in cycles.
        centre: Mean phase, in cycles.
        width: Standard deviation of the phase, in cycles.
        level_db: Mean level.
        spread_db: Standard deviation of the level.
        polarity: Sign of the pulses.
        is_even: True for pulses that are uniformly distributed over the phase; `centre` and `width` are then not used.
    """

    rate_hz: FloatArray
    mains_hz: FloatArray
    lag: FloatArray
    centre: FloatArray
    width: FloatArray
    level_db: FloatArray
    spread_db: FloatArray
    polarity: FloatArray
    is_even: BoolArray

    @classmethod
    def at_any_phase(cls) -> Self:
        """Create one cluster of equal pulses that are independent of the mains phase, at one pulse per second."""
        zero, one = np.zeros(1), np.ones(1)
        return cls(one, one, zero, zero, zero, zero, zero, one, np.ones(1, np.bool_))

    @classmethod
    def of_kind(
        cls, kind: KindName, mains_hz: float, conductor_rad: float, rng: np.random.Generator | None = None
    ) -> Self:
        """Create the clusters of one defect, at one pulse per second in total.

        Defects of the same kind differ. Assumed: the phase of all clusters together, with a standard deviation of 5
        degrees, because inception voltages differ, and in addition phase, level, width and share of each cluster.

        Args:
            kind: Kind of the defect.
            mains_hz: Mains frequency.
            conductor_rad: Lag of the conductor's voltage behind the mains phase of the receiver.
            rng: Generator of these differences; None for a typical defect.
        """
        share, centre_deg, width_deg, level_db, spread_db, polarity = np.array(
            [(*astuple(c), c.polarity) for c in KINDS[kind]]
        ).T
        if rng is not None:
            common_deg = rng.normal(0.0, 5.0)
            off_share, off_deg, off_width, off_db = rng.normal(0.0, (0.2, 3.0, 0.15, 1.0), (share.size, 4)).T
            share, width_deg = share * np.exp(off_share), width_deg * np.exp(off_width)
            centre_deg, level_db = centre_deg + common_deg + off_deg, level_db + off_db
        mains, lag, is_even = (np.full(share.size, same) for same in (mains_hz, conductor_rad / (2 * np.pi), False))
        centre, width, rate_hz = centre_deg / 360.0, width_deg / 360.0, share / share.sum()
        return cls(rate_hz, mains, lag, centre, width, level_db, spread_db, polarity, is_even)

    def times(self, factor: float) -> PulseTrain:
        """Return the clusters with `factor` times as many pulses."""
        return self._replace(rate_hz=factor * self.rate_hz)

    def draw(
        self, start_s: float, duration_s: float, rng: np.random.Generator
    ) -> tuple[IntArray, FloatArray, FloatArray]:
        """Draw the pulses of an interval as Poisson processes whose rates depend on the mains phase.

        Assumed: discharges are independent of each other.

        Returns:
            Cluster, time in seconds and relative amplitude of each pulse, each of shape (n_pulses,), cluster by
            cluster.
        """
        first = self.mains_hz * start_s - self.lag  # in cycles at the defect
        last = first + self.mains_hz * duration_s
        low = np.where(self.is_even, first, np.floor(first) - 1)  # a cluster may extend into the next cycle
        n_cycles = np.where(self.is_even, last, np.ceil(last) + 1) - low
        counts = rng.poisson(self.rate_hz / self.mains_hz * n_cycles)
        row = np.repeat(np.arange(counts.size), counts)
        along = rng.random(row.size) * n_cycles[row]
        off_centre, off_level = rng.standard_normal((2, row.size))
        since_low = np.where(self.is_even[row], along, np.floor(along))
        cycle = low[row] + since_low + self.centre[row] + self.width[row] * off_centre
        inside = (cycle >= first[row]) & (cycle < last[row])
        row, cycle, off_level = row[inside], cycle[inside], off_level[inside]
        amplitude = self.polarity[row] * 10 ** ((self.level_db[row] + self.spread_db[row] * off_level) / 20)
        return row, (cycle + self.lag[row]) / self.mains_hz[row], amplitude
