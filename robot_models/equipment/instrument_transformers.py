"""Current and voltage transformers for 110 kV: a head or a base tank on a steel column, and an insulator.

Sizes are assumed, of the usual order for this class. They discharge at the head, at the foot of the insulator, and
at the terminal box.
"""

from __future__ import annotations

from pdpatrol.robot_models.equipment.assembly import Assembly
from pdpatrol.robot_models.yard.solids import Box, Cylinder


def current_transformer(length_m: float) -> Assembly:
    """The head on top of the insulator: a top-core transformer."""
    return Assembly(
        parts={
            "column": Box(footprint_m=(length_m, length_m), top_m=1.6),
            "insulator": Cylinder(radius_m=0.18, bottom_m=1.6, top_m=3.0),
            "head": Cylinder(radius_m=0.38, bottom_m=3.0, top_m=3.7),
        },
        sites={"head": (0.0, 0.38, 3.2), "foot": (0.0, -0.18, 1.75), "terminal_box": (0.5 * length_m, 0.0, 1.2)},
    )


def voltage_transformer(length_m: float) -> Assembly:
    """The tank below the insulator."""
    return Assembly(
        parts={
            "column": Box(footprint_m=(length_m, length_m), top_m=1.4),
            "tank": Cylinder(radius_m=0.36, bottom_m=1.4, top_m=2.1),
            "insulator": Cylinder(radius_m=0.16, bottom_m=2.1, top_m=3.6),
        },
        sites={"tank": (0.36, 0.0, 1.7), "foot": (0.0, 0.16, 2.25), "terminal_box": (-0.5 * length_m, 0.0, 1.0)},
    )
