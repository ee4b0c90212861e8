"""A power transformer of about 40 MVA and 110 kV: tank, radiators on both long sides, conservator, bushings.

Sizes are assumed, of the usual order for this class. It discharges in its bushings, at the tap changer, and inside
the tank behind a flange.
"""

from __future__ import annotations

from pdpatrol.robot_models.equipment.assembly import Assembly
from pdpatrol.robot_models.yard.solids import Box, Cylinder, Solid

PHASES_M = (-1.4, 0.0, 1.4)


def power_transformer(length_m: float) -> Assembly:
    """The tank along x, high voltage to the left (y > 0), low voltage to the right."""
    half = 0.5 * length_m
    parts: dict[str, Solid] = {
        "tank": Box(footprint_m=(length_m, 2.2), top_m=2.8),
        "radiators_left": Box(centre_m=(0.0, 1.55), footprint_m=(0.8 * length_m, 0.7), bottom_m=0.5, top_m=2.4),
        "radiators_right": Box(centre_m=(0.0, -1.55), footprint_m=(0.8 * length_m, 0.7), bottom_m=0.5, top_m=2.4),
        "conservator": Box(centre_m=(-half + 0.4, 0.0), footprint_m=(0.8, 2.2), bottom_m=3.2, top_m=4.0),
        "conservator_legs": Box(centre_m=(-half + 0.4, 0.0), footprint_m=(0.2, 1.4), bottom_m=2.8, top_m=3.2),
        "tap_changer": Box(centre_m=(half + 0.3, 0.0), footprint_m=(0.6, 1.0), bottom_m=0.6, top_m=2.2),
    }
    for number, x in enumerate(PHASES_M, start=1):
        parts[f"hv_bushing_{number}"] = Cylinder(centre_m=(x, 0.6), radius_m=0.18, bottom_m=2.8, top_m=4.4)
        parts[f"lv_bushing_{number}"] = Cylinder(centre_m=(x, -0.7), radius_m=0.1, bottom_m=2.8, top_m=3.4)
    sites = {f"hv_bushing_{n}": (x, 0.6 + 0.18, 3.8) for n, x in enumerate(PHASES_M, start=1)}
    sites |= {"tap_changer": (half + 0.6, 0.2, 1.4), "tank_end": (-half, 0.5, 1.2)}
    return Assembly(parts, sites)
