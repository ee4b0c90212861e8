"""Catalogue of the kinds of equipment that a yard may contain: their colours, and for some their shapes.

To add a kind, add a row to `KIND_COLOURS` and a row to `sensing/radio/materials.py` (a test checks that both have the
same kinds). If the kind alone defines its shape, also add a row to `CATALOGUE`, and either a row to `APPARATUS` in
`poles.py` or a function that builds it to `structures.py`.
"""

import re
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

from pdpatrol.robot_models.equipment import kinds, structures
from pdpatrol.robot_models.equipment.assembly import Assembly
from pdpatrol.robot_models.equipment.poles import APPARATUS, build_apparatus
from pdpatrol.robot_models.equipment.voltages import VOLTAGES, Kv

Colour = tuple[float, float, float]
"""Red, green and blue, each in [0, 1]."""

FENCE_OPACITY = 0.35
"""Opacity of wire mesh; all other equipment is opaque."""


class CatalogueShape(NamedTuple):
    """Shape of a kind of equipment, for kinds that a yard can place without giving a shape.

    Attributes:
        title: Description in a few words.
        source: Where its dimensions come from.
        build: Function that builds the shape of a compact 110 kV yard from its length along x, metres; None if the kind
            has a size for each voltage level only.
        build_for: Function that builds the shape for a length and a voltage level; None if the voltage does not change
            the shape.
        length_m: Default length of `build`; the only length unless `stretches` is true.
        lengths_m: Default length of `build_for` for each of 110, 220 and 400 kV.
        stretches: True if other lengths are allowed.
    """

    title: str
    source: str
    build: Callable[[float], Assembly] | None = None
    build_for: Callable[[float, Kv], Assembly] | None = None
    length_m: float = 0.0
    lengths_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    stretches: bool = False


def _apparatus(kind: str, build: Callable[[float], Assembly] | None = None, length_m: float = 0.0) -> CatalogueShape:
    """Return the row of an apparatus of `APPARATUS`, which has one length per voltage level."""
    shape = APPARATUS[kind]
    return CatalogueShape(shape.title, shape.source, build, lambda _length_m, kv: build_apparatus(kind, kv), length_m)


ASSUMED = "typical (assumed)"

CATALOGUE: dict[str, CatalogueShape] = {
    "building": CatalogueShape("building of one storey", ASSUMED, structures.building, length_m=12.0, stretches=True),
    "busbar": CatalogueShape(
        "tubes on post insulators",
        "IEC 60273 for the posts; height from the phase clearance of IEC 61936-1 above a pantograph",
        kinds.busbar,
        structures.busbar,
        12.0,
        (9.0, 16.0, 22.0),
        stretches=True,
    ),
    "cable_sealing_end": _apparatus("cable_sealing_end"),
    "cable_trench_cover": CatalogueShape(
        "covers on the edges of a cable trench", ASSUMED, structures.cable_trench_cover, length_m=6.0, stretches=True
    ),
    "capacitive_voltage_transformer": _apparatus("capacitive_voltage_transformer"),
    "circuit_breaker": _apparatus("circuit_breaker", kinds.circuit_breaker, 3.6),
    "control_building": CatalogueShape(
        "hut for control", ASSUMED, kinds.control_building, length_m=6.0, stretches=True
    ),
    "current_transformer": _apparatus("current_transformer", kinds.current_transformer, 0.5),
    "disconnector_centre_break": _apparatus("disconnector_centre_break"),
    "disconnector_double_break": _apparatus("disconnector_double_break"),
    "disconnector_pantograph": _apparatus("disconnector_pantograph"),
    "fence": CatalogueShape("mesh around a live bay", ASSUMED, kinds.fence, length_m=6.0, stretches=True),
    "fire_wall": CatalogueShape(
        "wall beside a transformer",
        "IEC 61936-1: higher than the conservator; thickness assumed",
        build_for=structures.fire_wall,
        lengths_m=(6.0, 9.0, 10.0),
        stretches=True,
    ),
    "gantry": CatalogueShape(
        "lattice beam on legs, above conductors",
        ASSUMED,
        build_for=structures.gantry,
        lengths_m=(9.0, 16.0, 22.0),
        stretches=True,
    ),
    "gis_bay": CatalogueShape("gas-insulated bay", ASSUMED, kinds.gis_bay, length_m=6.0, stretches=True),
    "gis_outdoor": CatalogueShape(
        "gas-insulated bay with bushings in air",
        ASSUMED,
        build_for=structures.gis_outdoor,
        lengths_m=(5.0, 6.5, 9.0),
        stretches=True,
    ),
    "kerb": CatalogueShape("kerb of a path", ASSUMED, kinds.kerb, length_m=6.0, stretches=True),
    "line_trap": _apparatus("line_trap"),
    "post_insulator": _apparatus("post_insulator"),
    "power_transformer": CatalogueShape(
        "oil transformer with bushings",
        ASSUMED + ", for 40, 200 and 350 MVA",
        kinds.power_transformer,
        structures.power_transformer,
        5.0,
        tuple(size.tank_m[0] for size in structures.SIZES.values()),
    ),
    "shunt_reactor": CatalogueShape(
        "oil reactor with bushings",
        ASSUMED + ", for 30, 50 and 100 Mvar",
        build_for=structures.shunt_reactor,
        lengths_m=tuple(size.reactor_m[0] for size in structures.SIZES.values()),
    ),
    "surge_arrester": _apparatus("surge_arrester"),
    "voltage_transformer": _apparatus("voltage_transformer", kinds.voltage_transformer, 0.5),
}
"""Kinds that a yard can place without giving a shape."""


@cache
def assemble(kind: str, length_m: float | None = None, kv: Kv | None = None) -> Assembly:
    """Build the shape of a kind of `CATALOGUE`.

    Args:
        kind: Name of the kind.
        length_m: Length along x, or along y for `gis_outdoor`, if the kind stretches; by default that of the kind.
        kv: Voltage level. By default the size of a compact 110 kV yard, or that of 110 kV if the kind has none.
    """
    shape = CATALOGUE[kind]
    if shape.build is not None and kv is None:
        return shape.build(shape.length_m if length_m is None else length_m)
    if shape.build_for is None:
        raise ValueError(f"`{kind}` has one size for all voltages, got {kv} kV")
    level: Kv = 110 if kv is None else kv
    return shape.build_for(shape.lengths_m[list(VOLTAGES).index(level)] if length_m is None else length_m, level)


KIND_COLOURS: dict[str, Colour] = {
    **dict.fromkeys(("building", "control_building"), (0.76, 0.70, 0.62)),
    **dict.fromkeys(("fire_wall", "wall"), (0.58, 0.60, 0.62)),
    **dict.fromkeys(("gis", "gis_bay", "gis_outdoor"), (0.74, 0.77, 0.80)),
    "busbar": (0.55, 0.58, 0.60),
    "bushing": (0.50, 0.28, 0.20),
    "cabinet": (0.36, 0.46, 0.44),
    "cable_sealing_end": (0.48, 0.36, 0.44),
    "cable_trench_cover": (0.60, 0.58, 0.54),
    "capacitive_voltage_transformer": (0.56, 0.42, 0.20),
    "capacitor_bank": (0.58, 0.60, 0.44),
    "circuit_breaker": (0.62, 0.66, 0.70),
    "current_transformer": (0.52, 0.30, 0.22),
    **dict.fromkeys(
        (
            "disconnector",
            "disconnector_centre_break",
            "disconnector_double_break",
            "disconnector_pantograph",
        ),
        (0.70, 0.66, 0.58),
    ),
    "fence": (0.50, 0.56, 0.54),
    "gantry": (0.60, 0.66, 0.70),
    "kerb": (0.66, 0.65, 0.62),
    "line_trap": (0.34, 0.44, 0.58),
    "post_insulator": (0.55, 0.58, 0.60),
    "power_transformer": (0.45, 0.55, 0.50),
    "reactor": (0.72, 0.74, 0.70),
    "shunt_reactor": (0.50, 0.54, 0.58),
    "surge_arrester": (0.40, 0.42, 0.52),
    "voltage_transformer": (0.60, 0.36, 0.24),
}
"""Colour of each kind."""

PART_COLOURS: dict[str, Colour] = {
    **dict.fromkeys(("hv_bushing", "lv_bushing", "pole", "post", "insulator"), (0.55, 0.27, 0.18)),
    **dict.fromkeys(("drive", "cubicle"), (0.40, 0.48, 0.46)),
    "column": (0.55, 0.58, 0.60),
    **dict.fromkeys(("tube", "blade", "cap", "ring", "arms", "flange"), (0.80, 0.82, 0.84)),
    "base": (0.62, 0.61, 0.58),
}
"""Colour of each part that differs from the colour of its kind: porcelain is brown, steel is grey."""


def colour_of(kind: str, part: str) -> Colour:
    """Return the colour of a part of a piece of equipment.

    Args:
        kind: Kind of the piece; kinds that are not in `KIND_COLOURS` are grey.
        part: Name of the part; numbers and a letter at the end are ignored: `post_1_2` and `post_a_3` are posts.
    """
    of_kind = KIND_COLOURS.get(kind, KIND_COLOURS["wall"])
    return PART_COLOURS.get(re.sub(r"(_[a-c])?[_0-9]*$", "", part), of_kind)
