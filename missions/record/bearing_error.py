"""Error of the bearings of a mission, against the truth."""

from __future__ import annotations

import numpy as np

from dirmusic.angles import difference
from pdpatrol.envs import Scenario
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.record.mission_log import MissionLog


def bearing_rmse(log: MissionLog, scenario: Scenario) -> float:
    """Root mean square error of the azimuths about the true direction from the true pose.

    Args:
        log: Of a mission, with the truth.
        scenario: Of the mission.

    Returns:
        Radians, over the bearings that were taken where the yard leaves the source in sight; NaN if there were
        none, or if several sources make it unknown which one a bearing is of.
    """
    sources = log.meta["truth"]["sources"]
    bearing, pulse_step = log.table("bearing"), log.column("pulse", "step")
    if len(sources) != 1 or bearing["pulse"].size == 0:
        return float("nan")
    pose = log.column("step", "true_pose")[pulse_step[bearing["pulse"]]]
    source_m = np.asarray(sources[0]["position_m"])
    in_sight = SiteMap(scenario, scenario.yard).in_sight(pose[:, :2], source_m, 0.1)
    sight = source_m[:2] - pose[:, :2]
    error = difference(bearing["azimuth_rad"], np.arctan2(sight[:, 1], sight[:, 0]) - pose[:, 2])[in_sight]
    return float(np.sqrt(np.mean(np.square(error)))) if error.size else float("nan")
