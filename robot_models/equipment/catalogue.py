"""Every kind of equipment that a yard may hold, in one table: material, colour, and shape where it is known.

A new kind is a row here, a row in `sensing/radio/materials.py` (a test holds the two together) and, if it can be placed
by its name alone, a function that builds it.
"""

from __future__ import annotations

import re

from pdpatrol.robot_models.equipment.assembly import Colour, Kind, Shape
from pdpatrol.robot_models.equipment.busbar import busbar
from pdpatrol.robot_models.equipment.circuit_breaker import circuit_breaker
from pdpatrol.robot_models.equipment.civil import control_building, fence, kerb
from pdpatrol.robot_models.equipment.gis_bay import gis_bay
from pdpatrol.robot_models.equipment.instrument_transformers import current_transformer, voltage_transformer
from pdpatrol.robot_models.equipment.power_transformer import power_transformer

KINDS: dict[str, Kind] = {
    "building": Kind("concrete", (0.76, 0.70, 0.62, 1.0)),
    "busbar": Kind("porcelain", (0.55, 0.58, 0.60, 1.0), Shape(busbar, 12.0, stretches=True)),
    "bushing": Kind("porcelain", (0.50, 0.28, 0.20, 1.0)),
    "cabinet": Kind("metal", (0.36, 0.46, 0.44, 1.0)),
    "capacitor_bank": Kind("rack", (0.58, 0.60, 0.44, 1.0)),
    "circuit_breaker": Kind("metal", (0.62, 0.66, 0.70, 1.0), Shape(circuit_breaker, 3.6)),
    "control_building": Kind("concrete", (0.76, 0.70, 0.62, 1.0), Shape(control_building, 6.0, stretches=True)),
    "current_transformer": Kind("porcelain", (0.52, 0.30, 0.22, 1.0), Shape(current_transformer, 0.5)),
    "disconnector": Kind("porcelain", (0.70, 0.66, 0.58, 1.0)),
    "fence": Kind("mesh", (0.50, 0.56, 0.54, 0.35), Shape(fence, 6.0, stretches=True)),
    "fire_wall": Kind("concrete", (0.58, 0.60, 0.62, 1.0)),
    "gis": Kind("metal", (0.74, 0.77, 0.80, 1.0)),
    "gis_bay": Kind("metal", (0.74, 0.77, 0.80, 1.0), Shape(gis_bay, 6.0, stretches=True)),
    "kerb": Kind("kerb", (0.66, 0.65, 0.62, 1.0), Shape(kerb, 6.0, stretches=True)),
    "power_transformer": Kind("metal", (0.45, 0.55, 0.50, 1.0), Shape(power_transformer, 5.0)),
    "reactor": Kind("metal", (0.72, 0.74, 0.70, 1.0)),
    "surge_arrester": Kind("porcelain", (0.40, 0.42, 0.52, 1.0)),
    "voltage_transformer": Kind("porcelain", (0.60, 0.36, 0.24, 1.0), Shape(voltage_transformer, 0.5)),
    "wall": Kind("concrete", (0.58, 0.60, 0.62, 1.0)),
}
"""By name."""

CATALOGUE: dict[str, Shape] = {name: kind.shape for name, kind in KINDS.items() if kind.shape is not None}
"""The kinds that a yard can place by their name alone."""

PART_COLOURS: dict[str, Colour] = {
    "hv_bushing": (0.55, 0.27, 0.18, 1.0),
    "lv_bushing": (0.55, 0.27, 0.18, 1.0),
    "pole": (0.55, 0.27, 0.18, 1.0),
    "post": (0.55, 0.27, 0.18, 1.0),
    "insulator": (0.55, 0.27, 0.18, 1.0),
    "column": (0.55, 0.58, 0.60, 1.0),
    "tube": (0.80, 0.82, 0.84, 1.0),
    "drive": (0.40, 0.48, 0.46, 1.0),
    "cubicle": (0.40, 0.48, 0.46, 1.0),
    "base": (0.62, 0.61, 0.58, 1.0),
}
"""Where a part is not of the colour of its kind: porcelain is brown, steel grey."""

DEFAULT_COLOUR: Colour = (0.58, 0.60, 0.62, 1.0)


def colour_of(kind: str, part: str) -> Colour:
    """What a part of a piece of equipment is drawn in.

    Args:
        kind: Of the piece; one that `KINDS` does not have is drawn in a plain grey.
        part: Its name in the assembly; numbers at its end do not count: `post_1_2` is a post.
    """
    of_kind = KINDS[kind].colour if kind in KINDS else DEFAULT_COLOUR
    return PART_COLOURS.get(re.sub(r"(_\d+)+$", "", part), of_kind)
