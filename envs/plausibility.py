"""What in a scenario is allowed and yet hardly meant: notes, one line each, with which a mission goes on."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.bounds import perpendicular_slope
from dirmusic.locating.rules import CredibilityRules
from pdpatrol.envs.scenario.array_section import data_sheet
from pdpatrol.envs.scenario.scenario import Scenario
from pdpatrol.envs.scenario.sources import SourceConfig
from pdpatrol.sensing.receiver.receiver import Receiver

FloatArray = NDArray[np.float64]

RADIANS = tuple(k * np.pi / 12 for k in range(1, 25))
"""Fractions and multiples of pi that angles are mostly written as, where they are in radians."""

LOOKS_ALIKE = 2e-3
"""Within which a number of degrees is taken for one of those (assumed)."""

MARGIN_DB = 6.0
"""By how much mirrors may make a pulse louder than its straight path (assumed)."""

GROUND_STEPS = 80
"""Of the ground along either side of the yard, at which it is asked where the robot fits."""


def plausibility(scenario: Scenario) -> list[str]:
    """Notes on a scenario, each `key: what is odd`; none where all of it makes sense.

    Args:
        scenario: One that is allowed.
    """
    return [*_angles(scenario), *_array(scenario), *_sources(scenario)]


def _angles(scenario: Scenario) -> Iterator[str]:
    """Angles in degrees that look like radians."""
    angles_deg = {f"yard.equipment.{i}.yaw_deg": item.yaw_deg for i, item in enumerate(scenario.yard.equipment)}
    angles_deg |= {f"map.extra.{i}.yaw_deg": item.yaw_deg for i, item in enumerate(scenario.map.extra)}
    angles_deg |= {"route.dock_yaw_deg": scenario.route.dock_yaw_deg or 0.0}
    angles_deg |= {f"carriers.{i}.bearing_deg": item.bearing_deg for i, item in enumerate(scenario.carriers)}
    for key, angle_deg in angles_deg.items():
        if any(abs(abs(angle_deg) - radians) < LOOKS_ALIKE for radians in RADIANS):
            yield f"{key}: {angle_deg:g} degrees look like radians, which would be {np.degrees(angle_deg):.0f} degrees"


def _array(scenario: Scenario) -> Iterator[str]:
    """Errors of the array that turn bearings further than those of noise may be."""
    model, config = data_sheet(scenario.array), scenario.array
    gain, spread = model.manifold.search_gain, model.spread
    turning = np.square(perpendicular_slope(gain, model.manifold.search_slope)).sum(axis=0)
    energy = np.square(gain).sum(axis=0)
    by_offset = model.manifold.n_elements * spread.offset**2 / energy
    std_rad = float(np.median(np.sqrt((spread.gain**2 + spread.pointing_rad**2 + by_offset) * energy / turning)))
    most_rad = CredibilityRules().max_std_rad
    if std_rad > most_rad:
        yield (
            f"array: with gain_error {config.gain_error:g}, pointing_error_deg {config.pointing_error_deg:g} and "
            f"gain_offset {config.gain_offset:g} bearings are off by some {np.degrees(std_rad):.0f} degrees, more than "
            f"the {np.degrees(most_rad):.0f} that noise may make of a credible pulse"
        )


def _sources(scenario: Scenario) -> Iterator[str]:
    """Sources that never discharge, or that nobody can hear."""
    receiver = Receiver(scenario.receiver, scenario.array.n_channels)
    if scenario.receiver.full_scale_v <= receiver.threshold_v:
        yield (
            f"receiver.full_scale_v: {scenario.receiver.full_scale_v:g} V are below the trigger level, "
            f"{receiver.threshold_v:.2g} V: whatever triggers is clipped"
        )
    ground_m = _ground(scenario)
    for i, source in enumerate(scenario.grown_sources):
        start_s, end_s = source.active_s or (0.0, inf)
        start_s = max(start_s, source.first_shot_s if source.n_shots is not None else 0.0)
        if source.pulse_rate_hz == 0.0 or start_s >= min(end_s, scenario.task.time_limit_s):
            yield f"sources.{i}: `{source.name}` does not discharge within the mission"
            continue
        range_m = _nearest(scenario, source, ground_m)
        peak_v = source.amplitude_v * 10 ** (source.amplitude_range_db / 40) * receiver.front_end.pulse_peak
        drift_db = max(source.drift_db_per_min * min(end_s, scenario.task.time_limit_s) / 60.0, 0.0)
        level_db = 20 * np.log10(peak_v / range_m / receiver.threshold_v) + drift_db + MARGIN_DB
        if level_db < 0.0:
            yield (
                f"sources.{i}: `{source.name}` is heard from nowhere: at {range_m:.1f} m, the nearest that the robot "
                f"comes, its loudest pulse is {MARGIN_DB - level_db:.0f} dB below the trigger"
            )


def _ground(scenario: Scenario) -> FloatArray:
    """Ground on which the robot fits, and its dock, shape (n, 2)."""
    axes = [np.linspace(0.0, size_m, GROUND_STEPS + 1) for size_m in scenario.yard.size_m]
    ground_m = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    is_free = scenario.yard.clearance(ground_m) >= scenario.robot.description.room_m
    return np.vstack([ground_m[is_free], scenario.route.dock_m])


def _nearest(scenario: Scenario, source: SourceConfig, ground_m: FloatArray) -> float:
    """Least distance between the array on the ground and any place where a source may be, metres."""
    upward_m = scenario.array.height_m
    if source.anywhere_at_m is not None:
        return max(abs(source.anywhere_at_m - upward_m), 0.1)
    places = [scenario.yard.site_position(site) for site in scenario.candidate_sites(source)]
    places_m = np.array(places if source.position_m is None else [source.position_m])
    antennas_m = np.column_stack([ground_m, np.full(len(ground_m), upward_m)])
    return max(float(min(np.linalg.norm(antennas_m - place_m, axis=-1).min() for place_m in places_m)), 0.1)
