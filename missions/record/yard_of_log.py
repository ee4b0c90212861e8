"""The yards that a log tells of: as the map had it, and as it is."""

from __future__ import annotations

import json

from pdpatrol.envs.scenario.map import MapConfig
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.robot_models.yard.yard import Yard


def known_yard(log: MissionLog) -> Yard | None:
    """The yard as the map of the mission has it; None for field data, which have no scenario."""
    yard = true_yard(log)
    if yard is None:
        return None
    of_map = MapConfig.model_validate_json(json.dumps(log.meta["scenario"].get("map", {})))
    return of_map.of(yard)


def true_yard(log: MissionLog) -> Yard | None:
    """The yard as it is; None for field data."""
    if "scenario" not in log.meta:
        return None
    return Yard.model_validate_json(json.dumps(log.meta["scenario"]["yard"]))
