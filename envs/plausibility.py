"""Warnings about scenario settings that are valid but probably not intended."""

from collections.abc import Iterator
from math import inf

import numpy as np

from pdpatrol.envs.scenario.scenario import Scenario
from pdpatrol.robot_models.turning import turning_doubt
from pdpatrol.sensing.receiver.receiver import Receiver

REFLECTION_MARGIN_DB = 6.0
"""Gain that reflections may add to the direct path: two coherent paths of equal strength. Assumed."""


def plausibility(scenario: Scenario) -> Iterator[str]:
    """Warn about robots that do not turn as commanded, and about sources that never discharge or cannot be detected.

    Each warning is one line, `key: message`.
    """
    receiver = Receiver(scenario.receiver, scenario.array.n_channels)
    if scenario.receiver.full_scale_v <= receiver.threshold_v:
        yield (
            f"receiver.full_scale_v: {scenario.receiver.full_scale_v:g} V is below the trigger level, "
            f"{receiver.threshold_v:.2g} V, so that every detected pulse is clipped"
        )
    if doubt := turning_doubt(scenario.robot.description):
        yield f"robot.model: {scenario.robot.model}: {doubt}"
    time_limit_s, room_m = scenario.task.time_limit_s, scenario.robot.description.room_m
    for source in scenario.grown_sources:
        start_s, end_s = source.active_s or (0.0, inf)
        start_s = max(start_s, source.first_shot_s if source.n_shots is not None else 0.0)
        if source.max_pulse_rate_hz == 0.0 or start_s >= min(end_s, time_limit_s):
            yield f'sources "{source.name}": does not discharge within the mission'
            continue
        places = [scenario.yard.site_position(site) for site in scenario.candidate_sites(source)]
        places = places or [source.position_m or (0.0, 0.0, source.anywhere_at_m)]
        heights_m = np.array([place[2] for place in places])
        range_m = max(float(np.abs(heights_m - scenario.array.height_m).min()), room_m)
        peak_v = source.max_amplitude_v * receiver.front_end.pulse_peak
        drift_db = max(source.drift_db_per_min * min(end_s, time_limit_s) / 60.0, 0.0)
        level_db = 20 * np.log10(peak_v / range_m / receiver.threshold_v) + drift_db
        if level_db < -REFLECTION_MARGIN_DB:
            yield (
                f'sources "{source.name}": cannot be detected: below it, {range_m:.1f} m away, its strongest pulse '
                f"is {-level_db:.0f} dB below the trigger level"
            )
