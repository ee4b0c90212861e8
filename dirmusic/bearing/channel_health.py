"""Detection of faulty channels from the detected pulses alone, without a reference or test signal.

Each channel is left out in turn. If the other channels agree on a direction, they predict the strength of the pulse in
the omitted channel. A channel is faulty if the prediction is wrong in the same sense for many pulses, and the other
channels agree once it is omitted. An error of the pattern that all elements share must not explain the pulses nearly as
well: a wrong data sheet is not a fault of a channel.
"""

from itertools import combinations
from typing import Literal, NamedTuple

import numpy as np

from dirmusic.angles import aperture
from dirmusic.array.model import ArrayModel
from dirmusic.arrays import FloatArray, IntArray
from dirmusic.bearing.common_pattern import N_SECTORS, correct_common_error, nearest_directions, sector
from dirmusic.bearing.estimators import BearingEstimator
from dirmusic.bearing.maximum_likelihood import in_plane_likelihood, maximum_likelihood
from dirmusic.pulses.batch import Bearings, PulseBatch

FaultName = Literal["dead", "low", "high", "swapped", "stuck"]


class SuspectChannel(NamedTuple):
    """A faulty channel.

    Attributes:
        channel: Number of the channel, from 1.
        kind: `dead`, `low` or `high` compared with the prediction, `swapped` with another, or `stuck` at one value.
        ratio_db: Median ratio of its strength to the prediction, dB; NaN for swapped and stuck channels.
        n_pulses: Number of pulses that show the fault.
    """

    channel: int
    kind: FaultName
    ratio_db: float
    n_pulses: int

    def __str__(self) -> str:
        text = {
            "dead": "is dead",
            "low": f"is {abs(self.ratio_db):.0f} dB too low",
            "high": f"is {abs(self.ratio_db):.0f} dB too high",
            "swapped": "is swapped with another",
            "stuck": "is stuck at one value",
        }[self.kind]
        return f"channel {self.channel} {text} ({self.n_pulses} pulses)"


class ChannelMonitor:
    """Bearing estimation that detects faulty channels and excludes them.

    A fault is found from how well a single direction explains the pulses. This test uses maximum likelihood, whichever
    estimator computes the bearings. A faulty channel is wrong in all directions; a deviation in one direction only, due
    to a pattern error or a source high above the array, is not a fault.

    Args:
        array: The nominal array.
        estimator: Estimator that computes the bearings from the good channels.

    Attributes:
        good: True for each channel that is not faulty, shape (n_elements,).
        n_bad: Number of faulty channels.
        CLEAR_STD_RAD: Maximum standard deviation of the bearing due to noise; pulses above it are not used. This and
            the following thresholds are assumed.
        CHECK_PULSES: Number of pulses between checks.
        MOST_CHECKS: Maximum number of checks per call; a call with many pulses checks less often.
        CHECKED_MISFIT: Upper quartile of the misfit below which a check stops, because the channels agree.
        WINDOW: Number of latest pulses that a check uses.
        HISTORY: Number of latest pulses from which the common error of the pattern is estimated.
        PER_SECTOR: Number of latest pulses of each sector of azimuth that are used for this.
        TESTED_SHARE: Minimum predicted strength of a channel, as a fraction of the strongest, for a pulse to test it.
        LEAST_PULSES: Minimum number of pulses that must test a channel.
        FAULT_DB: Minimum median deviation of a faulty channel; well above the spread of real arrays.
        EACH_DB: Minimum deviation, in the same sense, that nine out of ten pulses must show.
        DEAD_DB: Deviation below which a channel is dead rather than low.
        CURED_SHARE: Fraction of its previous value below which the median misfit must fall without the channel, with
            and without a common error of the pattern.
        AGREED_MISFIT: Median misfit below which the other channels agree.
        STUCK_SPREAD: Relative spread of the strengths below which a channel is stuck.
        SWAP_PULSES: Minimum number of pulses for two channels to be reported as swapped; the fault of a single channel
            shows earlier.
        LEAST_APERTURE_RAD: Minimum angular spread of the directions. From one direction alone, a low channel looks like
            two swapped ones, and a pattern error looks like a low or high channel.
        CERTAIN_DB: Deviation beyond which a channel is faulty whatever the spread of the directions; pattern errors are
            smaller than this.
        LEAST_CHANNELS: Minimum number of good channels; with fewer, directions are ambiguous.
        FEW_CHANNELS: Number of channels of which any three agree on almost any pulse with a common error of the
            pattern. With no more, no such error may explain the pulses with a misfit below `AGREED_MISFIT`.
    """

    CLEAR_STD_RAD = np.radians(4.0)
    CHECK_PULSES, MOST_CHECKS, WINDOW, HISTORY, PER_SECTOR = 10, 2000, 60, 1000, 8
    CHECKED_MISFIT, AGREED_MISFIT, CURED_SHARE = 0.008, 0.02, 0.25
    LEAST_PULSES, SWAP_PULSES, LEAST_CHANNELS, FEW_CHANNELS = 10, 30, 3, 4
    FAULT_DB, EACH_DB, DEAD_DB, CERTAIN_DB = 3.5, 2.0, -12.0, 10.0
    TESTED_SHARE, STUCK_SPREAD, LEAST_APERTURE_RAD = 0.35, 1e-6, np.radians(60.0)

    def __init__(self, array: ArrayModel, estimator: BearingEstimator = maximum_likelihood) -> None:
        n_elements = array.manifold.n_elements
        self.array = array
        self.good = np.ones(n_elements, dtype=np.bool_)
        self.n_bad = 0
        self._estimator = estimator
        self._strengths = np.empty((self.HISTORY, n_elements))
        self._misfits = np.empty(self.HISTORY)
        self._n_seen = self._n_new = 0

    def bearings(self, pulses: PulseBatch) -> PulseBatch:
        """Return the pulses with directions estimated from the good channels, which are marked as usable."""
        if not self.n_bad:
            return self._estimator(pulses, self.array).attached_to(pulses)
        found = self._estimator(pulses.take_channels(self.good), self.array.take(self.good))
        return found.attached_to(pulses)._replace(is_usable=np.broadcast_to(self.good, pulses.strengths_v.shape))

    def watch(self, pulses: PulseBatch) -> tuple[PulseBatch, tuple[SuspectChannel, ...]]:
        """Return the pulses with their directions, and the channels newly found faulty."""
        pulses = self.bearings(pulses)
        found = self.note(pulses)
        return (self.bearings(pulses) if found else pulses), found

    def note(self, pulses: PulseBatch, own: slice = slice(None)) -> tuple[SuspectChannel, ...]:
        """Add pulses to the window, check the channels, and return the channels newly found faulty.

        Args:
            pulses: Pulses with their directions.
            own: Rows of the pulses that this receiver detected.
        """
        found: list[SuspectChannel] = []
        std_rad, misfit = pulses.std_rad[own], pulses.misfit[own]
        between = max(self.CHECK_PULSES, std_rad.size // self.MOST_CHECKS)
        if self._estimator is not maximum_likelihood:
            likeliest = in_plane_likelihood(pulses.take(own).take_channels(self.good), self.array.take(self.good))
            std_rad, misfit = likeliest.std_rad, likeliest.misfit
        strengths_v = pulses.strengths_v[own]
        for row, each_rad in enumerate(std_rad.tolist()):  # one by one, so that checks do not depend on the batch size
            if not each_rad < self.CLEAR_STD_RAD:
                continue
            at = self._n_seen % self.HISTORY
            self._strengths[at], self._misfits[at] = strengths_v[row], misfit[row]
            self._n_seen += 1
            self._n_new += 1
            if self._n_new >= between:
                self._n_new = 0
                found += self._check()
        return tuple(found)

    def _check(self) -> list[SuspectChannel]:
        """Find faulty channels, and exclude them from now on."""
        window = self._latest(self.WINDOW)
        suspects = self._suspects(self._strengths[window], self._misfits[window])
        if suspects:
            self.good[[suspect.channel - 1 for suspect in suspects]] = False
            self.n_bad += len(suspects)
            channels = np.flatnonzero(self.good)
            self._misfits[window] = self._fit(self._strengths[window][:, channels], channels).misfit
        return suspects

    def _latest(self, most: int) -> IntArray:
        """Return the rows of the latest pulses, the newest first."""
        return (self._n_seen - 1 - np.arange(min(self._n_seen, most, self.HISTORY))) % self.HISTORY

    def _suspects(self, strengths_v: FloatArray, misfits: FloatArray) -> list[SuspectChannel]:
        """Find faulty channels from the pulses in the window: stuck ones, else the worst one, else a swapped pair."""
        channels = np.flatnonzero(self.good)
        if channels.size <= self.LEAST_CHANNELS or self._n_seen < self.LEAST_PULSES:
            return []
        strengths_v, n = strengths_v[:, channels], len(strengths_v)
        highest = strengths_v.max(axis=0)
        stuck = channels[(highest > 0.0) & (np.ptp(strengths_v, axis=0) < self.STUCK_SPREAD * highest)]
        if 0 < stuck.size < channels.size:
            return [SuspectChannel(channel + 1, "stuck", np.nan, n) for channel in stuck.tolist()]
        upper_quartile = 3 * n // 4
        if np.partition(misfits, upper_quartile)[upper_quartile] < self.CHECKED_MISFIT:
            return []
        unexplained = float(np.median(misfits))
        most = min(self.CURED_SHARE * unexplained, self.AGREED_MISFIT)
        candidates = [self._without(strengths_v, channels, k, most) for k in range(channels.size)]
        cures = [one for one in candidates if one is not None]
        if cures:
            suspect = min(cures, key=lambda one: one[0])[1]
            if not self._is_common(channels, suspect):
                return [suspect]
        return self._swapped(strengths_v, channels, unexplained)

    def _fit(self, strengths_v: FloatArray, channels: IntArray) -> Bearings:
        """Estimate the directions of pulses, strengths of shape (n, n_channels), from some of the channels."""
        pulses = PulseBatch.detected(np.zeros(len(strengths_v)), strengths_v, np.zeros_like(strengths_v))
        return in_plane_likelihood(pulses, self.array.take(channels))

    def _without(
        self, strengths_v: FloatArray, channels: IntArray, k: int, most: float
    ) -> tuple[float, SuspectChannel] | None:
        """Return the median misfit without channel k and the fault of that channel.

        Returns None if the channel is not faulty, or if the median misfit without it is at least `most`.
        """
        others = np.delete(np.arange(channels.size), k)
        azimuth, _, misfit, _ = self._fit(strengths_v[:, others], channels[others])
        remaining = float(np.median(misfit))
        if remaining >= most:
            return None
        gain = self.array.manifold.gain(azimuth)[channels].T
        amplitude = (strengths_v[:, others] * gain[:, others]).sum(axis=-1) / np.square(gain[:, others]).sum(axis=-1)
        tests = (gain[:, k] >= self.TESTED_SHARE * gain.max(axis=-1)) & (misfit < self.AGREED_MISFIT) & (amplitude > 0)
        if tests.sum() < self.LEAST_PULSES:
            return None
        predicted = amplitude[tests] * gain[tests, k]
        ratio_db: FloatArray = 20 * np.log10(np.maximum(strengths_v[tests, k] / predicted, 1e-3))
        median_db = float(np.median(ratio_db))
        consistent = float(np.mean((ratio_db if median_db > 0 else -ratio_db) > self.EACH_DB))
        if abs(median_db) < self.FAULT_DB or consistent < 0.9:
            return None
        if abs(median_db) < self.CERTAIN_DB and aperture(azimuth[tests]) < self.LEAST_APERTURE_RAD:
            return None
        kind = "dead" if median_db < self.DEAD_DB else "low" if median_db < 0 else "high"
        return remaining, SuspectChannel(int(channels[k]) + 1, kind, median_db, int(tests.sum()))

    def _is_common(self, channels: IntArray, suspect: SuspectChannel) -> bool:
        """Test whether a common error of the pattern explains the pulses without a fault of the suspect.

        Both hypotheses include such an error, estimated from the latest pulses of each sector and of the window. A
        fault must explain the window better, and still show in the window.
        """
        strengths_v, faulty = self._strengths[self._latest(self.HISTORY)], suspect.channel - 1
        of_sector = sector(nearest_directions(strengths_v[:, channels], self.array.manifold.search_gain[channels])[0])
        is_used = np.arange(of_sector.size) < self.WINDOW
        for each in range(N_SECTORS):
            is_used[np.flatnonzero(of_sector == each)[: self.PER_SECTOR]] = True
        used, window, others = strengths_v[is_used], strengths_v[: self.WINDOW], channels[channels != faulty]
        gain = correct_common_error(self.array.manifold, used, channels)
        sound = float(np.median(nearest_directions(window[:, channels], gain[channels])[1]))
        gain = correct_common_error(self.array.manifold, used, others)
        azimuth, misfit = nearest_directions(window[:, others], gain[others])
        if float(np.median(misfit)) > self.CURED_SHARE * sound:
            return True
        if channels.size <= self.FEW_CHANNELS and sound < self.AGREED_MISFIT:
            return True
        due = gain[faulty, azimuth] >= self.TESTED_SHARE * gain[:, azimuth].max(axis=0)
        due &= window[:, others].any(axis=1)
        along, data = gain[others][:, azimuth].T, window[:, others]
        predicted = (data * along).sum(axis=-1) / np.square(along).sum(axis=-1) * gain[faulty, azimuth]
        deviation_db = 20 * np.log10(np.maximum(window[due, faulty] / predicted[due], 1e-3))
        sense = 1.0 if suspect.kind == "high" else -1.0
        return not due.any() or sense * float(np.median(deviation_db)) < self.FAULT_DB

    def _swapped(self, strengths_v: FloatArray, channels: IntArray, unexplained: float) -> list[SuspectChannel]:
        """Find a pair of channels that, once exchanged, let single directions explain the pulses."""
        n = len(strengths_v)
        if unexplained < self.AGREED_MISFIT or n < self.SWAP_PULSES:
            return []
        best, pair, directions = np.inf, (0, 0), np.empty(0)
        for i, j in combinations(range(channels.size), 2):
            order = np.arange(channels.size)
            order[[i, j]] = j, i
            fit = self._fit(strengths_v[:, order], channels)
            remaining = float(np.quantile(fit.misfit, 0.9))
            if remaining < best:
                best, pair, directions = remaining, (i, j), fit.azimuth_rad
        if (
            best > min(self.CURED_SHARE * unexplained, self.AGREED_MISFIT)
            or aperture(directions) < self.LEAST_APERTURE_RAD
        ):
            return []
        return [SuspectChannel(int(channels[k]) + 1, "swapped", np.nan, n) for k in pair]
