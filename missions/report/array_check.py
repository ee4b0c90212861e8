"""Comparison of the strengths of a mission's findings with the data sheet of the array."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from dirmusic.angles import wrap
from dirmusic.arrays import FloatArray
from pdpatrol.missions.record.finding_pulses import finding_pulses
from pdpatrol.missions.record.log_contents import array_height_of, described_manifold
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.records import ArrayCheck, GainInMission, MisfitInMission

ANGLE_STEP_DEG = 10
"""Width of a bin of angles off boresight."""

RANGE_EDGES_M = (0.0, 2.0, 4.0, 8.0, 16.0, np.inf)
"""Edges of the bins of range."""

LEAST_PULSES = 5
"""Least number of pulses of a bin that is shown (assumed)."""


def check_array(log: MissionLog) -> ArrayCheck | None:
    r"""Compare the strengths of the pulses of confirmed findings with those by the data sheet.

    With the nominal gains :math:`G_i` towards the finding, the amplitude of a pulse with the strengths :math:`s_i` is
    estimated as :math:`A = \sum s_i G_i / \sum G_i^2`. The gain in a bin is then :math:`\sum A s_i / \sum A^2`, and
    that by the data sheet :math:`\sum A^2 G_i / \sum A^2`. Only ratios of gains are known; strong pulses count
    most. Channels that were found faulty are left out.

    Args:
        log: Log of a mission that has ended.

    Returns:
        The comparison; None without a confirmed finding that has pulses, and for another Locator than the built-in one.
    """
    if "array_estimate" not in log.meta:
        return None
    finding, pulse, pose = log.table("finding"), log.table("pulse"), log.column("step", "pose")
    manifold, height_m, event = described_manifold(log.meta["array"]), array_height_of(log), log.table("event")
    is_faulty = np.isin(np.arange(manifold.n_elements) + 1, event["number"][event["kind"] == "channel fault"])
    sound = np.flatnonzero(~is_faulty)
    manifold = manifold.take(sound)
    parts: list[tuple[FloatArray, ...]] = []
    for number, pulses in finding_pulses(log).items():
        position_m, state = (finding[name][finding["id"] == number][-1] for name in ("position_m", "state"))
        if state != "confirmed":
            continue
        sight_m = position_m[:2] - pose[pulse["step"][pulses.pulse], :2]
        heading_rad = pose[pulse["step"][pulses.pulse], 2]
        off_rad = (np.arctan2(*sight_m.T[::-1]) - heading_rad)[:, np.newaxis] - manifold.boresights_rad
        elevation_rad = np.arctan2(position_m[2] - height_m, np.maximum(pulses.range_m, 0.1))
        nominal = manifold.response_in_space(off_rad, elevation_rad[:, np.newaxis]).gain
        strength_v = pulse["strengths_v"][np.ix_(pulses.pulse, sound)]
        amplitude_v = (strength_v * nominal).sum(axis=-1, keepdims=True) / np.square(nominal).sum(
            axis=-1, keepdims=True
        )
        parts.append((strength_v, amplitude_v, nominal, np.degrees(wrap(off_rad)), pulses.range_m))
    if not parts:
        return None
    strength_v, amplitude_v, nominal, off_deg, range_m = (np.concatenate(part) for part in zip(*parts, strict=True))
    measured, expected = amplitude_v * strength_v, np.square(amplitude_v) * nominal
    misfit = np.linalg.norm(strength_v - amplitude_v * nominal, axis=-1) / np.linalg.norm(strength_v, axis=-1)
    gains: list[GainInMission] = []
    bins = np.floor(off_deg / ANGLE_STEP_DEG)
    for start in np.unique(bins):
        own = bins == start
        if own.sum() >= LEAST_PULSES:
            power = np.broadcast_to(np.square(amplitude_v), own.shape)[own].sum()
            gain = GainInMission(
                off_boresight_deg=(start + 0.5) * ANGLE_STEP_DEG,
                measured_db=float(_in_db(measured[own].sum() / power)),
                data_sheet_db=float(_in_db(expected[own].sum() / power)),
            )
            gains.append(gain)
    ranges = [
        MisfitInMission(from_m=low, n_pulses=int(own.sum()), misfit=float(np.median(misfit[own])))
        for low, high in pairwise(RANGE_EDGES_M)
        if (own := (range_m >= low) & (range_m < high)).sum() >= LEAST_PULSES
    ]
    by_channel = measured.sum(axis=0) / expected.sum(axis=0)
    estimate = log.meta["array_estimate"]
    return ArrayCheck(
        beam_width=estimate["beam_width"],
        beam_width_std=estimate["beam_width_std"],
        yaw_deg=np.degrees(estimate["yaw_rad"]),
        yaw_std_deg=np.degrees(estimate["yaw_std_rad"]),
        pattern_error=estimate["pattern_error"],
        contradictions=tuple(event["text"][event["kind"] == "array"].tolist()),
        by_channel_db=dict(zip((sound + 1).tolist(), _in_db(by_channel).tolist(), strict=True)),
        by_angle=tuple(gains),
        by_range=tuple(ranges),
    )


def _in_db(ratio: FloatArray) -> FloatArray:
    """Convert ratios of amplitudes to decibels; those below -60 dB become -60 dB."""
    return 20.0 * np.log10(np.maximum(ratio, 1e-3))
