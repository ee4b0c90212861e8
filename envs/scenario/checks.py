"""Checks of a scenario that concern several tables: names, places, and limits on memory, time and arithmetic."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf, log10, sqrt
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from pdpatrol.envs.scenario.array import CalibratedArray, data_sheet
from pdpatrol.envs.scenario.base import STEP_S, known_names
from pdpatrol.envs.scenario.sources import SourceConfig
from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing.radio.materials import KIND_MATERIALS

if TYPE_CHECKING:
    from pdpatrol.envs.scenario.scenario import Scenario

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

MAX_PEAK_OVER_NOISE = 1e9
"""Peak of a pulse 1 m away over the noise, 180 dB."""

MAX_CARRIERS_OVER_NOISE = 1e4
"""Sum of all carriers over the noise behind the band-pass, 80 dB; nothing else is received above it."""


def scenario_errors(scenario: Scenario) -> list[str]:
    """List the errors of a scenario whose tables are valid one by one, each as `key: message`."""
    map_errors = scenario.map.errors(scenario.yard)
    errors = [
        *map_errors,
        *_table_errors(scenario),
        *_route_errors(scenario, scenario.yard if map_errors else scenario.known_yard),
        *_source_errors(scenario),
        *_growth_errors(scenario),
    ]
    return errors or [*_rate_errors(scenario), *_level_errors(scenario)]


def _at_most(key: str, value: float, most: float, unit: str) -> Iterator[str]:
    """Yield an error if a value or its negative is above a limit."""
    if abs(value) > most:
        yield f"{key}: must be at most {most:.3g} {unit}, got {value:.3g}"


def _table_errors(scenario: Scenario) -> Iterator[str]:
    """Check kinds of equipment, faults of channels, estimator and calibration."""
    for key, pieces in (("yard.equipment", scenario.yard.equipment), ("map.extra", scenario.map.extra)):
        for i, item in enumerate(pieces):
            if item.kind not in KIND_MATERIALS:
                yield f"{key}.{i}.kind: no kind `{item.kind}`; known are {', '.join(KIND_MATERIALS)}"
    n, receiver = scenario.array.n_channels, scenario.receiver
    channels = [fault.channel for fault in receiver.faults]
    for i, fault in enumerate(receiver.faults):
        for key, channel in (("channel", fault.channel), ("other", fault.other or 1)):
            if channel > n:
                yield f"receiver.faults.{i}.{key}: must be a channel from 1 to {n}, got {channel}"
        if channels.index(fault.channel) != i:
            yield f"receiver.faults.{i}.channel: must have one fault only, got {fault.channel} again"
    if scenario.estimator.method == "sub_bands" and receiver.n_bands == 0:
        yield "estimator.method: sub_bands needs receiver.n_bands from 1 to 8, got 0"
    calibration, number = scenario.locating.calibration, scenario.array.serial_number
    if calibration is not None and number is None:
        yield "array.serial_number: is required with a calibration; without it each mission draws another array"
    elif calibration is not None:
        mismatch = calibration.mismatch(CalibratedArray.of(data_sheet(scenario.array), number))
        if mismatch:
            yield f"locating.calibration: {mismatch}"


def position_error(yard: Yard, position_m: ArrayLike) -> str | None:
    """Describe why a source cannot be at a position (x, y, z); None if it can."""
    place, enclosing = (
        np.round(np.asarray(position_m, dtype=np.float64), 3).tolist(),
        yard.enclosing_equipment(position_m),
    )
    if yard.contains(position_m) and place[2] > 0.0 and enclosing is None:
        return None
    where = f" inside equipment `{enclosing}`" if enclosing else ""
    return f"must lie in the yard, above the ground and outside equipment, got {place}{where}"


def _source_errors(scenario: Scenario) -> Iterator[str]:
    """Check names and places of sources and interferers."""
    yard, known = scenario.yard, scenario.yard.site_names()
    names = [item.name for item in (*scenario.sources, *scenario.interferers)]
    earlier = list[set[str]]()
    for i, source in enumerate(scenario.sources):
        if source.name in names[:i]:
            yield f"sources.{i}.name: must be used once, got `{source.name}` again"
        sites = set(scenario.candidate_sites(source))
        for entry in source.sites:
            if not (set(scenario.expand_site(entry)) & set(known)):
                yield f"sources.{i}.sites: no site `{entry}`; known are {known_names(known, entry)}"
        places = {f"sources.{i}.sites ({site})": yard.site_position(site) for site in sorted(sites & set(known))}
        if source.position_m is not None:
            places = {f"sources.{i}.position_m": source.position_m}
        for key, place_m in places.items():
            if error := position_error(yard, place_m):
                yield f"{key}: {error}"
        if sites and sum(bool(sites & other) for other in earlier) >= len(sites):
            yield f"sources.{i}.sites: must be more than the earlier sources on these sites, got {len(sites)}"
        earlier.append(sites)
    for i, item in enumerate(scenario.interferers):
        if item.name in names[: len(scenario.sources)]:
            yield f"interferers.{i}.name: must be used once, got `{item.name}` again"
        if yard.contains(item.position_m):
            yield f"interferers.{i}.position_m: must lie outside the yard, got {item.position_m}; inside: [[sources]]"
        elif item.moves_to_m is not None and yard.is_crossed(item.position_m, item.moves_to_m):
            yield f"interferers.{i}.moves_to_m: the path must not cross the yard, got {item.moves_to_m}"


def _growth_errors(scenario: Scenario) -> Iterator[str]:
    """Check how much sources have changed since the campaign began."""
    weeks, when = scenario.campaign.weeks, f"on {scenario.campaign.day}"
    for i, source in enumerate(scenario.sources):
        grown_db = source.growth_db_per_week * weeks
        yield from _at_most(f"sources.{i}.growth_db_per_week", grown_db, MAX_CHANGE_DB, f"dB {when}")
        decades = log10(1.0 + source.rate_growth_per_week) * weeks
        rate_hz = source.pulse_rate_hz * 10.0 ** min(decades, 10.0)
        yield from _at_most(f"sources.{i}.rate_growth_per_week", rate_hz, MAX_RATE_HZ, f"pulses per second {when}")


def _route_errors(scenario: Scenario, known_yard: Yard) -> Iterator[str]:
    """Check that the robot fits on dock and waypoints, in the yard and on the map, and where sources are drawn."""
    stops, room_m = {"route.dock_m": scenario.route.dock_m}, scenario.robot.description.room_m
    if not scenario.route.is_planned:
        stops |= {f"route.waypoints_m.{i}": point for i, point in enumerate(scenario.route.stops_m)}
    for key, point in stops.items():
        for yard, where in ((scenario.yard, ""), (known_yard, " on the map")):
            clearance_m = float(yard.clearance(point))
            if clearance_m < room_m:
                (nearest,) = yard.obstacles_at([point])
                yield (
                    f"{key}: must lie in the yard, {room_m:.3g} m or more from any obstacle, so that the robot fits, "
                    f"got {point}, {clearance_m:.2f} m from {nearest}{where}"
                )
                break
    for i, source in enumerate(scenario.sources):
        if source.anywhere_at_m is not None:
            axes = [np.linspace(0.0, size_m, 33) for size_m in scenario.yard.size_m]
            if (scenario.yard.clearance(np.stack(np.meshgrid(*axes), axis=-1)) >= room_m).mean() < 0.01:
                yield f"sources.{i}.anywhere_at_m: the yard must have free ground on which the robot fits"


def _mean_pulses(source: SourceConfig, time_limit_s: float) -> float:
    """Return the mean number of pulses of a source in a mission."""
    start_s, end_s = source.active_s or (0.0, time_limit_s)
    n_pulses = source.pulse_rate_hz * max(min(end_s, time_limit_s) - start_s, 0.0)
    return min(n_pulses, inf if source.n_shots is None else source.n_shots)


def _rate_errors(scenario: Scenario) -> Iterator[str]:
    """Check the number of pulses against memory and computing time."""
    sources, interferers, receiver = scenario.grown_sources, scenario.interferers, scenario.receiver
    limit_s, key = scenario.task.time_limit_s, "sources, interferers, receiver.false_alarm_rate_hz"
    others_hz = receiver.false_alarm_rate_hz + sum(item.pulse_rate_hz for item in interferers)
    n_pulses = others_hz * limit_s + sum(_mean_pulses(source, limit_s) for source in sources)
    yield from _at_most(key, n_pulses, MAX_PULSES, "pulses within task.time_limit_s")
    channels_hz = (others_hz + sum(source.pulse_rate_hz for source in sources)) * scenario.array.n_channels
    n_bytes = STEP_S * channels_hz * receiver.gate_samples * np.dtype(np.float64).itemsize
    yield from _at_most(key, n_bytes, MAX_GATE_BYTES, "bytes of waveforms per control step, of receiver.gate_samples")
    rate_hz, pulse_s = receiver.sample_rate_hz, 12e-9
    width_hz = inf if receiver.band_hz == "all" else receiver.band_hz[1] - receiver.band_hz[0]
    ringing = 12.0 * rate_hz / width_hz  # measured
    n_samples = receiver.gate_samples + ringing + (pulse_s + receiver.longest_echo_s) * rate_hz
    samples_hz = channels_hz * n_samples
    yield from _at_most(key, samples_hz, MAX_SAMPLES_PER_S, "computed samples per second, by rate, band and echoes")


def _level_errors(scenario: Scenario) -> Iterator[str]:
    """Check levels over the noise, and the frequencies of carriers."""
    receiver, minutes = scenario.receiver, scenario.task.time_limit_s / 60.0
    peaks_v = dict[str, tuple[float, float]]()
    for i, item in enumerate(scenario.interferers):
        peaks_v[f"interferers.{i}"] = item.amplitude_v, item.amplitude_range_db
    for i, source in enumerate(scenario.grown_sources):
        peaks_v[f"sources.{i}"] = source.amplitude_v, source.amplitude_range_db
        drift_db = source.drift_db_per_min * minutes
        yield from _at_most(f"sources.{i}.drift_db_per_min", drift_db, MAX_CHANGE_DB, "dB within task.time_limit_s")
    for key, (amplitude_v, range_db) in peaks_v.items():
        peak_v, unit = amplitude_v * 10 ** (range_db / 40), f"V with its range, {MAX_PEAK_OVER_NOISE:g} times the noise"
        yield from _at_most(f"{key}.amplitude_v", peak_v, MAX_PEAK_OVER_NOISE * receiver.noise_v, unit)
    nyquist_hz = 0.5 * receiver.sample_rate_hz
    for i, carrier in enumerate(scenario.carriers):
        if carrier.frequency_hz >= nyquist_hz:
            yield (
                f"carriers.{i}.frequency_hz: must be below half of receiver.sample_rate_hz, {nyquist_hz:g}, got "
                f"{carrier.frequency_hz:g}"
            )
    width_hz = nyquist_hz if receiver.band_hz == "all" else receiver.band_hz[1] - receiver.band_hz[0]
    most_v = MAX_CARRIERS_OVER_NOISE * receiver.noise_v * sqrt(width_hz / nyquist_hz)
    sum_v = sum(carrier.amplitude_v for carrier in scenario.carriers)
    unit = f"V together, {MAX_CARRIERS_OVER_NOISE:g} times the noise behind the band-pass"
    yield from _at_most("carriers", sum_v, most_v, unit)
