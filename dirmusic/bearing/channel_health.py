"""Faults of single channels, found from the pulses themselves: no reference, no test signal.

One channel is left out after the other. Where the rest agrees on a direction, it says how strong the pulse should have
been in the one left out; if that is wrong in the same way over many pulses, and leaving it out makes the others agree,
it is at fault.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.angles import aperture
from dirmusic.array.model import ArrayModel
from dirmusic.bearing.estimators import BearingEstimator
from dirmusic.bearing.maximum_likelihood import MaximumLikelihood
from dirmusic.compiled import compiled
from dirmusic.pulses.batch import Bearings, PulseBatch

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@compiled
def stuck_channels(strengths: FloatArray, stuck_spread: float) -> BoolArray:
    """Which channels say the same for every pulse.

    Args:
        strengths: Of the pulses, shape (n_pulses, n_elements), volts.
        stuck_spread: A channel whose strengths spread by less than this share of the largest is stuck.

    Returns:
        Whether each channel is stuck, shape (n_elements,).
    """
    n_pulses, n_elements = strengths.shape
    is_stuck = np.empty(n_elements, np.bool_)
    for e in range(n_elements):
        lowest = highest = strengths[0, e]
        for k in range(1, n_pulses):
            lowest, highest = min(lowest, strengths[k, e]), max(highest, strengths[k, e])
        is_stuck[e] = highest > 0.0 and highest - lowest < stuck_spread * highest
    return is_stuck


FaultName = Literal["dead", "low", "high", "swapped", "stuck"]

LEAST_CHANNELS = 3
"""Fewer good ones than this give no unique direction; the monitor leaves no more out."""


class SuspectChannel(NamedTuple):
    """A channel that is at fault.

    Attributes:
        channel: Counts from 1.
        kind: `dead`, `low` or `high` against what the others say, `swapped` with another, or `stuck` at one value.
        ratio_db: Median of its strength over what the others say, dB; NaN for swapped and stuck ones.
        n_pulses: That showed it.
    """

    channel: int
    kind: FaultName
    ratio_db: float
    n_pulses: int

    def __str__(self) -> str:
        """One line for the log."""
        if self.kind == "swapped":
            return f"channel {self.channel} is swapped with another ({self.n_pulses} pulses)"
        if self.kind == "stuck":
            return f"channel {self.channel} says the same for every pulse ({self.n_pulses} pulses)"
        told = (
            "is dead"
            if self.kind == "dead"
            else f"hears {abs(self.ratio_db):.0f} dB too {'little' if self.kind == 'low' else 'much'}"
        )
        return f"channel {self.channel} {told} ({self.n_pulses} pulses)"


@dataclass(frozen=True, kw_only=True)
class HealthRules:
    """When a channel is at fault. All values are assumed.

    Attributes:
        check_pulses: Pulses between checks.
        most_checks: Of pulses that come at once: of a long survey there are more pulses between checks.
        at_ease: Nothing is looked into while the upper quartile of the share that no direction explains is below this.
        window: Pulses that a check looks back on.
        fair_share: A pulse tells something of a channel that should hear it at this share of the loudest, at least.
        least_pulses: So many must tell.
        fault_db: Median deviation that makes a fault: the array's own spread stays well below.
        each_db: Deviation in the same sense of nine in ten of the pulses.
        dead_db: From here down a channel is dead rather than low.
        cure: Leaving the channel out must bring the unexplained energy of the pulses below this share.
        agreed: And the median pulse below this share of its own energy: the others agree.
        stuck_spread: A channel whose strengths spread by less than this share is stuck.
    """

    check_pulses: int = 10
    most_checks: int = 2000
    at_ease: float = 0.008
    window: int = 60
    fair_share: float = 0.35
    least_pulses: int = 10
    fault_db: float = 3.5
    each_db: float = 2.0
    dead_db: float = -12.0
    cure: float = 0.25
    agreed: float = 0.02
    stuck_spread: float = 1e-6


SWAP_PULSES = 30
"""Two channels are suspected of being swapped only after a single one has had the time to show (assumed)."""

OPENING_RAD = np.radians(60.0)
"""By how far directions have to be apart (assumed): from one alone a low channel looks like two swapped, and a pattern
that is off there like a channel too low or too high."""

SURE_DB = 10.0
"""A channel that is off by more than this is at fault whatever its pattern is (assumed): ten times the power."""

CLEAR_STD_RAD = np.radians(4.0)
"""Pulses whose bearing is this good by noise are watched (assumed)."""


class ChannelMonitor:
    """Watches the strengths of pulses, says which channels can be trusted, and takes bearings from those alone.

    Whether a channel is at fault is judged by how well a direction explains the pulses, so by maximum likelihood,
    whichever estimator takes the bearings. What the pattern could be off by in one direction, by itself or because the
    source is high above the array, is no fault: a channel at fault is so in all.

    Args:
        array: The nominal array.
        estimator: Takes the bearings from the usable channels.
        rules: When a channel is at fault.
    """

    def __init__(
        self, array: ArrayModel, estimator: BearingEstimator | None = None, rules: HealthRules | None = None
    ) -> None:
        self.array = array
        self.rules = rules or HealthRules()
        self.good = np.ones(array.manifold.n_elements, dtype=np.bool_)
        self._likelihood = MaximumLikelihood()
        self._estimator = estimator or self._likelihood
        self._strengths = np.empty((self.rules.window, array.manifold.n_elements))
        self._misfits = np.empty(self.rules.window)
        self._n_seen = self._n_new = self._n_bad = 0

    @property
    def n_bad(self) -> int:
        """How many channels are at fault."""
        return self._n_bad

    def bearings(self, pulses: PulseBatch) -> PulseBatch:
        """The pulses with directions from the usable channels, and with those marked."""
        if not self._n_bad:
            return self._estimator(pulses, self.array).attached_to(pulses)
        found = self._estimator(pulses.take_channels(self.good), self.array.take(self.good))
        return found.attached_to(pulses)._replace(is_usable=np.broadcast_to(self.good, pulses.strengths_v.shape))

    def watch(self, pulses: PulseBatch) -> tuple[PulseBatch, tuple[SuspectChannel, ...]]:
        """The pulses with their directions, and the channels that these pulses show to be at fault."""
        pulses = self.bearings(pulses)
        found = self.note(pulses)
        return (self.bearings(pulses) if found else pulses), found

    def note(self, pulses: PulseBatch, own: slice = slice(None)) -> tuple[SuspectChannel, ...]:
        """Keep pulses, with their directions, in view; the channels that they show to be at fault.

        Args:
            pulses: With their directions.
            own: Which of them.
        """
        found: list[SuspectChannel] = []
        std_rad, misfit = pulses.std_rad[own], pulses.misfit[own]
        between = max(self.rules.check_pulses, std_rad.size // self.rules.most_checks)
        if not isinstance(self._estimator, MaximumLikelihood):
            likeliest = self._likelihood(pulses.take(own).take_channels(self.good), self.array.take(self.good))
            std_rad, misfit = likeliest.std_rad, likeliest.misfit
        strengths_v = pulses.strengths_v[own]
        for row, (std, unexplained) in enumerate(zip(std_rad.tolist(), misfit.tolist(), strict=True)):
            if std < CLEAR_STD_RAD:  # however many come at once, checks fall on the same pulses
                at = self._n_seen % self.rules.window
                self._strengths[at], self._misfits[at] = strengths_v[row], unexplained
                self._n_seen += 1
                self._n_new += 1
                if self._n_new >= between:
                    self._n_new = 0
                    found += self._check()
        return tuple(found)

    def _check(self) -> list[SuspectChannel]:
        """Channels newly at fault, which are good no more."""
        suspects = self._suspects()
        if suspects:
            self.good[[suspect.channel - 1 for suspect in suspects]] = False
            self._n_bad = int((~self.good).sum())
            channels, window = np.flatnonzero(self.good), self._window
            self._misfits[window] = self._fit(self._strengths[window][:, channels], channels).misfit
        return suspects

    @property
    def _window(self) -> slice:
        """The pulses in view, in no particular order."""
        return slice(0, min(self._n_seen, self.rules.window))

    def _suspects(self) -> list[SuspectChannel]:

        n_good = self.array.manifold.n_elements - self._n_bad
        if n_good <= LEAST_CHANNELS or self._n_seen < self.rules.least_pulses:
            return []
        strengths, misfits = self._strengths[self._window], self._misfits[self._window]
        is_stuck = stuck_channels(strengths, self.rules.stuck_spread)
        stuck: list[int] = [k for k in np.flatnonzero(is_stuck).tolist() if self.good[k]]
        if stuck and len(stuck) < n_good:
            return [SuspectChannel(k + 1, "stuck", np.nan, len(strengths)) for k in stuck]
        upper_quartile = 3 * len(misfits) // 4
        if np.partition(misfits, upper_quartile)[upper_quartile] < self.rules.at_ease:
            return []
        channels = np.flatnonzero(self.good)
        strengths_v = strengths[:, channels]
        unexplained = float(np.median(self._fit(strengths_v, channels).misfit))
        best: tuple[float, SuspectChannel] | None = None
        for k, channel in enumerate(channels):
            left, suspect = self._without(strengths_v, channels, k, int(channel) + 1)
            if suspect is not None and left < self.rules.cure * unexplained and (best is None or left < best[0]):
                best = left, suspect
        if best is not None:
            return [best[1]]
        return self._swapped(strengths_v, channels, unexplained)

    def _fit(self, strengths_v: FloatArray, channels: NDArray[np.intp]) -> Bearings:
        """Likeliest directions of pulses (n, n_channels) by some channels."""
        pulses = PulseBatch.detected(np.zeros(len(strengths_v)), strengths_v, np.zeros_like(strengths_v))
        return self._likelihood(pulses, self.array.take(channels))

    def _without(
        self, strengths_v: FloatArray, channels: NDArray[np.intp], k: int, channel: int
    ) -> tuple[float, SuspectChannel | None]:
        """What is left unexplained without one of the channels, and whether that one is at fault."""
        rules, others = self.rules, np.delete(np.arange(channels.size), k)
        azimuth, _, misfit = self._fit(strengths_v[:, others], channels[others])
        left = float(np.median(misfit))
        gain = self.array.manifold.gain(azimuth)[channels].T
        amplitude = (strengths_v[:, others] * gain[:, others]).sum(axis=-1) / np.square(gain[:, others]).sum(axis=-1)
        tells = (gain[:, k] >= rules.fair_share * gain.max(axis=-1)) & (misfit < rules.agreed) & (amplitude > 0)
        if tells.sum() < rules.least_pulses or left > rules.agreed:
            return left, None
        should = amplitude[tells] * gain[tells, k]
        ratio_db: FloatArray = 20 * np.log10(np.maximum(strengths_v[tells, k] / should, 1e-3))
        median_db = float(np.median(ratio_db))
        alike = float(np.mean((ratio_db if median_db > 0 else -ratio_db) > rules.each_db))
        if abs(median_db) < rules.fault_db or alike < 0.9:
            return left, None
        if abs(median_db) < SURE_DB and aperture(azimuth[tells]) < OPENING_RAD:
            return left, None
        kind = "dead" if median_db < rules.dead_db else "low" if median_db < 0 else "high"
        return left, SuspectChannel(channel, kind, median_db, int(tells.sum()))

    def _swapped(self, strengths_v: FloatArray, channels: NDArray[np.intp], unexplained: float) -> list[SuspectChannel]:
        """Two channels that explain all once they change places."""
        if unexplained < self.rules.agreed or len(strengths_v) < SWAP_PULSES:
            return []
        best, pair = np.inf, (0, 0)
        for i, j in combinations(range(channels.size), 2):
            order = np.arange(channels.size, dtype=np.intp)
            order[[i, j]] = j, i
            left = float(np.quantile(self._fit(strengths_v[:, order], channels).misfit, 0.9))
            if left < best:
                best, pair = left, (i, j)
        if best > min(self.rules.cure * unexplained, self.rules.agreed):
            return []
        order = np.arange(channels.size, dtype=np.intp)
        order[list(pair)] = order[list(pair)[::-1]]
        if aperture(self._fit(strengths_v[:, order], channels).azimuth_rad) < OPENING_RAD:
            return []
        return [SuspectChannel(int(channels[k]) + 1, "swapped", np.nan, len(strengths_v)) for k in pair]
