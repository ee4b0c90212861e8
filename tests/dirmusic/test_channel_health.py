"""The channel monitor finds faulty channels quickly and never flags healthy ones."""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import ArrayLike

from dirmusic import GainManifold, estimate_bearings
from dirmusic.angles import difference, wrap
from dirmusic.array.pattern import GainPattern
from dirmusic.bearing.channel_health import ChannelMonitor
from dirmusic.bearing.common_pattern import correct_common_error, nearest_directions
from tests.dirmusic.scenes import RING, SMALL_ARRAY, detected, drawn_errors, rho


def draw_pulses(seed: int, n: int, snr_db: float, factors: dict[int, float]) -> tuple[np.ndarray, np.ndarray]:
    """Draw strengths (n, 6) of pulses from anywhere, with factors on some channels, and their azimuths (n,)."""
    manifold = drawn_errors(np.random.default_rng(seed)).correct(RING)
    rng = np.random.default_rng(1000 + seed)
    azimuth = rng.uniform(-np.pi, np.pi, n)
    gain = manifold.gain(azimuth).T
    for channel, factor in factors.items():
        gain[:, channel - 1] *= factor
    energy = rng.noncentral_chisquare(90, np.square(gain) * rho(snr_db))
    return np.sqrt(np.maximum(energy - 90, 0.0)), azimuth


def median_error(strengths: np.ndarray, azimuth: np.ndarray, manifold: GainManifold = RING) -> float:
    found = estimate_bearings(strengths[:, np.newaxis], manifold).azimuth_rad
    return float(np.median(np.abs(difference(found, azimuth))))


def watch(strengths: np.ndarray, by: int = 25) -> list[tuple[int, str]]:
    """Return channel and kind of the first faults that are found in pulses that arrive in small batches."""
    monitor = ChannelMonitor(SMALL_ARRAY)
    for first in range(0, len(strengths), by):
        _, found = monitor.watch(detected(strengths[first : first + by], 1.0))
        if found:
            return [(suspect.channel, suspect.kind) for suspect in found]
    return []


@pytest.mark.parametrize("snr_db", [10, 0])
@pytest.mark.parametrize(("factor", "kind"), [(0.0, "dead"), (0.5, "low"), (2.0, "high")])
def test_dead_or_drifted_channel_is_found_in_50_pulses(factor: float, kind: str, snr_db: int) -> None:
    ratios = []
    for seed in range(12):
        channel = 1 + seed % 6
        strengths, azimuth = draw_pulses(seed, 2000, snr_db, {channel: factor})
        assert watch(strengths[:50]) == [(channel, kind)]
        good, (healthy, _) = np.delete(np.arange(6), channel - 1), draw_pulses(seed, 2000, snr_db, {})
        of_five = median_error(strengths[:, good], azimuth, RING.take(good))
        ratios.append(of_five / median_error(healthy, azimuth))
    assert np.median(ratios) <= 1.5


@pytest.mark.parametrize("snr_db", [10, 0, -10])
def test_imperfect_but_healthy_array_is_never_flagged(snr_db: int) -> None:
    for seed in range(3):
        strengths, _ = draw_pulses(50 + seed, 10_000, snr_db, {})
        assert not watch(strengths, by=400)


@pytest.mark.parametrize("pair", [(1, 2), (2, 5), (3, 6)])
def test_swapped_channels_are_found_from_several_directions(pair: tuple[int, int]) -> None:
    strengths, azimuth = draw_pulses(3, 4000, 10, {})
    a, b = (channel - 1 for channel in pair)
    strengths[:, [a, b]] = strengths[:, [b, a]]
    assert watch(strengths[:50]) == [(channel, "swapped") for channel in pair]
    from_one_side = strengths[np.abs(difference(azimuth, 0.2)) < np.radians(15.0)]
    assert len(from_one_side) > 200
    assert "swapped" not in dict(watch(from_one_side)).values()


def test_stuck_adc_is_found() -> None:
    strengths, _ = draw_pulses(4, 50, 10, {})
    strengths[:, 3] = 7.0
    assert watch(strengths) == [(4, "stuck")]


def test_faults_do_not_depend_on_batch_size() -> None:
    strengths, _ = draw_pulses(5, 60, 0, {2: 0.5})
    _, whole = ChannelMonitor(SMALL_ARRAY).watch(detected(strengths, 1.0))
    monitor = ChannelMonitor(SMALL_ARRAY)
    single = [suspect for row in strengths for suspect in monitor.watch(detected(row[np.newaxis], 1.0))[1]]
    assert list(whole) == single
    assert monitor.good.tolist() == [True, False, True, True, True, True]


@pytest.mark.whole
def test_fault_in_long_survey_is_found() -> None:
    strengths, _ = draw_pulses(5, 40_000, 10, {})
    strengths[20_000:] = draw_pulses(5, 20_000, 10, {2: 0.5})[0]
    assert watch(strengths, by=40_000) == [(2, "low")]


def test_bearings_use_good_channels_once_fault_is_found() -> None:
    strengths, azimuth = draw_pulses(6, 400, 10, {3: 0.0})
    monitor = ChannelMonitor(SMALL_ARRAY)
    before, _ = monitor.watch(detected(strengths[:1], 1.0))
    bearings, suspects = monitor.watch(detected(strengths, 1.0))
    assert [suspect.channel for suspect in suspects] == [3]
    error = np.abs(difference(bearings.azimuth_rad, azimuth))
    assert np.median(error) < 0.3 * median_error(strengths, azimuth)
    assert before.azimuth_rad.shape == (1,)


def test_at_least_three_channels_are_kept() -> None:
    strengths, _ = draw_pulses(7, 500, 10, {1: 0.0, 2: 0.0, 3: 0.0, 4: 0.0})
    monitor = ChannelMonitor(SMALL_ARRAY)
    monitor.watch(detected(strengths, 1.0))
    assert monitor.good.sum() >= 3


@dataclass(frozen=True)
class ScaledBeam(GainPattern):
    """Pattern of which the beam is wider than the nominal one by a factor."""

    scale: float

    def gain_and_slope(self, off_boresight_rad: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Scale the angle."""
        gain, slope = RING.pattern.gain_and_slope(wrap(off_boresight_rad) / self.scale)
        return gain, slope / self.scale


def draw_turning(seed: int, scale: float, snr_db: float = 0.0) -> np.ndarray:
    """Draw strengths (800, 6) of pulses whose direction wanders slowly, received with a scaled beam."""
    rng = np.random.default_rng(seed)
    manifold = drawn_errors(rng).correct(GainManifold(ScaledBeam(scale), RING.boresights_rad))
    azimuth = np.cumsum(rng.normal(0.0, 0.1, 800)) + rng.uniform(-3.0, 3.0)
    return np.sqrt(np.maximum(rng.noncentral_chisquare(90, np.square(manifold.gain(azimuth).T) * rho(snr_db)) - 90, 0))


@pytest.mark.whole
@pytest.mark.parametrize("scale", [0.85, 1.15])
def test_wrong_beam_width_is_not_a_faulty_channel(scale: float) -> None:
    """An error of the pattern that all elements share is not charged to a channel."""
    assert [seed for seed in range(12) if watch(draw_turning(seed, scale))] == []


@pytest.mark.parametrize("scale", [0.85, 1.15])
def test_dead_channel_is_found_despite_wrong_beam_width(scale: float) -> None:
    for seed in range(8):
        channel = 1 + seed % 6
        strengths = draw_turning(seed, scale)
        strengths[:, channel - 1] *= 0.01
        assert watch(strengths) == [(channel, "dead")]


@pytest.mark.whole
def test_simultaneous_waves_are_not_a_faulty_channel() -> None:
    """A second wave from a fixed direction in most pulses is not charged to a channel."""
    for seed in range(12):
        rng = np.random.default_rng(seed)
        manifold = drawn_errors(rng).correct(RING)
        first, second = np.cumsum(rng.normal(0, 1, (2, 600)) * [[0.1], [0.0]], axis=1) + rng.uniform(-3, 3, (2, 1))
        level = rng.uniform(0.5, 1, 600) * (rng.random(600) < 0.9)
        energy = np.square(manifold.gain(first)) + np.square(level * manifold.gain(second))
        strengths = np.sqrt(np.maximum(rng.noncentral_chisquare(90, energy.T * rho(0.0)) - 90, 0))
        assert not watch(strengths)


def test_common_error_of_pattern_is_learned_without_one_channel() -> None:
    """The gain of a channel that is not used follows from the other channels."""
    strengths = GainManifold(ScaledBeam(0.85), RING.boresights_rad).gain(np.linspace(-np.pi, np.pi, 201)).T
    corrected = correct_common_error(RING, strengths, np.arange(1, 6))
    unexplained = [np.median(nearest_directions(strengths, gain)[1]) for gain in (RING.search_gain, corrected)]
    assert unexplained[1] < 0.25 * unexplained[0]
