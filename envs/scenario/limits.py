"""Limits on combinations of settings, for the memory and time of a mission and for the range of the arithmetic."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import log10, sqrt

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import maximum_bipartite_matching

from pdpatrol.envs.scenario.base import STEP_S
from pdpatrol.envs.scenario.sources import CarrierConfig, InterfererConfig, SourceConfig
from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing import ReceiverConfig

MAX_PULSES = 5_000_000
"""Pulses of a mission; a log keeps 300 bytes of each."""

MAX_GATE_BYTES = 256e6
"""Waveforms of one control step, which are in memory together."""

MAX_SAMPLES_PER_S = 1e9
"""Samples computed per second of simulated time on one path of each pulse, which takes some ten seconds."""

MAX_CHANGE_DB = 120.0
"""Change of a source's level, by drift within a mission or by growth over a campaign."""

MAX_RATE_HZ = 1e4
"""Pulse rate of a source after growth, the same as for a source in the file."""

MAX_RATE_DECADES = 6.0
"""Change of a source's pulse rate by growth."""

MAX_PEAK_OVER_NOISE = 1e9
"""Peak of a pulse 1 m away over the noise, 180 dB."""

MAX_CARRIERS_OVER_NOISE = 1e4
"""Sum of all carriers over the noise behind the band-pass, 80 dB; nothing else is received above it."""


def growth_errors(sources: Sequence[SourceConfig], weeks: float) -> Iterator[str]:
    """Check how much sources have changed since the campaign began."""
    for i, source in enumerate(sources):
        grown_db = source.growth_db_per_week * weeks
        if abs(grown_db) > MAX_CHANGE_DB:
            yield (
                f"sources.{i}.growth_db_per_week: must be at most {MAX_CHANGE_DB:g} dB in the {weeks:.3g} weeks of the "
                f"campaign, got {grown_db:.3g} dB"
            )
        decades = log10(1.0 + source.rate_growth_per_week) * weeks
        if abs(decades) > MAX_RATE_DECADES or source.pulse_rate_hz * 10**decades > MAX_RATE_HZ:
            yield (
                f"sources.{i}.rate_growth_per_week: must be at most a factor of 10^{MAX_RATE_DECADES:g} and lead to at "
                f"most {MAX_RATE_HZ:g} pulses per second, got a factor of 10^{decades:.3g} in the {weeks:.3g} weeks of "
                "the campaign"
            )


def pulse_errors(
    sources: Sequence[SourceConfig],
    interferers: Sequence[InterfererConfig],
    receiver: ReceiverConfig,
    n_channels: int,
    time_limit_s: float,
) -> Iterator[str]:
    """Check the number of pulses against memory and computing time."""
    key = "sources, interferers, receiver.false_alarm_rate_hz"
    n_pulses = receiver.false_alarm_rate_hz * time_limit_s + sum(_mean_pulses(s, time_limit_s) for s in sources)
    n_pulses += sum(item.pulse_rate_hz for item in interferers) * time_limit_s
    if n_pulses > MAX_PULSES:
        yield (
            f"{key}: must give at most {MAX_PULSES:.3g} pulses within task.time_limit_s, {time_limit_s:g}, got "
            f"{n_pulses:.3g}"
        )
    rate_hz = receiver.false_alarm_rate_hz + sum(item.pulse_rate_hz for item in (*sources, *interferers))
    n_bytes = STEP_S * rate_hz * n_channels * receiver.gate_samples * np.dtype(np.float64).itemsize
    samples_hz = rate_hz * n_channels * samples_of_pulse(receiver)
    if n_bytes > MAX_GATE_BYTES:
        yield (
            f"{key}: must take at most {MAX_GATE_BYTES / 1e6:.0f} MB per control step, got {n_bytes / 1e6:.0f} MB of "
            f"{rate_hz:g} pulses per second with {receiver.gate_samples} samples; lower the rate or shorten the gate"
        )
    elif samples_hz > MAX_SAMPLES_PER_S:
        yield (
            f"{key}: must take at most {MAX_SAMPLES_PER_S:.2g} computed samples per second, got {samples_hz:.2g} with "
            f"{rate_hz:g} pulses per second at this sampling rate, band and longest echo"
        )


def samples_of_pulse(receiver: ReceiverConfig) -> float:
    """Estimate the number of samples of one channel that are computed for a pulse."""
    rate_hz, pulse_s = receiver.sample_rate_hz, 12e-9
    bandwidth_hz = np.inf if receiver.band_hz == "all" else receiver.band_hz[1] - receiver.band_hz[0]
    ringing = 12.0 * rate_hz / bandwidth_hz  # measured
    return receiver.gate_samples + ringing + (pulse_s + receiver.longest_echo_s) * rate_hz


def _mean_pulses(source: SourceConfig, time_limit_s: float) -> float:
    """Return the mean number of pulses of a source in a mission."""
    start_s, end_s = source.active_s or (0.0, time_limit_s)
    if source.n_shots is not None:
        start_s = max(start_s, source.first_shot_s)
    n_pulses = source.pulse_rate_hz * max(min(end_s, time_limit_s) - start_s, 0.0)
    return n_pulses if source.n_shots is None else min(n_pulses, source.n_shots)


def level_errors(
    sources: Sequence[SourceConfig],
    interferers: Sequence[InterfererConfig],
    carriers: Sequence[CarrierConfig],
    receiver: ReceiverConfig,
    time_limit_s: float,
) -> Iterator[str]:
    """Check levels over the noise, and the frequencies of carriers."""
    for i, source in enumerate(sources):
        drift_db = source.drift_db_per_min * time_limit_s / 60.0
        if abs(drift_db) > MAX_CHANGE_DB:
            yield (
                f"sources.{i}.drift_db_per_min: must be at most {MAX_CHANGE_DB:g} dB within task.time_limit_s, got "
                f"{drift_db:.3g} dB"
            )
    max_v = MAX_PEAK_OVER_NOISE * receiver.noise_v
    for key, items in (("sources", sources), ("interferers", interferers)):
        for i, item in enumerate(items):
            peak_v = item.amplitude_v * 10 ** (item.amplitude_range_db / 40)
            if peak_v > max_v:
                yield (
                    f"{key}.{i}.amplitude_v: must be at most {max_v:.3g} with its range, {MAX_PEAK_OVER_NOISE:g} times "
                    f"receiver.noise_v, got {peak_v:.3g}"
                )
    nyquist_hz = 0.5 * receiver.sample_rate_hz
    for i, carrier in enumerate(carriers):
        if carrier.frequency_hz >= nyquist_hz:
            yield (
                f"carriers.{i}.frequency_hz: must be below half of receiver.sample_rate_hz, {nyquist_hz:g}, got "
                f"{carrier.frequency_hz:g}"
            )
    width_hz = nyquist_hz if receiver.band_hz == "all" else receiver.band_hz[1] - receiver.band_hz[0]
    max_v = MAX_CARRIERS_OVER_NOISE * receiver.noise_v * sqrt(width_hz / nyquist_hz)
    sum_v = sum(carrier.amplitude_v for carrier in carriers)
    if sum_v > max_v:
        yield (
            f"carriers: must be at most {max_v:.3g} V together, {MAX_CARRIERS_OVER_NOISE:g} times the noise behind the "
            f"band-pass, got {sum_v:.3g} V"
        )


def place_errors(
    sources: Sequence[SourceConfig], sites: Sequence[Sequence[str]], yard: Yard, room_m: float
) -> Iterator[str]:
    """Check that every source finds a free place whatever is drawn.

    Args:
        sources: All sources, in the order in which their places are drawn.
        sites: Sites from which the place of each source is drawn; empty for a source without sites.
        yard: The yard.
        room_m: Clearance that the robot needs.
    """
    for i, own in enumerate(sites):
        if own and _max_taken(own, sites[:i]) >= len(own):
            yield f"sources.{i}.sites: must be more than earlier sources can take, got {len(own)} that may all be taken"
    for i, source in enumerate(sources):
        if source.anywhere_at_m is not None:
            ground_m = np.stack(np.meshgrid(*(np.linspace(0.0, size_m, 33) for size_m in yard.size_m)), axis=-1)
            if (yard.clearance(ground_m) >= room_m).mean() < 0.01:
                yield f"sources.{i}.anywhere_at_m: the yard must have free ground on which the robot fits"
            return


def _max_taken(own: Sequence[str], earlier: Sequence[Sequence[str]]) -> int:
    """Return how many of some sites earlier sources can take at most."""
    takes = np.array([[site in sites for site in own] for sites in map(set, earlier)], dtype=np.bool_)
    if not takes.any():
        return 0
    return int((maximum_bipartite_matching(csr_array(takes), perm_type="column") >= 0).sum())
