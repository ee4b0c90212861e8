"""Locate discharges in field data; the result is a log like that of a mission."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from dirmusic import (
    ArrayModel,
    ElementSpread,
    GainManifold,
    GainPattern,
    GaussianPattern,
    InputFileError,
    Locator,
    PoseError,
    PulseBatch,
)
from dirmusic.bearing.channel_health import ChannelMonitor
from dirmusic.bearing.maximum_likelihood import maximum_likelihood
from dirmusic.locating.rules import LocatingRules
from pdpatrol.envs.scenario.array import ArrayCalibration
from pdpatrol.missions.field.field_data import FieldData
from pdpatrol.missions.record.log_contents import describe_array
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.tracking import Tracker

FloatArray = NDArray[np.float64]

FIELD_RULES = LocatingRules(
    initiation_s=np.inf,
    initiation_pulses=4,
    initiation_by_crossing=True,
    confirm_range_m=np.inf,
    confirm_pulses=10,
    refit_s=np.inf,
)
"""Rules for data recorded by people. Assumed; minutes may pass between poses, each pose gives few pulses, and nobody
can be sent nearer. Lines of sight must still cross at an angle, and the ellipse must be small."""


def array_model(
    data: FieldData,
    spread: ElementSpread,
    pattern: GainPattern | None = None,
    boresights_deg: Sequence[float] | None = None,
    ring_radius_m: float = 0.12,
    height_m: float = 0.6,
) -> ArrayModel:
    """Return the model of the live channels of the array that took the data.

    Args:
        data: Pulses, with the numbers of the live channels.
        spread: Deviations of such arrays from their data sheet.
        pattern: Pattern of every element; None for eq. (1) of the Dir-MUSIC paper.
        boresights_deg: Azimuth of each recorded channel's element; None for an evenly spaced ring; four channels are
            taken as the first four of six elements.
        ring_radius_m: Radius of the ring.
        height_m: Height of the ring above the ground.

    Raises:
        InputFileError: If the numbers of boresights and channels differ, or the pattern is omnidirectional.
    """
    n = data.n_recorded
    if boresights_deg is not None and len(boresights_deg) != n:
        raise InputFileError([f"--boresights-deg must have one number per channel, {n}, got {len(boresights_deg)}"])
    if boresights_deg is None:
        boresights = np.array(GainManifold.ring(6 if n == 4 else n).boresights_rad[:n])
    else:
        boresights = np.radians(boresights_deg)
    try:
        manifold = GainManifold(pattern or GaussianPattern(), boresights).take(data.channels)
    except ValueError as error:
        raise InputFileError([f"--pattern, --boresights-deg: {error}"]) from None
    ring = ring_radius_m * np.stack([np.cos(boresights), np.sin(boresights)], axis=-1)
    positions = np.column_stack([ring, np.full(n, height_m)])
    return ArrayModel(manifold=manifold, positions_m=positions[data.channels], spread=spread)


def calibrated(array: ArrayModel, calibration: ArrayCalibration) -> ArrayModel:
    """Return the array with the errors estimated from earlier data.

    Raises:
        InputFileError: If the calibration belongs to another array.
    """
    mismatch = calibration.mismatch(array, None)
    if mismatch is not None:
        raise InputFileError([f"--calibration: {mismatch}"])
    return calibration.applied_to(array)


def locate_field_data(
    data: FieldData,
    array: ArrayModel,
    pose_error: PoseError,
    *,
    fence_m: tuple[float, float] | None = None,
    date: str | None = None,
    calibration: ArrayCalibration | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> MissionLog:
    """Estimate bearings and findings, and return them as the log of a mission without robot, yard and truth.

    Args:
        data: Pulses with their poses, as read from the table.
        array: Data sheet and spread of the live channels, with the errors of a calibration.
        pose_error: Standard deviations of the poses.
        fence_m: Length of the yard along x and y from its corner at the origin; None without a fence.
        date: Date of the survey, such as 2026-03-02; None if unknown.
        calibration: Calibration that the errors of the array come from.
        progress: Called with the share of the work that was done since the last call.
    """
    log = MissionLog({**_meta(data, array, pose_error, fence_m), "date": date})
    rules, due_s, estimator = FIELD_RULES, -np.inf, maximum_likelihood
    locator = Locator(array, pose_error, fence_m=fence_m, rules=rules)
    tracker = Tracker(log, locator, array, pose_error, estimator, rules.credibility)
    with threadpool_limits(limits=1):
        monitor = ChannelMonitor(array, estimator)
        pulse_time_s = data.time_s[data.step]
        pulses, suspects = monitor.watch(
            PulseBatch.detected(pulse_time_s, data.strengths_v, data.variance_v2, data.mains_phase_rad)
        )
        first = np.searchsorted(data.step, np.arange(data.time_s.size + 1))
        no_pose = np.full(3, np.nan)
        for step, (time_s, pose) in enumerate(zip(data.time_s, data.pose, strict=True)):
            log.append(
                "step",
                time_s=time_s,
                pose=pose,
                true_pose=no_pose,
                odometry=no_pose,
                battery=np.nan,
                command=no_pose[:2],
                phase="field",
                phase_target=0,
            )
            if step == 0:
                for note in data.notes:
                    log.event("note", note)
                for suspect in suspects:  # numbered as in the files, including the dead channels
                    recorded = suspect._replace(channel=int(data.channels[suspect.channel - 1]) + 1)
                    log.event("channel fault", f"{recorded}: left out")
            tracker.track(float(time_s), pose, pulses.take(slice(first[step], first[step + 1])))
            if time_s >= due_s:
                tracker.refit(float(time_s))
                # Assumed; often enough that a new source becomes one finding and not several, and a survey of several
                # hours is refitted only a few hundred times.
                due_s = time_s + max(1.0, 0.02 * (time_s - data.time_s[0]))
            progress(1.0 / data.time_s.size)
        if log.n_rows("finding") == 0 or log.column("finding", "step")[-1] < data.time_s.size - 1:
            tracker.refit(float(data.time_s[-1]))
    if pulses.n_pulses and not log.n_rows("bearing"):
        n_weak = int(np.count_nonzero(pulses.std_rad >= rules.credibility.max_std_rad))
        log.event(
            "rejected",
            f"all {pulses.n_pulses} pulses were rejected: {n_weak} too weak for the noise (deviations, volts?), the "
            "others not a plane wave from one direction (boresights, pattern, order of channels?)",
        )
    tracker.finish(data.path.name, None, calibration)
    log.event("end", "survey over: all rows read", subject="all rows read")
    return log


def _meta(
    data: FieldData, array: ArrayModel, pose_error: PoseError, fence_m: tuple[float, float] | None
) -> dict[str, Any]:
    """Return the metadata of the survey; the assumed errors are stored under the keys of a scenario."""
    low, high = data.pose[:, :2].min(axis=0) - 10.0, data.pose[:, :2].max(axis=0) + 10.0  # shown around the poses
    if fence_m is not None:
        low, high = np.zeros(2), np.asarray(fence_m)
    return {
        "versions": {name: version(name) for name in ("pdpatrol", "numpy", "scipy")},
        "name": data.path.stem,
        "seed": None,
        "policy": None,
        "field_data": {"file": data.path.name, "channels": (data.channels + 1).tolist(), "recorded": data.n_recorded},
        "n_elements": array.manifold.n_elements,
        "array": describe_array(array),
        "bounds_m": [low.tolist(), high.tolist()],
        "settings": {
            "array": {
                "n_elements": array.manifold.n_elements,
                "height_m": array.height_m,
                "gain_error": array.spread.gain,
                "pointing_error_deg": float(np.degrees(array.spread.pointing_rad)),
            },
            "pose_sensor": {
                "position_std_m": pose_error.position_m,
                "heading_std_deg": float(np.degrees(pose_error.heading_rad)),
                "correlation_s": pose_error.correlation_s,
            },
        },
    }
