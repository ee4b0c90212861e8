"""Locate discharges in field data; the result is a log like that of a mission."""

import math
from collections.abc import Callable
from importlib.metadata import version
from typing import Any

import numpy as np
from pydantic import TypeAdapter
from threadpoolctl import threadpool_limits

from dirmusic import (
    ArrayModel,
    ElementSpread,
    GainManifold,
    GaussianPattern,
    InputFileError,
    Locator,
    PoseError,
    read_pattern,
)
from dirmusic.array.beam import describe_beam
from dirmusic.array.element_errors import UNEXPLAINED
from dirmusic.array.manifold import check_azimuths_differ, ring_boresights_rad
from dirmusic.bearing.channel_health import ChannelMonitor
from dirmusic.bearing.maximum_likelihood import maximum_likelihood
from dirmusic.locating.rules import LocatingRules
from pdpatrol.envs.scenario.array import read_calibration
from pdpatrol.missions.field.field_data import FieldData
from pdpatrol.missions.field.survey import SurveyOptions
from pdpatrol.missions.record.log_contents import describe_array
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.tracking import Tracker

FIELD_RULES = LocatingRules(refit_s=np.inf)
"""Rules for data recorded by people, which are refitted when `locate_field_data` decides."""


def array_model(data: FieldData, survey: SurveyOptions) -> ArrayModel:
    """Return the model of the live channels of the array that took the data.

    Raises:
        InputFileError: If the numbers of boresights and channels differ, the pattern cannot be used, or the array
            cannot distinguish two directions.
    """
    n = data.n_recorded
    if survey.boresights_deg is None:
        boresights = ring_boresights_rad(6 if n == 4 else n)[:n]
    else:
        boresights = np.radians(survey.boresights_deg)
    if boresights.size != n:
        raise InputFileError([f"--boresights-deg must have one number per channel, {n}, got {boresights.size}"])
    pattern = GaussianPattern() if survey.pattern is None else read_pattern(survey.pattern)
    try:
        complete = GainManifold(pattern, boresights)
        check_azimuths_differ(complete)
        manifold = complete.take(data.channels)
    except ValueError as error:
        raise InputFileError([f"--pattern, --boresights-deg: {error}"]) from None
    forward, left = np.cos(manifold.boresights_rad), np.sin(manifold.boresights_rad)
    positions_m = [survey.ring_radius_m * forward, survey.ring_radius_m * left, np.full(left.size, survey.height_m)]
    spread = ElementSpread(
        gain=survey.gain_error,
        pointing_rad=math.radians(survey.pointing_error_deg),
        offset=survey.gain_offset / math.sqrt(3),
        unexplained=UNEXPLAINED,
    )
    return ArrayModel(manifold=manifold, positions_m=np.stack(positions_m, axis=-1), spread=spread)


def locate_field_data(
    data: FieldData, survey: SurveyOptions, progress: Callable[[float], None] = lambda share: None
) -> MissionLog:
    """Estimate bearings and findings, and return them as the log of a mission without robot, yard and truth.

    Args:
        data: Pulses with their poses, as read from the table.
        survey: Array, poses, yard and date.
        progress: Called with the share of the work that was done since the last call.

    Raises:
        InputFileError: If the pattern, the boresights or the calibration cannot be used for the array.
    """
    array = array_model(data, survey)
    calibration = survey.calibration and read_calibration(survey.calibration)
    if calibration is not None:
        if mismatch := calibration.mismatch(array, None):
            raise InputFileError([f"--calibration: {mismatch}"])
        array = calibration.applied_to(array)
    pose_error = PoseError(
        position_m=survey.position_std_m,
        heading_rad=math.radians(survey.heading_std_deg),
        correlation_s=survey.pose_correlation_s,
    )
    log = MissionLog(_meta(data, array, survey))
    locator = Locator(array, pose_error, fence_m=survey.yard_m, rules=FIELD_RULES)
    tracker = Tracker(log, locator, array, pose_error, FIELD_RULES.max_std_rad)
    with threadpool_limits(limits=1):
        pulses, suspects = ChannelMonitor(array, maximum_likelihood).watch(data.pulses)
        for note in data.notes:
            log.event("note", note)
        if survey.pattern is not None:
            log.event("note", f"pattern {survey.pattern.name}: {describe_beam(array.manifold.pattern)}")
        for suspect in suspects:  # numbered as in the files, including the dead channels
            recorded = suspect._replace(channel=int(data.channels[suspect.channel - 1]) + 1)
            log.event("channel fault", f"{recorded}: left out")
        first = np.searchsorted(data.step, np.arange(data.time_s.size + 1))
        no_pose, due_s = np.full(3, np.nan), data.time_s[0] + 1.0
        for step, (time_s, pose) in enumerate(zip(data.time_s.tolist(), data.pose, strict=True)):
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
            tracker.track(time_s, pose, pulses.take(slice(first[step], first[step + 1])))
            if time_s >= due_s or 0 < step == data.time_s.size - 1:  # in the first step, `track` fits
                tracker.refit(time_s)
                # Assumed; often enough that a new source becomes one finding and not several, and a survey of several
                # hours is refitted only a few hundred times.
                due_s = time_s + max(1.0, 0.02 * (time_s - data.time_s[0]))
            progress(1.0 / data.time_s.size)
    if pulses.n_pulses and not log.n_rows("bearing"):
        n_clipped = np.count_nonzero(pulses.is_overdriven)
        log.event(
            "rejected",
            f"all {pulses.n_pulses} pulses were rejected: {n_clipped} clipped, the others too weak for the noise "
            "(deviations, volts?)",
        )
    tracker.finish(data.path.name, None, calibration)
    if (n_used := log.n_rows("bearing")) and not log.column("association", "finding").any():
        text = (
            f"no finding explains any of {n_used} pulses: few poses, or wrong boresights, pattern or order of channels?"
        )
        log.event("note", text)
    log.event("end", "survey over: all rows read", subject="all rows read")
    return log


def _meta(data: FieldData, array: ArrayModel, survey: SurveyOptions) -> dict[str, Any]:
    """Return the metadata of the survey."""
    low, high = data.pose[:, :2].min(axis=0) - 10.0, data.pose[:, :2].max(axis=0) + 10.0  # shown around the poses
    return {
        "versions": {name: version(name) for name in ("pdpatrol", "numpy", "scipy")},
        "name": data.path.stem,
        "seed": None,
        "policy": None,
        "date": survey.date,
        "field_data": {"file": data.path.name},
        "n_elements": array.manifold.n_elements,
        "array": describe_array(array),
        "bounds_m": [low.tolist(), high.tolist()] if survey.yard_m is None else [[0.0, 0.0], survey.yard_m],
        "settings": {"survey": TypeAdapter(SurveyOptions).dump_python(survey, mode="json")},
    }
