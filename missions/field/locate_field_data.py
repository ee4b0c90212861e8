"""Data from the field into a MissionLog: the same bearings, findings, report and recording as a mission has."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from dirmusic import ArrayModel, Locator, PoseError, PulseBatch
from dirmusic.bearing.channel_health import ChannelMonitor
from dirmusic.bearing.maximum_likelihood import MaximumLikelihood
from dirmusic.locating.rules import CredibilityRules, LocatingRules
from dirmusic.locating.yard_likelihood import Grid, YardLikelihood
from pdpatrol.envs.scenario.calibration import ArrayCalibration
from pdpatrol.missions.field.field_data import FieldData
from pdpatrol.missions.record.array_description import describe_array, describe_grid
from pdpatrol.missions.record.logbook import Logbook
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.tracking import Tracker

FloatArray = NDArray[np.float64]

REJECTED = "rejected"
"""Kind of the event that tells why no pulse at all was credible."""

MARGIN_M = 10.0
"""Ground that a recording shows around the poses."""

REFIT_S, REFIT_SHARE = 1.0, 0.02
"""All is fitted anew after so long, or so large a share of the time so far: soon enough that what has just come up is
one finding and not several, and some hundred times in hours (assumed)."""

FIELD_RULES = LocatingRules(
    birth_s=np.inf,
    birth_pulses=4,
    birth_by_crossing=True,
    confirm_range_m=np.inf,
    confirm_pulses=10,
    refit_s=np.inf,
)
"""Rules for data that were taken by people (assumed): minutes may pass between poses, few pulses come from each, and
nobody can be sent nearer. Lines of sight must open and the ellipse must be small all the same."""


def locate_field_data(
    data: FieldData,
    array: ArrayModel,
    pose_error: PoseError,
    *,
    fence_m: tuple[float, float] | None = None,
    date: str | None = None,
    calibration: ArrayCalibration | None = None,
    notes: tuple[str, ...] = (),
    progress: Callable[[float], None] = lambda share: None,
) -> MissionLog:
    """Bearings of all pulses and the findings they make, as the log of a mission without robot, yard and truth.

    Args:
        data: Pulses with their poses, as read from the table.
        array: Data sheet and spread of the live channels, with the errors that a calibration knows.
        pose_error: How wrong the poses may be.
        fence_m: Length of the yard along x and y, origin at its corner; None where there is no fence.
        date: When the data were taken, as 2026-03-02; None if nobody says.
        calibration: The one that the array has its errors from.
        notes: What was unusual about the files.
        progress: Told by how much of the whole the work has advanced.
    """
    meta = {**_meta(data, array, fence_m), "date": date, "settings": _settings(array, pose_error)}
    grid = Grid.over(*np.array(meta["bounds_m"]))
    log = MissionLog({**meta, "grid": describe_grid(grid)})
    rules, due_s = FIELD_RULES, -np.inf
    locator = Locator(array, pose_error, fence_m=fence_m, rules=rules)
    estimator, book = MaximumLikelihood(), Logbook(log)
    tracker = Tracker(locator, array, estimator, rules.credibility, YardLikelihood(array, pose_error, grid))
    with threadpool_limits(limits=1):
        monitor = ChannelMonitor(array, estimator)
        pulse_time_s = data.time_s[data.step]
        pulses, suspects = monitor.watch(
            PulseBatch.detected(pulse_time_s, data.strengths_v, data.variance_v2, data.mains_phase_rad)
        )
        first = np.searchsorted(data.step, np.arange(data.time_s.size + 1))
        no_pose, no_command = np.full(3, np.nan), np.full(2, np.nan)
        for step, (time_s, pose) in enumerate(zip(data.time_s, data.pose, strict=True)):
            log.append(
                "step",
                time_s=time_s,
                pose=pose,
                true_pose=no_pose,
                odometry=no_pose,
                battery=np.nan,
                command=no_command,
                phase="field",
            )
            if step == 0:
                for note in (*notes, *data.notes):
                    book.event("note", note)
                for suspect in suspects:  # counted as in the files, of which dead channels were dropped before
                    recorded = suspect._replace(channel=int(data.channels[suspect.channel - 1]) + 1)
                    book.event("channel fault", f"{recorded}: left out")
            book.log_tracked(pose, tracker.track(float(time_s), pose, pulses.take(slice(first[step], first[step + 1]))))
            if time_s >= due_s:
                book.log_findings(tracker.refit(float(time_s)))
                due_s = time_s + max(REFIT_S, REFIT_SHARE * (time_s - data.time_s[0]))
            progress(1.0 / data.time_s.size)
        if log.n_rows("finding") == 0 or log.column("finding", "step")[-1] < data.time_s.size - 1:
            book.log_findings(tracker.refit(float(data.time_s[-1])))
    if pulses.n_pulses and not log.n_rows("bearing"):
        book.event(REJECTED, _why_rejected(pulses, rules.credibility))
    book.log_contradiction(tracker.contradicts_calibration)
    book.log_association(tracker.association())
    book.log_likelihood(tracker.log_likelihood())
    learned = tracker.calibration(data.path.name, None, calibration)
    if learned is not None:
        log.meta["calibration"] = learned.model_dump(mode="json")
    book.event("end", "all rows read")
    return log


def rejections(log: MissionLog) -> list[str]:
    """Why all pulses were rejected, in one line; nothing if they were not."""
    events = log.table("event")
    return [str(text) for text in events["text"][events["kind"] == REJECTED]]


def _why_rejected(pulses: PulseBatch, rules: CredibilityRules) -> str:
    n_weak = int(np.count_nonzero(pulses.std_rad >= rules.max_std_rad))
    told = [
        (pulses.n_pulses - n_weak, "no plane wave from one direction (boresights, pattern, order of channels?)"),
        (n_weak, "too weak for the noise (deviations, volts?)"),
    ]
    fates = ", ".join(f"{number} {words}" for number, words in sorted(told, reverse=True) if number)
    return f"all pulses were rejected: {fates}"


def _meta(data: FieldData, array: ArrayModel, fence_m: tuple[float, float] | None) -> dict[str, Any]:
    low, high = data.pose[:, :2].min(axis=0) - MARGIN_M, data.pose[:, :2].max(axis=0) + MARGIN_M
    if fence_m is not None:
        low, high = np.zeros(2), np.asarray(fence_m)
    return {
        "versions": {name: version(name) for name in ("pdpatrol", "numpy", "scipy")},
        "name": Path(data.path).stem,
        "seed": None,
        "policy": None,
        "field_data": {"file": data.path.name, "channels": (data.channels + 1).tolist(), "recorded": data.n_recorded},
        "n_elements": array.manifold.n_elements,
        "array": describe_array(array),
        "bounds_m": [low.tolist(), high.tolist()],
    }


def _settings(array: ArrayModel, pose_error: PoseError) -> dict[str, dict[str, float]]:
    """What was believed of array and poses, under the names that a scenario has for it."""
    return {
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
    }
