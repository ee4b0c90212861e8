"""A tubular busbar of three phases on post insulators.

Sizes are assumed, of the usual order for 110 kV. It discharges at the caps of its insulators.
"""

from __future__ import annotations

from pdpatrol.robot_models.equipment.assembly import Assembly
from pdpatrol.robot_models.yard.solids import Box, Cylinder, Solid

PHASES_M = (-1.6, 0.0, 1.6)


def busbar(length_m: float) -> Assembly:
    """Tubes along x, held near both ends and in the middle."""
    parts: dict[str, Solid] = {}
    sites: dict[str, tuple[float, float, float]] = {}
    for frame, x in enumerate((-0.45 * length_m, 0.0, 0.45 * length_m), start=1):
        for side, y in zip(("right", "left"), (-1.6, 1.6), strict=True):
            parts[f"leg_{frame}_{side}"] = Cylinder(centre_m=(x, y), radius_m=0.12, top_m=2.6)
        parts[f"beam_{frame}"] = Box(centre_m=(x, 0.0), footprint_m=(0.2, 3.6), bottom_m=2.6, top_m=2.8)
        for phase, y in enumerate(PHASES_M, start=1):
            parts[f"post_{frame}_{phase}"] = Cylinder(centre_m=(x, y), radius_m=0.1, bottom_m=2.8, top_m=4.0)
            sites[f"post_{frame}_{phase}"] = (x, y + 0.1, 3.7)
    for phase, y in enumerate(PHASES_M, start=1):
        parts[f"tube_{phase}"] = Box(centre_m=(0.0, y), footprint_m=(length_m, 0.12), bottom_m=4.0, top_m=4.12)
    return Assembly(parts, sites)
