"""Pulse trains over the phase of the mains: kinds of discharge as `dirmusic` knows them, each defect in its own way."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from dirmusic.pulses.phase_resolved import KINDS, Cluster, KindName

FloatArray = NDArray[np.float64]

COMMON_STD_DEG = 5.0
CENTRE_STD_DEG = 3.0
WIDTH_LOG_STD = 0.15
LEVEL_STD_DB = 1.0
SHARE_LOG_STD = 0.2
"""How defects of one kind differ from the typical one (assumed): phase of all clusters together, as the voltage at
which it begins differs, then phase, width, level and number of each."""


@dataclass(frozen=True, kw_only=True)
class PulseTrain:
    """When one defect discharges within the cycle of the mains, and how strongly.

    Attributes:
        clusters: The clusters of this very defect.
        mains_hz: Frequency of the mains.
        conductor_rad: Phase by which the voltage at the defect lags the receiver's own mains: its conductor.
    """

    clusters: tuple[Cluster, ...]
    mains_hz: float
    conductor_rad: float

    @classmethod
    def draw(cls, kind: KindName, mains_hz: float, conductor_rad: float, rng: np.random.Generator) -> Self:
        """A defect of a kind, in its own way."""
        common_deg = float(rng.normal(0.0, COMMON_STD_DEG))
        clusters = [
            replace(
                cluster,
                share=cluster.share * float(np.exp(rng.normal(0.0, SHARE_LOG_STD))),
                centre_deg=cluster.centre_deg + common_deg + float(rng.normal(0.0, CENTRE_STD_DEG)),
                width_deg=cluster.width_deg * float(np.exp(rng.normal(0.0, WIDTH_LOG_STD))),
                level_db=cluster.level_db + float(rng.normal(0.0, LEVEL_STD_DB)),
            )
            for cluster in KINDS[kind]
        ]
        whole = sum(cluster.share for cluster in clusters)
        return cls(
            clusters=tuple(replace(cluster, share=cluster.share / whole) for cluster in clusters),
            mains_hz=mains_hz,
            conductor_rad=conductor_rad,
        )

    def rhythm(self, rate_hz: float) -> Rhythm:
        """The clusters of the train as rows, for a mean number of pulses per second."""
        share, centre, width, level, spread, polarity = np.array(
            [(c.share, c.centre_deg, c.width_deg, c.level_db, c.spread_db, c.polarity) for c in self.clusters]
        ).T
        n = share.size
        return Rhythm(
            rate_hz=rate_hz * share,
            mains_hz=np.full(n, self.mains_hz),
            lag=np.full(n, self.conductor_rad / (2 * np.pi)),
            centre=centre / 360.0,
            width=width / 360.0,
            level_db=level,
            spread_db=spread,
            polarity=polarity,
            is_even=np.zeros(n, dtype=np.bool_),
        )

    def emit(
        self, start_s: float, duration_s: float, rate_hz: float, rng: np.random.Generator
    ) -> tuple[FloatArray, FloatArray]:
        """Times within an interval, seconds, and signed amplitudes over the typical one; each (n_pulses,)."""
        _, time_s, amplitude = self.rhythm(rate_hz).emit(start_s, duration_s, rng)
        return time_s, amplitude


class Rhythm(NamedTuple):
    """When pulses come and how strongly, a row for each cluster; all columns of shape (n_rows,).

    Attributes:
        rate_hz: Mean number of pulses per second.
        mains_hz: Frequency of the mains.
        lag: Cycles by which the voltage at the defect lags the receiver's mains.
        centre: Phase, in cycles.
        width: Standard deviation of the phase, in cycles.
        level_db: Typical level.
        spread_db: Standard deviation of the level.
        polarity: Sign of the pulses.
        is_even: Whether pulses come at any phase alike; centre and width then have no meaning.
    """

    rate_hz: FloatArray
    mains_hz: FloatArray
    lag: FloatArray
    centre: FloatArray
    width: FloatArray
    level_db: FloatArray
    spread_db: FloatArray
    polarity: FloatArray
    is_even: NDArray[np.bool_]

    @classmethod
    def at_any_phase(cls, rate_hz: float) -> Rhythm:
        """Pulses all alike that have nothing to do with the mains."""
        none = np.zeros(1)
        return cls(np.array([rate_hz]), np.ones(1), none, none, none, none, none, np.ones(1), np.ones(1, np.bool_))

    def emit(
        self, start_s: float, duration_s: float, rng: np.random.Generator
    ) -> tuple[NDArray[np.intp], FloatArray, FloatArray]:
        """Row, time within an interval, seconds, and amplitude of each pulse, row by row; each (n_pulses,).

        Poisson processes whose rate follows the phase: that one discharge changes the next is left out (assumed).
        """
        first = self.mains_hz * start_s - self.lag  # in cycles at the defect
        last = first + self.mains_hz * duration_s
        low = np.where(self.is_even, first, np.floor(first) - 1)  # a cluster's tail may lie in the next cycle
        n_cycles = np.where(self.is_even, last, np.ceil(last) + 1) - low
        counts = rng.poisson(self.rate_hz / self.mains_hz * n_cycles)
        row = np.repeat(np.arange(counts.size), counts)
        along = rng.random(row.size) * n_cycles[row]
        off, louder = rng.standard_normal((2, row.size))
        whole = np.where(self.is_even[row], along, np.floor(along))
        cycle = low[row] + whole + self.centre[row] + self.width[row] * off
        inside = (cycle >= first[row]) & (cycle < last[row])
        row, cycle, louder = row[inside], cycle[inside], louder[inside]
        amplitude = self.polarity[row] * 10 ** ((self.level_db[row] + self.spread_db[row] * louder) / 20)
        return row, (cycle + self.lag[row]) / self.mains_hz[row], amplitude
