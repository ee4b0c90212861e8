"""Locate discharges in field data; the result is a log like that of a mission."""

import math
from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import version
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError
from threadpoolctl import threadpool_limits

from dirmusic import (
    ArrayModel,
    ElementSpread,
    Finding,
    GainManifold,
    GaussianPattern,
    InputFileError,
    Locator,
    PoseError,
    PulseBatch,
    read_pattern,
)
from dirmusic.array.beam import describe_beam
from dirmusic.array.element_errors import UNEXPLAINED
from dirmusic.array.manifold import check_azimuths_differ, ring_boresights_rad
from dirmusic.arrays import FloatArray
from dirmusic.bearing.channel_health import ChannelMonitor
from dirmusic.bearing.maximum_likelihood import maximum_likelihood
from dirmusic.locating.rules import LocatingRules
from pdpatrol.envs.scenario import Scenario, load_scenario
from pdpatrol.envs.scenario.array import read_calibration
from pdpatrol.envs.scenario.base import error_lines
from pdpatrol.envs.scenario.map import GeoreferenceConfig, MapConfig
from pdpatrol.envs.scenario.radio import surroundings_of
from pdpatrol.envs.scenario.robot import PoseSensorConfig
from pdpatrol.missions.field.doubts import doubts
from pdpatrol.missions.field.field_data import FieldData
from pdpatrol.missions.field.survey import SurveyOptions
from pdpatrol.missions.record.log_contents import describe_array
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.tracking import Tracker
from pdpatrol.robot_models.world import describe_equipment
from pdpatrol.sensing import ArrayConfig, ElementConfig
from pdpatrol.sensing.radio.transmission import Sight

TABLE_RULES = LocatingRules(refit_share=0.03)
"""Rules for a complete table. Its fits become rarer (assumed): often enough that a new source becomes one finding and
not several, and a few hundred in a survey of several hours."""

USUAL_CHANNELS = (4, 6)
"""Numbers of channels of the default array: a ring of six, or its first four."""

CATCH_UP_S = 1e9
"""Time between fits while steps of the past are added: longer than any survey."""


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


class FieldLocator:
    """Estimates bearings and findings from the steps of a survey, batch by batch, and logs them.

    The times of refits depend on the times of the steps only.

    Args:
        data: First data of the survey, from which the channels of the array and the bounds of the log are taken; they
            are not located yet.
        survey: Array, poses, yard and date.
        rules: Rules of the Locator.
        margin_m: Width of the margin that the log shows around the poses of `data`, if the yard is not given.

    Attributes:
        log: Log of a mission without robot, yard and truth.
        data_sheet: Gains of the live channels as in the data sheet, without the calibration.

    Raises:
        InputFileError: If the pattern, the boresights or the calibration cannot be used for the array.
    """

    def __init__(
        self, data: FieldData, survey: SurveyOptions, rules: LocatingRules = TABLE_RULES, margin_m: float = 10.0
    ) -> None:
        array = array_model(data, survey)
        self.data_sheet = array.manifold
        self._calibration = survey.calibration and read_calibration(survey.calibration)
        if self._calibration is not None:
            if mismatch := self._calibration.mismatch(array, None):
                raise InputFileError([f"--calibration: {mismatch}"])
            array = self._calibration.applied_to(array)
        pose_error = PoseError(
            position_m=survey.position_std_m,
            heading_rad=math.radians(survey.heading_std_deg),
            correlation_s=survey.pose_correlation_s,
        )
        scenario = _scenario_of(array, survey)
        fence_m, sight = survey.yard_m, None
        if scenario is not None:
            fence_m, sight = scenario.yard.size_m, Sight(surroundings_of(scenario.yard))
        low, high = data.pose[:, :2].min(axis=0) - margin_m, data.pose[:, :2].max(axis=0) + margin_m
        bounds_m = [low.tolist(), high.tolist()] if fence_m is None else [[0.0, 0.0], list(fence_m)]
        self.log = MissionLog(_meta(data, array, survey, scenario, bounds_m))
        if survey.pattern is not None:
            self.log.event("note", f"pattern {survey.pattern.name}: {describe_beam(array.manifold.pattern)}")
        if survey.boresights_deg is None and data.n_recorded not in USUAL_CHANNELS:
            text = f"boresights of {data.n_recorded} channels are assumed, evenly spaced clockwise from 90 degrees"
            self.log.event("note", f"{text}; give --boresights-deg if they are others, or a channel is not an antenna")
        self._name, self._channels = ", ".join(filter(None, (data.path.name, survey.date))), data.channels
        self._monitor = ChannelMonitor(array, maximum_likelihood)
        self._locator = Locator(array, pose_error, fence_m=fence_m, rules=rules, sight=sight)
        self._tracker = Tracker(self.log, self._locator, array, pose_error, rules.max_std_rad)
        self._n_clipped = 0

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Findings so far."""
        return self._tracker.findings

    def add(
        self, data: FieldData, progress: Callable[[float], None] = lambda share: None, *, is_end: bool = False
    ) -> None:
        """Locate with the next steps of the survey.

        Args:
            data: Pulses with their poses, in the channels of the first data.
            progress: Called with the share of the steps that was located since the last call.
            is_end: Fit all pulses again with those of the last step.
        """
        with threadpool_limits(limits=1):
            pulses, suspects = self._monitor.watch(data.pulses)
            for suspect in suspects:  # numbered as in the files, including the dead channels
                recorded = suspect._replace(channel=int(self._channels[suspect.channel - 1]) + 1)
                self.log.event("channel fault", f"{recorded}: left out", suspect.channel)
            self._n_clipped += np.count_nonzero(pulses.is_overdriven)
            first = np.searchsorted(data.step, np.arange(data.time_s.size + 1))
            for step, (time_s, pose) in enumerate(zip(data.time_s.tolist(), data.pose, strict=True)):
                of_step = pulses.take(slice(first[step], first[step + 1]))
                self._add_step(time_s, pose, of_step, is_last=is_end and step == data.time_s.size - 1)
                progress(1.0 / data.time_s.size)

    def catch_up(self, data: FieldData) -> None:
        """Locate with steps of the past: fit only once, at their end."""
        rules = self._locator.rules
        self._locator.rules = replace(rules, refit_s=CATCH_UP_S)
        try:
            self.add(data)
        finally:
            self._locator.rules = rules
        with threadpool_limits(limits=1):
            self._tracker.refit(float(data.time_s[-1]))

    def _add_step(self, time_s: float, pose: FloatArray, pulses: PulseBatch, *, is_last: bool) -> None:
        no_pose = np.full(3, np.nan)
        self.log.append(
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
        self._tracker.track(time_s, pose, pulses, is_last=is_last)

    def finish(self) -> MissionLog:
        """Complete the log; at least one step must have been added."""
        with threadpool_limits(limits=1):
            n_pulses, n_used = self.log.n_rows("pulse"), self.log.n_rows("bearing")
            if n_pulses and not n_used:
                self.log.event(
                    "rejected",
                    f"all {n_pulses} pulses were rejected: {self._n_clipped} clipped, the others too weak for the "
                    "noise (deviations, volts?)",
                )
            self._tracker.finish(self._name, None, self._calibration)
            self._tracker.renumber()
        if n_used and not self.log.column("association", "finding").any():
            text = (
                f"no finding explains any of {n_used} pulses: few poses, or wrong boresights, pattern or order of "
                "channels?"
            )
            self.log.event("note", text)
        self.log.event("end", "survey over: all rows read", subject="all rows read")
        return self.log


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
    locator = FieldLocator(data, survey)
    for note in (*data.notes, *doubts(data, locator.data_sheet, survey)):
        locator.log.event("note", note)
    locator.add(data, progress, is_end=True)
    return locator.finish()


def _scenario_of(array: ArrayModel, survey: SurveyOptions) -> Scenario | None:
    """Return the yard, receiver and level of inspection of `--yard`, with the array that took the data; None without.

    Raises:
        InputFileError: If the file or the array cannot be used.
    """
    if survey.yard is None:
        return None
    if survey.yard_m is not None:
        raise InputFileError(["--yard-m: must not be given with --yard, which states the size of the yard"])
    file = load_scenario(str(survey.yard))
    try:
        return Scenario(
            name=file.name,
            yard=file.known_yard,
            map=MapConfig(accuracy_m=file.map.accuracy_m),
            route=file.route,
            robot=file.robot,
            receiver=file.receiver,
            inspection=file.inspection,
            georeference=file.georeference,
            survey=file.survey,
            array=ArrayConfig(
                elements=tuple(ElementConfig(azimuth_deg=float(a)) for a in np.degrees(array.manifold.boresights_rad)),
                ring_radius_m=survey.ring_radius_m,
                height_m=survey.height_m,
                pattern=None if survey.pattern is None else str(survey.pattern.absolute()),
                gain_error=survey.gain_error,
                pointing_error_deg=survey.pointing_error_deg,
                gain_offset=survey.gain_offset,
                serial_number=file.array.serial_number,
            ),
            pose_sensor=PoseSensorConfig(
                position_std_m=survey.position_std_m,
                heading_std_deg=survey.heading_std_deg,
                correlation_s=survey.pose_correlation_s,
            ),
        )
    except ValidationError as error:
        raise InputFileError([f"--yard {survey.yard}: {line}" for line in error_lines(error, Scenario)]) from None


def _meta(
    data: FieldData, array: ArrayModel, survey: SurveyOptions, scenario: Scenario | None, bounds_m: list[list[float]]
) -> dict[str, Any]:
    """Return the metadata of the survey."""
    meta: dict[str, Any] = {
        "versions": {name: version(name) for name in ("pdpatrol", "numpy", "scipy")},
        "name": data.path.stem,
        "seed": None,
        "policy": None,
        "date": survey.date,
        "field_data": {
            "file": data.path.name,
            "n_channels": data.n_recorded,
            "channels": data.channels.tolist(),
        },
        "n_elements": array.manifold.n_elements,
        "array": describe_array(array),
        "bounds_m": bounds_m,
        "settings": {"survey": TypeAdapter(SurveyOptions).dump_python(survey, mode="json")},
    }
    if survey.georeference is not None:
        meta["georeference"] = dict(zip(GeoreferenceConfig.model_fields, survey.georeference, strict=True))
    if scenario is not None:
        yard = scenario.yard
        meta["scenario"] = scenario.model_dump(mode="json")
        meta["sites"] = {name: yard.site_position(name).tolist() for name in yard.site_names()}
        meta["solids"] = {"map": describe_equipment(yard.equipment)}
    return meta
