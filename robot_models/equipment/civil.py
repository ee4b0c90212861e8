"""What is built rather than connected: the control building, fences and kerbs. Nothing discharges there.

Sizes are assumed.
"""

from __future__ import annotations

from pdpatrol.robot_models.equipment.assembly import Assembly
from pdpatrol.robot_models.yard.solids import Box


def control_building(length_m: float) -> Assembly:
    """One storey, and a door step."""
    return Assembly(
        parts={
            "walls": Box(footprint_m=(length_m, 4.0), top_m=3.2),
            "step": Box(centre_m=(0.0, -2.3), footprint_m=(1.6, 0.6), top_m=0.15),
        },
        sites={},
    )


def fence(length_m: float) -> Assembly:
    """Wire mesh between posts, inside the yard: round a bay that is alive while others are worked on."""
    return Assembly(parts={"mesh": Box(footprint_m=(length_m, 0.06), top_m=1.8)}, sites={})


def kerb(length_m: float) -> Assembly:
    """The edge of a path: too high for the robot, as high as its lidar looks."""
    return Assembly(parts={"stone": Box(footprint_m=(length_m, 0.15), top_m=0.16)}, sites={})
