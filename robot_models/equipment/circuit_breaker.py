"""A live-tank circuit breaker for 110 kV: three poles on a common frame, and the cabinet of its drive.

Sizes are assumed, of the usual order for this class. It discharges at the flanges of its poles.
"""

from __future__ import annotations

from pdpatrol.robot_models.equipment.assembly import Assembly
from pdpatrol.robot_models.yard.solids import Box, Cylinder, Solid


def circuit_breaker(length_m: float) -> Assembly:
    """Three poles along x, the drive in front of the middle one (y < 0)."""
    poles_m = (-0.42 * length_m, 0.0, 0.42 * length_m)
    parts: dict[str, Solid] = {
        "frame": Box(footprint_m=(length_m, 0.4), top_m=1.6),
        "drive": Box(centre_m=(0.0, -0.45), footprint_m=(0.9, 0.5), bottom_m=0.3, top_m=1.7),
    }
    for number, x in enumerate(poles_m, start=1):
        parts[f"pole_{number}"] = Cylinder(centre_m=(x, 0.0), radius_m=0.17, bottom_m=1.6, top_m=4.2)
    sites = {f"pole_{number}": (x, 0.17, 1.8) for number, x in enumerate(poles_m, start=1)}
    return Assembly(parts, sites | {"drive": (0.2, -0.7, 1.2)})
