"""Inspection of the sites of the map: at which of them a discharge of a stated level and rate is excluded."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from dirmusic import InputFileError
from dirmusic.angles import azimuth_of, difference
from dirmusic.arrays import BoolArray, FloatArray, IntArray
from dirmusic.locating.finding import is_inside95
from pdpatrol.envs.scenario import restore_scenario
from pdpatrol.envs.scenario.radio import surroundings_of
from pdpatrol.missions.planning.confirmation_probability import (
    CERTAIN,
    WINDOW_S,
    ConfirmationModel,
    Passes,
    Traces,
    Views,
)
from pdpatrol.missions.record.log_contents import known_yard
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.make_report import findings_at
from pdpatrol.missions.report.records import SiteInspection, SiteInspections
from pdpatrol.sensing.radio.transmission import Sight

STEP_S = 0.5
"""Time between the poses that are used. Assumed; at 0.8 m/s, aspects change by 5 degrees at 5 m."""

TOWARDS_SITE_RAD, TOWARDS_FINDING_RAD = np.radians(20.0), np.radians(10.0)
"""Deviations of bearings within which a pulse may come from a site, or comes from a finding. Assumed: a pulse that a
wrong antenna or multipath turns by 20 degrees still counts against the site. With 15 degrees for findings, one in
fifteen inspected sites is lost; below it, diffracted pulses of strong sources count against sites behind them."""

WEAKER_DB = 6.0
"""Level below that expected of a discharge from which a pulse cannot come from it. Assumed; 1.5 times the spread."""

STRONG_DB = 6.0
"""Level over the trigger from which a pulse should have a usable direction, whatever the noise. Assumed."""

APART_M = 2.0
"""Horizontal distance from a finding within which a site is not judged, because a second discharge there may be merged
with the first; nor is one within the 95 % ellipse of a confirmed finding. Assumed; the cut-off of scores."""

MOST_UNEXPLAINED = 0.5
"""Relative error of the strengths that no source explains beyond which findings are not trusted. Assumed: the largest
in sound missions is 0.3; a fit that takes pulses of another place reaches its limit of 1."""

LEVELS_DBV = np.arange(-44.0, 21.0, 3.0)
RATES_HZ = np.array([0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0])
"""Levels and rates among which the weakest excluded ones are searched."""


class Pulses(NamedTuple):
    """Pulses of a mission, n rows.

    Attributes:
        row: Row of `Passes` in which each was detected, shape (n,).
        bearing_rad: Bearing, world frame; NaN without one, shape (n,).
        level_db: Strength in the strongest sound channel, dB relative to 1 V, shape (n,).
        is_open: True for pulses that may come from a site: they belong to no confirmed finding and none beyond the
            fence, and do not come from the direction of one, shape (n,).
        has_direction: True for those that come from a site only if they point at it, shape (n,).
        usable: Share of the strong pulses that the Locator uses.
    """

    row: IntArray
    bearing_rad: FloatArray
    level_db: FloatArray
    is_open: BoolArray
    has_direction: BoolArray
    usable: float


def inspect_sites(log: MissionLog) -> SiteInspections | None:
    """Determine at which sites the mission excludes a discharge of the level and rate that its scenario states.

    Channels that were found faulty count as faulty from the start. When most strong pulses belong to no finding, the
    bearings cannot be trusted, and those pulses count against every site. When the findings explain their own pulses
    badly, all pulses do.

    Args:
        log: Log of the mission.

    Returns:
        Inspection of the sites; None without a map, without sites on it, or if a file that the scenario names no longer
        exists.
    """
    yard, time_s = known_yard(log), log.column("step", "time_s")
    if yard is None or not yard.site_names():
        return None
    events = log.table("event")
    is_fault = events["kind"] == "channel fault"
    heading_rad = float(log.column("frame", "pose_std")[-1, 1]) if log.n_rows("frame") else None
    try:
        scenario = restore_scenario(log.meta["scenario"])
        channels = np.arange(1, scenario.array.n_channels + 1)
        is_sound = ~np.isin(channels, events["number"][is_fault])
        model = ConfirmationModel(scenario, Sight(surroundings_of(yard)), is_sound, heading_rad)
    except (InputFileError, OSError):
        return None
    step = np.unique(time_s // STEP_S, return_index=True)[1]
    duration_s = np.minimum(np.diff(time_s[step], append=time_s.max(initial=0.0)), WINDOW_S)
    passes = Passes(time_s[step], duration_s, log.column("step", "pose")[step])
    found = findings_at(log, time_s.size, "confirmed", "candidate", "outside")
    is_sure = found["state"] != "candidate"
    towards_rad = azimuth_of(found["position_m"][is_sure, np.newaxis, :2] - passes.pose[:, :2])
    n_doubtful = log.rows_before("pulse", int(events["step"][is_fault].max(initial=0)))
    pulses = _pulses(log, model, step, found["id"][is_sure], towards_rad, n_doubtful)
    level_dbv, rate_hz = scenario.inspection.level_dbv, scenario.inspection.rate_hz
    sites: list[SiteInspection] = []
    for name in yard.site_names():
        site_m = yard.site_position(name)
        views = model.views(passes, site_m)
        off_rad = np.abs(difference(towards_rad[:, views.row], views.aspect_rad + np.pi))
        is_open = (off_rad >= TOWARDS_FINDING_RAD).all(axis=0)
        traces = Traces(pulses.usable, is_open, _count(pulses, views, is_open, level_dbv))

        def noticed(level: float, rate: float, views: Views = views, traces: Traces = traces) -> float:
            return model.chances(views, level, rate, traces).noticed

        probability, state = noticed(level_dbv, rate_hz), "not_inspected"
        off_m, covariance_m2 = (found["position_m"] - site_m)[:, :2], found["covariance_m2"][:, :2, :2]
        is_near = (np.linalg.norm(off_m, axis=1) <= APART_M).any()
        if is_near or any(map(is_inside95, off_m[is_sure], covariance_m2[is_sure])):
            state = "finding"
        elif probability >= CERTAIN:
            state = "inspected"
        elif model.chances(views, level_dbv, rate_hz).noticed >= CERTAIN:
            state = "unexplained"
        weakest_db = slowest_hz = None
        if state != "finding":
            weakest_db = _least(LEVELS_DBV, lambda level, noticed=noticed: noticed(level, rate_hz))
            slowest_hz = _least(RATES_HZ, lambda rate, noticed=noticed: noticed(level_dbv, rate))
        sites.append(
            SiteInspection(
                name=name,
                state=state,
                probability=probability,
                min_level_db=weakest_db,
                min_rate_hz=slowest_hz,
                nearest_m=float(views.range_m.min()) if views.row.size else None,
            )
        )
    return SiteInspections(level_db=level_dbv, rate_hz=rate_hz, sites=tuple(sites))


def _pulses(
    log: MissionLog,
    model: ConfirmationModel,
    step: IntArray,
    sure: IntArray,
    towards_rad: FloatArray,
    n_doubtful: int,
) -> Pulses:
    """Return the pulses of a mission.

    Args:
        log: Log of the mission.
        model: Model with the sound channels.
        step: Steps of the rows of `Passes`, shape (n_rows,).
        sure: Numbers of the findings that are confirmed or beyond the fence, shape (n_sure,).
        towards_rad: Directions from the poses towards them, shape (n_sure, n_rows).
        n_doubtful: Number of pulses before the last channel was found faulty, whose bearings may be wrong.
    """
    pulse, bearing, owner = log.table("pulse"), log.table("bearing"), log.column("association", "finding")
    row = np.searchsorted(step, pulse["step"], side="right") - 1
    bearing_rad, is_owned = np.full(row.size, np.nan), np.zeros(row.size, dtype=np.bool_)
    bearing_rad[bearing["pulse"]] = bearing["bearing_rad"]
    is_owned[bearing["pulse"][: owner.size]] = np.isin(owner, sure)
    has_direction = np.arange(row.size) >= n_doubtful
    off_rad = np.abs(difference(bearing_rad, towards_rad[:, row])).min(axis=0, initial=np.inf)
    within_rad = np.where(is_owned, TOWARDS_SITE_RAD, TOWARDS_FINDING_RAD)
    is_open = np.where(has_direction, ~(off_rad < within_rad), ~is_owned)
    with np.errstate(divide="ignore"):
        level_db = 20 * np.log10(pulse["strengths_v"][:, model.is_sound].max(axis=1, initial=0.0))
    is_strong = level_db >= model.trigger_db + STRONG_DB
    if 2 * is_open[is_strong].sum() > is_strong.sum():  # most belong to no finding, so bearings may be wrong
        has_direction[:] = False
    if log.meta.get("array_estimate", {}).get("unexplained_error", 0.0) > MOST_UNEXPLAINED:
        is_open[:], has_direction[:] = True, False
    n_strong, n_good = int(is_strong.sum()), int((is_strong & pulse["is_used"]).sum())
    return Pulses(row, bearing_rad, level_db, is_open, has_direction, (n_good + 9) / (n_strong + 10))


def _count(pulses: Pulses, views: Views, is_open: BoolArray, level_dbv: float) -> IntArray:
    """Count the pulses in each window that may come from a site, in open views (mask); shape (n_windows,)."""
    if views.row.size == 0:
        return np.zeros(0, dtype=np.intp)
    view = np.minimum(np.searchsorted(views.row, pulses.row), views.row.size - 1)
    off_rad = np.abs(difference(pulses.bearing_rad, views.aspect_rad[view] + np.pi))
    comes = (views.row[view] == pulses.row) & is_open[view] & pulses.is_open
    comes &= pulses.level_db >= level_dbv + views.gain_db[view] - WEAKER_DB
    comes &= (off_rad <= TOWARDS_SITE_RAD) | ~pulses.has_direction
    return np.bincount(views.window[view[comes]], minlength=views.window[-1] + 1)


def _least(values: FloatArray, noticed: Callable[[float], float]) -> float | None:
    """Return the smallest of some ascending values from which on a discharge is noticed for certain; None if none."""
    first = bisect_left(values, CERTAIN, key=noticed)
    return float(values[first]) if first < values.size else None
