"""Inspection of the sites of the map: in line of sight, near enough, and from enough directions to locate."""

from __future__ import annotations

import numpy as np

from dirmusic import InputFileError
from dirmusic.angles import aperture
from pdpatrol.envs.scenario import restore_scenario
from pdpatrol.envs.scenario.radio import surroundings_of
from pdpatrol.missions.driving.site_map import MIN_TRANSMISSION
from pdpatrol.missions.planning.detectability import AMPLITUDE_V, MARGIN_DB, DirectPaths
from pdpatrol.missions.record.log_contents import known_yard
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.records import SiteInspection, SiteInspections
from pdpatrol.sensing.radio.transmission import Sight


def inspect_sites(log: MissionLog) -> SiteInspections | None:
    """Determine which sites the robot could inspect from its path, according to its estimated poses.

    The assumed discharge is the one for which tours are planned.

    Returns:
        Inspection of the sites; None without a map, without sites on it, or if a file that the scenario names no longer
        exists.
    """
    yard = known_yard(log)
    if yard is None or not yard.site_names():
        return None
    try:
        scenario = restore_scenario(log.meta["scenario"])
        paths = DirectPaths(scenario.array, scenario.receiver, Sight(surroundings_of(yard)))
    except (InputFileError, OSError):
        return None
    rules = scenario.locating.rules()
    assumed_db = float(20 * np.log10(AMPLITUDE_V))
    grid_m = 0.25  # poses are rounded to it; apertures change by about a degree at 10 m
    places_m = grid_m * np.unique(np.round(log.column("step", "pose")[:, :2] / grid_m), axis=0)
    sites: list[SiteInspection] = []
    for name in yard.site_names():
        site_m = yard.site_position(name)
        near_m = places_m[np.linalg.norm(places_m - site_m[:2], axis=-1) <= rules.confirm_range_m]
        x_m, y_m = (near_m - site_m[:2]).T
        transmitted, level_db = paths.levels(near_m, site_m)
        in_sight = transmitted >= MIN_TRANSMISSION
        detects = in_sight & (level_db >= MARGIN_DB)
        aperture_rad = aperture(np.arctan2(y_m, x_m)[detects])
        is_wide = aperture_rad >= rules.confirm_aperture_rad
        sites.append(
            SiteInspection(
                name=name,
                state="inspected" if is_wide else "partly_inspected" if detects.any() else "not_inspected",
                nearest_m=float(np.hypot(x_m, y_m)[in_sight].min()) if in_sight.any() else None,
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
