"""Inspection of the sites of the map: in line of sight, near enough, and from enough directions to locate."""

from __future__ import annotations

import numpy as np

from dirmusic import InputFileError
from dirmusic.angles import aperture
from pdpatrol.envs.scenario.locating import LocatingConfig
from pdpatrol.envs.scenario.radio import surroundings_of
from pdpatrol.missions.driving.site_map import MIN_TRANSMISSION
from pdpatrol.missions.planning.detectability import AMPLITUDE_V, MARGIN_DB, DirectPaths
from pdpatrol.missions.record.log_contents import known_yard
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.records import SiteInspection, SiteInspections
from pdpatrol.sensing import ArrayConfig, ReceiverConfig
from pdpatrol.sensing.radio.transmission import Sight

PLACE_M = 0.25
"""Grid to which poses are rounded. Assumed; apertures change by about a degree at 10 m."""


def inspect_sites(log: MissionLog) -> SiteInspections | None:
    """Work out which sites the path driven allowed the robot to inspect, from its estimated poses.

    The discharge assumed is the one for which tours are planned.

    Returns:
        None without a map, without sites on it, or if the file of the array's pattern no longer exists.
    """
    yard = known_yard(log)
    if yard is None or not yard.site_names():
        return None
    scenario = log.meta["scenario"]
    locating = {key: value for key, value in scenario["locating"].items() if key not in ("locator", "calibration")}
    rules = LocatingConfig.model_validate(locating, strict=False).rules()
    array = ArrayConfig.model_validate(scenario["array"], strict=False)
    receiver = ReceiverConfig.model_validate(scenario["receiver"], strict=False)
    try:
        paths = DirectPaths(array, receiver, Sight(surroundings_of(yard)))
    except (InputFileError, OSError):
        return None
    assumed_db = float(20 * np.log10(AMPLITUDE_V))
    places_m = np.unique(np.round(log.column("step", "pose")[:, :2] / PLACE_M), axis=0) * PLACE_M
    sites: list[SiteInspection] = []
    for name in yard.site_names():
        site_m = yard.site_position(name)
        offset_m = places_m - site_m[:2]
        range_m = np.linalg.norm(offset_m, axis=-1)
        near = range_m <= rules.confirm_range_m
        transmitted, level_db = paths.levels(places_m[near], site_m)
        in_sight = transmitted >= MIN_TRANSMISSION
        detects = in_sight & (level_db >= MARGIN_DB)
        aperture_rad = aperture(np.arctan2(offset_m[near, 1], offset_m[near, 0])[detects])
        is_wide = detects.any() and aperture_rad >= rules.confirm_aperture_rad
        sites.append(
            SiteInspection(
                name=name,
                state="inspected" if is_wide else "partly_inspected" if detects.any() else "not_inspected",
                nearest_m=float(range_m[near][in_sight].min()) if in_sight.any() else None,
                aperture_deg=float(np.degrees(aperture_rad)),
                min_level_db=assumed_db + MARGIN_DB - float(level_db[in_sight].max()) if in_sight.any() else None,
            )
        )
    return SiteInspections(
        range_m=rules.confirm_range_m,
        aperture_deg=float(np.degrees(rules.confirm_aperture_rad)),
        level_db=assumed_db,
        sites=tuple(sites),
    )
