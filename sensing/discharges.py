"""Pulse trains over the phase of the mains: kinds of discharge as `dirmusic` knows them, each defect in its own way."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from dirmusic.discharge_kinds import KINDS, Cluster, KindName

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
        clusters: Of this very defect.
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

    def emit(
        self, start_s: float, duration_s: float, rate_hz: float, rng: np.random.Generator
    ) -> tuple[FloatArray, FloatArray]:
        """Times within an interval, seconds, and amplitudes with their sign against the typical one; each (n_pulses,).

        A Poisson process whose rate follows the phase: that one discharge changes the next is left out (assumed).
        """
        lag = self.conductor_rad / (2 * np.pi)
        first, last = (self.mains_hz * t - lag for t in (start_s, start_s + duration_s))  # in cycles at the defect
        low, high = int(np.floor(first)) - 1, int(np.ceil(last)) + 1  # a cluster's tail may lie in the next cycle
        n = rng.poisson(rate_hz / self.mains_hz * (high - low))
        share = np.array([cluster.share for cluster in self.clusters])
        which = rng.choice(share.size, n, p=share)
        centre, width, level, spread, polarity = np.array(
            [(c.centre_deg, c.width_deg, c.level_db, c.spread_db, c.polarity) for c in self.clusters]
        )[which].T.reshape(5, n)
        cycle = rng.integers(low, high, n) + rng.normal(centre, width) / 360.0
        amplitude = polarity * 10 ** (rng.normal(level, spread) / 20)
        inside = (cycle >= first) & (cycle < last)
        return (cycle[inside] + lag) / self.mains_hz, amplitude[inside]
