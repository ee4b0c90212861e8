"""Bays of gas-insulated switchgear for 110 kV in the open: three enclosures, the cable ends, the control cubicle.

Sizes are assumed, of the usual order for this class. It discharges at spacers between gas compartments, and is heard
through their seals.
"""

from __future__ import annotations

from pdpatrol.robot_models.equipment.assembly import Assembly
from pdpatrol.robot_models.yard.solids import Box, Cylinder, Solid


def gis_bay(length_m: float) -> Assembly:
    """Along x, control cubicle at the near end (x < 0)."""
    half = 0.5 * length_m
    parts: dict[str, Solid] = {
        "enclosure": Box(footprint_m=(length_m, 1.4), bottom_m=0.3, top_m=2.0),
        "base": Box(footprint_m=(length_m, 1.2), top_m=0.3),
        "cubicle": Box(centre_m=(-half - 0.4, 0.0), footprint_m=(0.8, 1.4), top_m=2.3),
    }
    for number, x in enumerate((-0.3 * length_m, 0.0, 0.3 * length_m), start=1):
        parts[f"breaker_{number}"] = Cylinder(centre_m=(x, 0.0), radius_m=0.42, bottom_m=2.0, top_m=3.1)
    sites = {
        "spacer_1": (-0.15 * length_m, 0.7, 1.2),
        "spacer_2": (0.15 * length_m, 0.7, 1.2),
        "cable_end": (half, 0.2, 0.9),
        "breaker_2": (0.0, -0.42, 2.5),
    }
    return Assembly(parts, sites)
