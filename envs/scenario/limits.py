"""What the numbers of a scenario may be together: what they cost, and where arithmetic ends. One line per fault."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import log10, sqrt

import numpy as np

from pdpatrol.envs.scenario.sources import CarrierConfig, InterfererConfig, SourceConfig
from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing import ReceiverConfig

MOST_PULSES = 5_000_000
"""That sources and noise make in one mission: a log keeps 300 bytes of each that is detected."""

STEP_S = 0.1
"""Of control: pulses of one step are in memory together."""

MOST_GATE_BYTES = 256e6
"""Of the gates of one step."""

MOST_SAMPLES_PER_S = 1e9
"""That a receiver computes for a second of simulated time, on one path of each pulse: some ten seconds of work."""

SAMPLE_BYTES = 8
RINGING = 12.0
"""Samples for which a band-pass rings, times its bandwidth over the sampling rate (measured)."""

PULSE_S = 12e-9
"""For which a pulse is tabulated."""

MOST_DRIFT_DB = 120.0
"""That a source grows louder or fainter by in one mission."""

MOST_GROWTH_DB = 120.0
"""That a source has grown louder or fainter by when it is inspected."""

MOST_RATE_HZ = 1e4
"""Pulses a second of a source that has grown, as many as may be stated."""

MOST_DECADES = 6.0
"""By which a source has become more frequent or more seldom when it is inspected."""

MOST_OVER_NOISE = 1e9
"""Loudest pulse of a source 1 m away over the noise: 180 dB."""

MOST_CARRIER_OVER_NOISE = 1e4
"""Carriers together over the noise behind the band-pass: 80 dB, where nothing else is received."""

FREE_SHARE = 0.01
"""Of the ground, on which the robot has to fit where a source is drawn over free ground."""


def growth_faults(sources: Sequence[SourceConfig], weeks: float) -> Iterator[str]:
    """Whether a source has grown, or gone, by more than a discharge can."""
    for i, source in enumerate(sources):
        grown_db = source.growth_db_per_week * weeks
        if abs(grown_db) > MOST_GROWTH_DB:
            yield (
                f"sources.{i}.growth_db_per_week: got {source.growth_db_per_week:g}, {grown_db:.3g} dB in the "
                f"{weeks:.3g} weeks of the campaign; allowed are {MOST_GROWTH_DB:g} dB"
            )
        decades = log10(1.0 + source.rate_growth_per_week) * weeks
        if abs(decades) > MOST_DECADES or source.pulse_rate_hz * 10**decades > MOST_RATE_HZ:
            yield (
                f"sources.{i}.rate_growth_per_week: got {source.rate_growth_per_week:g}, 10^{decades:.3g} times the "
                f"pulses in the {weeks:.3g} weeks of the campaign; allowed are 10^{MOST_DECADES:g} times and "
                f"{MOST_RATE_HZ:g} a second"
            )


def pulse_faults(
    sources: Sequence[SourceConfig],
    interferers: Sequence[InterfererConfig],
    receiver: ReceiverConfig,
    n_channels: int,
    time_limit_s: float,
) -> Iterator[str]:
    """Whether there are more pulses than a mission can hold or a receiver compute."""
    key = "sources, interferers, receiver.false_alarm_rate_hz"
    n_pulses = receiver.false_alarm_rate_hz * time_limit_s + sum(_n_pulses(s, time_limit_s) for s in sources)
    n_pulses += sum(item.pulse_rate_hz for item in interferers) * time_limit_s
    if n_pulses > MOST_PULSES:
        yield (
            f"{key}: {n_pulses:.3g} pulses within task.time_limit_s, {time_limit_s:g}; allowed are at most "
            f"{MOST_PULSES:.3g} in a mission"
        )
    rate_hz = receiver.false_alarm_rate_hz + sum(item.pulse_rate_hz for item in (*sources, *interferers))
    n_bytes = STEP_S * rate_hz * n_channels * receiver.gate_samples * SAMPLE_BYTES
    if n_bytes > MOST_GATE_BYTES:
        yield (
            f"{key}: {rate_hz:g} pulses a second of {receiver.gate_samples} samples in {n_channels} channels are "
            f"{n_bytes / 1e6:.0f} MB in a step of control; allowed are {MOST_GATE_BYTES / 1e6:.0f}: fewer pulses or "
            "a shorter gate"
        )
    elif (samples_hz := rate_hz * n_channels * samples_of_pulse(receiver)) > MOST_SAMPLES_PER_S:
        yield (
            f"{key}: {rate_hz:g} pulses a second at this sampling rate, band and longest echo are {samples_hz:.2g} "
            f"samples to compute; allowed are {MOST_SAMPLES_PER_S:.2g} a second"
        )


def samples_of_pulse(receiver: ReceiverConfig) -> float:
    """Samples of one channel that are computed for a pulse, about."""
    rate_hz = receiver.sample_rate_hz
    rings = 0.0 if receiver.band_hz == "all" else RINGING * rate_hz / (receiver.band_hz[1] - receiver.band_hz[0])
    return receiver.gate_samples + rings + (PULSE_S + receiver.longest_echo_s) * rate_hz


def _n_pulses(source: SourceConfig, time_limit_s: float) -> float:
    """How many a source radiates within a mission, on average."""
    start_s, end_s = source.active_s or (0.0, time_limit_s)
    if source.n_shots is not None:
        start_s = max(start_s, source.first_shot_s)
    n_pulses = source.pulse_rate_hz * max(min(end_s, time_limit_s) - start_s, 0.0)
    return n_pulses if source.n_shots is None else min(n_pulses, source.n_shots)


def level_faults(
    sources: Sequence[SourceConfig],
    interferers: Sequence[InterfererConfig],
    carriers: Sequence[CarrierConfig],
    receiver: ReceiverConfig,
    time_limit_s: float,
) -> Iterator[str]:
    """Whether something is louder over the noise than can be computed, or a carrier beyond what can be sampled."""
    for i, source in enumerate(sources):
        drift_db = source.drift_db_per_min * time_limit_s / 60.0
        if abs(drift_db) > MOST_DRIFT_DB:
            yield (
                f"sources.{i}.drift_db_per_min: got {source.drift_db_per_min:g}, {drift_db:.3g} dB within "
                f"task.time_limit_s; allowed are {MOST_DRIFT_DB:g} dB"
            )
    for key, items in (("sources", sources), ("interferers", interferers)):
        for i, item in enumerate(items):
            loudest_v, most_v = (
                item.amplitude_v * 10 ** (item.amplitude_range_db / 40),
                MOST_OVER_NOISE * receiver.noise_v,
            )
            if loudest_v > most_v:
                yield (
                    f"{key}.{i}.amplitude_v: up to {loudest_v:.3g} with its range; allowed is {most_v:.3g} at most, "
                    f"{MOST_OVER_NOISE:g} times receiver.noise_v"
                )
    nyquist_hz = 0.5 * receiver.sample_rate_hz
    for i, carrier in enumerate(carriers):
        if carrier.frequency_hz >= nyquist_hz:
            yield (
                f"carriers.{i}.frequency_hz: got {carrier.frequency_hz:g}; allowed is below half of "
                f"receiver.sample_rate_hz, {nyquist_hz:g}"
            )
    width_hz = nyquist_hz if receiver.band_hz == "all" else receiver.band_hz[1] - receiver.band_hz[0]
    most_v = MOST_CARRIER_OVER_NOISE * receiver.noise_v * sqrt(width_hz / nyquist_hz)
    if (whole_v := sum(carrier.amplitude_v for carrier in carriers)) > most_v:
        yield (
            f"carriers: {whole_v:.3g} V together; allowed are {most_v:.3g}, {MOST_CARRIER_OVER_NOISE:g} times the "
            "noise behind the band-pass"
        )


def place_faults(
    sources: Sequence[SourceConfig], sites: Sequence[Sequence[str]], yard: Yard, room_m: float
) -> Iterator[str]:
    """Whether a place may be missing for a source when it is drawn.

    Args:
        sources: All of them, in the order in which they are drawn.
        sites: From which one is drawn for each source and no other; none for a source that has another place.
        yard: Where they are.
        room_m: That the robot needs round it.
    """
    for i, own in enumerate(sites):
        if own and _most_taken(own, sites[:i]) >= len(own):
            yield (
                f"sources.{i}.sites: all of its {len(own)} may be taken by sources before it; allowed are more sites "
                "than others can take"
            )
    axes = [np.linspace(0.0, size_m, 33) for size_m in yard.size_m]
    for i, source in enumerate(sources):
        if source.anywhere_at_m is not None:
            ground_m = np.stack(np.meshgrid(*axes), axis=-1)
            if (yard.clearance(ground_m) >= room_m).mean() < FREE_SHARE:
                yield f"sources.{i}.anywhere_at_m: the robot fits nowhere; allowed is a yard with free ground"
                return


def _most_taken(own: Sequence[str], before: Sequence[Sequence[str]]) -> int:
    """How many of some sites sources before can take at most."""
    from scipy.sparse import csr_array  # here, so that a command line help need not wait for it
    from scipy.sparse.csgraph import maximum_bipartite_matching

    takes = np.array([[site in sites for site in own] for sites in map(set, before)], dtype=np.bool_)
    if not takes.any():
        return 0
    return int((maximum_bipartite_matching(csr_array(takes), perm_type="column") >= 0).sum())
