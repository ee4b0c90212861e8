"""Encounters of the robot with people and vehicles, from the truth of a mission."""

import numpy as np

from pdpatrol.envs.scenario.base import STEP_S
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.records import Encounter
from pdpatrol.robot_models.description.robot_file import load_robot
from pdpatrol.robot_models.moving_bodies import described_moving, distance_to_body

STANDING_MPS = 0.05
"""Speed below which a robot counts as standing. Assumed; a tenth of the speed of a robot that is about to stop."""


def encounters(log: MissionLog) -> tuple[Encounter, ...]:
    """Return the encounters with each person and vehicle of a simulated mission, in the order of the scenario."""
    time_s, place_m = log.column("step", "time_s"), log.column("step", "true_pose")[:, :2]
    speed_mps = np.append(0.0, np.linalg.norm(np.diff(place_m, axis=0), axis=-1) / STEP_S)
    events = log.table("event")
    is_contact, result = events["kind"] == "contact", list[Encounter]()
    for description in log.meta["truth"].get("moving", ()):
        body, track = described_moving(description)
        radius_m = load_robot(log.meta["scenario"]["robot"]["model"]).footprint_radius_m
        distance_m = distance_to_body(body, track.pose(time_s), place_m) - radius_m
        begins = events["step"][is_contact & (events["subject"] == body.label)]
        stood = speed_mps[np.maximum(begins - 1, 0)] < STANDING_MPS
        result.append(
            Encounter(
                name=body.name,
                kind=body.kind,
                closest_m=float(distance_m.min()) if distance_m.size else None,
                contacts=len(begins),
                ran_into_robot=int(stood.sum()),
            )
        )
    return tuple(result)
