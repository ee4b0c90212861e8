"""How one kind of equipment is put together."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from robot_models.yard.solids import Solid

Site = tuple[float, float, float]


class Assembly(NamedTuple):
    """A piece of equipment, in its own frame.

    Attributes:
        parts: Its solids by name; the first is the one that names the whole.
        sites: Where discharges sit, on a surface, by name.
    """

    parts: Mapping[str, Solid]
    sites: Mapping[str, Site]


class Kind(NamedTuple):
    """A kind that can be placed by its name alone.

    Attributes:
        build: From a length along x, metres.
        length_m: The usual length.
        stretches: Whether other lengths exist.
    """

    build: Callable[[float], Assembly]
    length_m: float
    stretches: bool = False
