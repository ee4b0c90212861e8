"""Notes on settings that are allowed but probably not intended."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

import numpy as np

from dirmusic.array.bounds import perpendicular_slope
from dirmusic.locating.rules import CredibilityRules
from pdpatrol.envs.scenario.array import data_sheet
from pdpatrol.envs.scenario.scenario import Scenario
from pdpatrol.sensing.receiver.receiver import Receiver

REFLECTION_MARGIN_DB = 6.0
"""Gain that reflections may add to the direct path. Assumed; two coherent paths of equal strength."""


def plausibility(scenario: Scenario) -> list[str]:
    """List notes on a valid scenario, each as `key: note`."""
    return [*_angle_notes(scenario), *_array_notes(scenario), *_source_notes(scenario)]


def _angle_notes(scenario: Scenario) -> Iterator[str]:
    """Yield notes on angles that are within 0.002 of a multiple of pi / 12."""
    angles_deg = {f"yard.equipment.{i}.yaw_deg": item.yaw_deg for i, item in enumerate(scenario.yard.equipment)}
    angles_deg |= {f"map.extra.{i}.yaw_deg": item.yaw_deg for i, item in enumerate(scenario.map.extra)}
    angles_deg |= {"route.dock_yaw_deg": scenario.route.dock_yaw_deg or 0.0}
    angles_deg |= {f"carriers.{i}.bearing_deg": item.bearing_deg for i, item in enumerate(scenario.carriers)}
    for key, angle_deg in angles_deg.items():
        twelfths = abs(angle_deg) / (np.pi / 12)
        if 1 <= round(twelfths) <= 24 and abs(twelfths - round(twelfths)) * np.pi / 12 < 2e-3:
            yield f"{key}: {angle_deg:g} degrees looks like radians, which would be {np.degrees(angle_deg):.0f} degrees"


def _array_notes(scenario: Scenario) -> Iterator[str]:
    """Yield a note if errors of the array turn bearings by more than a pulse of accepted accuracy."""
    model, config = data_sheet(scenario.array), scenario.array
    gain, spread = model.manifold.search_gain, model.spread
    turning = np.square(perpendicular_slope(gain, model.manifold.search_slope)).sum(axis=0)
    energy = np.square(gain).sum(axis=0)
    by_offset = model.manifold.n_elements * spread.offset**2 / energy
    std_rad = float(np.median(np.sqrt((spread.gain**2 + spread.pointing_rad**2 + by_offset) * energy / turning)))
    max_rad = CredibilityRules().max_std_rad
    if std_rad > max_rad:
        yield (
            f"array: gain_error {config.gain_error:g}, pointing_error_deg {config.pointing_error_deg:g} and "
            f"gain_offset {config.gain_offset:g} turn bearings by some {np.degrees(std_rad):.0f} degrees; pulses are "
            f"used up to a standard deviation of {np.degrees(max_rad):.0f} degrees"
        )


def _source_notes(scenario: Scenario) -> Iterator[str]:
    """Yield notes on sources that never discharge or cannot be detected."""
    receiver = Receiver(scenario.receiver, scenario.array.n_channels)
    if scenario.receiver.full_scale_v <= receiver.threshold_v:
        yield (
            f"receiver.full_scale_v: {scenario.receiver.full_scale_v:g} V is below the trigger level, "
            f"{receiver.threshold_v:.2g} V, so that every detected pulse is clipped"
        )
    time_limit_s, room_m = scenario.task.time_limit_s, scenario.robot.description.room_m
    for i, source in enumerate(scenario.grown_sources):
        start_s, end_s = source.active_s or (0.0, inf)
        start_s = max(start_s, source.first_shot_s if source.n_shots is not None else 0.0)
        if source.pulse_rate_hz == 0.0 or start_s >= min(end_s, time_limit_s):
            yield f"sources.{i}: `{source.name}` does not discharge within the mission"
            continue
        places = [scenario.yard.site_position(site) for site in scenario.candidate_sites(source)]
        places = places or [source.position_m or (0.0, 0.0, source.anywhere_at_m)]
        heights_m = np.array([place[2] for place in places])
        range_m = max(float(np.abs(heights_m - scenario.array.height_m).min()), room_m)
        peak_v = source.amplitude_v * 10 ** (source.amplitude_range_db / 40) * receiver.front_end.pulse_peak
        drift_db = max(source.drift_db_per_min * min(end_s, time_limit_s) / 60.0, 0.0)
        level_db = 20 * np.log10(peak_v / range_m / receiver.threshold_v) + drift_db
        if level_db < -REFLECTION_MARGIN_DB:
            yield (
                f"sources.{i}: `{source.name}` cannot be detected: below it, {range_m:.1f} m away, its strongest pulse "
                f"is {-level_db:.0f} dB below the trigger level"
            )
