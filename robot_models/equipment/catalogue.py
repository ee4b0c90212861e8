"""Catalogue of the kinds of equipment that a yard may contain: their colours, and for some their shapes.

To add a kind, add a row to `KIND_COLOURS` and a row to `sensing/radio/materials.py` (a test checks that both have the
same kinds). If the kind alone defines its shape, also add a function that builds it to `kinds.py`, and a row to
`CATALOGUE`.
"""

from collections.abc import Callable
from typing import NamedTuple

from pdpatrol.robot_models.equipment import kinds
from pdpatrol.robot_models.equipment.kinds import Assembly

Colour = tuple[float, float, float]
"""Red, green and blue, each in [0, 1]."""

FENCE_OPACITY = 0.35
"""Opacity of wire mesh; all other equipment is opaque."""


class CatalogueShape(NamedTuple):
    """Shape of a kind of equipment, for kinds that a yard can place without giving a shape.

    Attributes:
        build: Function that builds the shape from its length along x, metres.
        length_m: Default length.
        stretches: True if other lengths are allowed.
    """

    build: Callable[[float], Assembly]
    length_m: float
    stretches: bool = False


CATALOGUE: dict[str, CatalogueShape] = {
    "busbar": CatalogueShape(kinds.busbar, 12.0, stretches=True),
    "circuit_breaker": CatalogueShape(kinds.circuit_breaker, 3.6),
    "control_building": CatalogueShape(kinds.control_building, 6.0, stretches=True),
    "current_transformer": CatalogueShape(kinds.current_transformer, 0.5),
    "fence": CatalogueShape(kinds.fence, 6.0, stretches=True),
    "gis_bay": CatalogueShape(kinds.gis_bay, 6.0, stretches=True),
    "kerb": CatalogueShape(kinds.kerb, 6.0, stretches=True),
    "power_transformer": CatalogueShape(kinds.power_transformer, 5.0),
    "voltage_transformer": CatalogueShape(kinds.voltage_transformer, 0.5),
}
"""Kinds that a yard can place without giving a shape."""

KIND_COLOURS: dict[str, Colour] = {
    **dict.fromkeys(("building", "control_building"), (0.76, 0.70, 0.62)),
    **dict.fromkeys(("fire_wall", "wall"), (0.58, 0.60, 0.62)),
    **dict.fromkeys(("gis", "gis_bay"), (0.74, 0.77, 0.80)),
    "busbar": (0.55, 0.58, 0.60),
    "bushing": (0.50, 0.28, 0.20),
    "cabinet": (0.36, 0.46, 0.44),
    "capacitor_bank": (0.58, 0.60, 0.44),
    "circuit_breaker": (0.62, 0.66, 0.70),
    "current_transformer": (0.52, 0.30, 0.22),
    "disconnector": (0.70, 0.66, 0.58),
    "fence": (0.50, 0.56, 0.54),
    "kerb": (0.66, 0.65, 0.62),
    "power_transformer": (0.45, 0.55, 0.50),
    "reactor": (0.72, 0.74, 0.70),
    "surge_arrester": (0.40, 0.42, 0.52),
    "voltage_transformer": (0.60, 0.36, 0.24),
}
"""Colour of each kind."""

PART_COLOURS: dict[str, Colour] = {
    **dict.fromkeys(("hv_bushing", "lv_bushing", "pole", "post", "insulator"), (0.55, 0.27, 0.18)),
    **dict.fromkeys(("drive", "cubicle"), (0.40, 0.48, 0.46)),
    "column": (0.55, 0.58, 0.60),
    "tube": (0.80, 0.82, 0.84),
    "base": (0.62, 0.61, 0.58),
}
"""Colour of each part that differs from the colour of its kind: porcelain is brown, steel is grey."""


def colour_of(kind: str, part: str) -> Colour:
    """Return the colour of a part of a piece of equipment.

    Args:
        kind: Kind of the piece; kinds that are not in `KIND_COLOURS` are grey.
        part: Name of the part; trailing numbers are ignored, so that `post_1_2` is a post.
    """
    of_kind = KIND_COLOURS.get(kind, KIND_COLOURS["wall"])
    return PART_COLOURS.get(part.rstrip("_0123456789"), of_kind)
