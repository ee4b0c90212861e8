"""What a kind of equipment is: its parts and sites, its material, its colour."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from pdpatrol.robot_models.yard.solids import Solid

Site = tuple[float, float, float]


class Assembly(NamedTuple):
    """A piece of equipment, in its own frame.

    Attributes:
        parts: Its solids by name; the first is the one that names the whole.
        sites: Where discharges sit, on a surface, by name.
    """

    parts: Mapping[str, Solid]
    sites: Mapping[str, Site]


class Shape(NamedTuple):
    """How a kind is built that can be placed by its name alone.

    Attributes:
        build: From a length along x, metres.
        length_m: The usual length.
        stretches: Whether other lengths exist.
    """

    build: Callable[[float], Assembly]
    length_m: float
    stretches: bool = False


Colour = tuple[float, float, float, float]
"""Red, green, blue and opacity, each in [0, 1]."""


class Kind(NamedTuple):
    """All that is known of a kind of equipment.

    Attributes:
        material: Name of what it is made of, as a constant of `pdpatrol.sensing.radio.materials`.
        colour: What it is drawn in.
        shape: How it is built; None if a yard has to say its box or cylinder.
    """

    material: str
    colour: Colour
    shape: Shape | None = None
