"""Array, grid, yards and bearing errors of a log, rebuilt from its metadata."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from dirmusic import ArrayModel, GainManifold, GainPattern, GaussianPattern, TabulatedPattern
from dirmusic.angles import azimuth_of, difference
from dirmusic.locating.yard_likelihood import Grid
from pdpatrol.envs import Scenario
from pdpatrol.envs.scenario.map import GeoreferenceConfig, MapConfig
from pdpatrol.envs.scenario.survey import SurveyConfig
from pdpatrol.envs.scenario.zone import ZoneConfig
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.robot_models.yard.yard import Yard


def describe_array(array: ArrayModel) -> dict[str, Any]:
    """Return boresights, positions and pattern of the elements; no pattern for eq. (1) of the Dir-MUSIC paper."""
    manifold = array.manifold
    return {
        "boresights_rad": manifold.boresights_rad.tolist(),
        "boresight_elevations_rad": manifold.boresight_elevations_rad.tolist(),
        "positions_m": array.positions_m.tolist(),
        "pattern": _describe_pattern(manifold.pattern),
    }


def _describe_pattern(pattern: GainPattern | None) -> dict[str, Any] | None:
    """Return the table of a pattern, with that of its vertical cut if it has one; None if it has no table."""
    if not isinstance(pattern, TabulatedPattern):
        return None
    table = {"off_boresight_rad": pattern.off_boresight_rad.tolist(), "gain": pattern.table_gain.tolist()}
    vertical = _describe_pattern(pattern.vertical)
    return table if vertical is None else {**table, "vertical": vertical}


def _described_pattern(table: Mapping[str, Any]) -> TabulatedPattern:
    """Rebuild a pattern from its table."""
    vertical = table.get("vertical")
    return TabulatedPattern(
        table["off_boresight_rad"], table["gain"], None if vertical is None else _described_pattern(vertical)
    )


def described_manifold(description: Mapping[str, Any]) -> GainManifold:
    """Rebuild the manifold of an array; elements are level if the description has no elevations."""
    table = description.get("pattern")
    return GainManifold(
        _described_pattern(table) if table else GaussianPattern(),
        description["boresights_rad"],
        boresight_elevations_rad=description.get("boresight_elevations_rad", 0.0),
    )


def array_height_of(log: MissionLog) -> float:
    """Return the mean height of the elements of the array above the ground, metres."""
    return float(np.mean(log.meta["array"]["positions_m"], axis=0)[2])


def grid_of(meta: Mapping[str, Any]) -> Grid:
    """Return the grid of a log's table `likelihood`, which covers the bounds of the yard."""
    return Grid.over(*np.array(meta["bounds_m"], dtype=np.float64))


def map_of(log: MissionLog) -> MapConfig:
    """Return the table `[map]` of the mission; the default for field data without a map."""
    return MapConfig.model_validate(log.meta.get("scenario", {}).get("map", {}), strict=False)


def zones_of(log: MissionLog) -> tuple[ZoneConfig, ...]:
    """Return the zones with a speed limit of the mission; none for field data."""
    zones = log.meta.get("scenario", {}).get("zones", ())
    return tuple(ZoneConfig.model_validate(zone, strict=False) for zone in zones)


def georeference_of(log: MissionLog) -> GeoreferenceConfig | None:
    """Return the position on Earth that a survey states, or else its scenario; None if neither does."""
    reference = log.meta.get("georeference") or log.meta.get("scenario", {}).get("georeference")
    return reference and GeoreferenceConfig.model_validate(reference, strict=False)


def survey_of(log: MissionLog) -> SurveyConfig:
    """Return the table `[survey]` of the scenario; an empty one for field data without a yard."""
    return SurveyConfig.model_validate(log.meta.get("scenario", {}).get("survey", {}), strict=False)


def known_yard(log: MissionLog) -> Yard | None:
    """Return the yard as the map of the mission shows it; None for field data without a map."""
    yard = true_yard(log)
    return yard and map_of(log).of(yard)


def true_yard(log: MissionLog) -> Yard | None:
    """Return the true yard; that of the map for field data, and None without one."""
    if "scenario" not in log.meta:
        return None
    return Yard.model_validate(log.meta["scenario"]["yard"], strict=False)


def bearing_rmse(log: MissionLog, scenario: Scenario) -> float:
    """Return the root mean square error of the bearings about the true direction from the true pose.

    Args:
        log: Log of a mission, with the truth.
        scenario: Scenario of the mission.

    Returns:
        Radians, over bearings with line of sight to the source; NaN without such bearings, or with several
        sources, because the source of a bearing is then unknown.
    """
    sources = log.meta["truth"]["sources"]
    bearing, pulse_step = log.table("bearing"), log.column("pulse", "step")
    if len(sources) != 1:
        return float("nan")
    pose = log.column("step", "true_pose")[pulse_step[bearing["pulse"]]]
    source_m = np.asarray(sources[0]["position_m"])
    in_sight = SiteMap(scenario, scenario.yard).in_sight(pose[:, :2], source_m, 0.1)
    sight = source_m[:2] - pose[:, :2]
    error = difference(bearing["azimuth_rad"], azimuth_of(sight) - pose[:, 2])[in_sight]
    return float(np.sqrt(np.mean(np.square(error)))) if error.size else float("nan")
