"""Solids and discharge sites of a piece of equipment, in its own frame."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from pdpatrol.robot_models.yard.solids import Solid

Site = tuple[float, float, float]


class Assembly(NamedTuple):
    """Piece of equipment, in its own frame.

    Attributes:
        parts: Solids by name. In the model, the first solid has the name of the piece.
        sites: Candidate discharge sites on the surface, by name.
        live: Names of the parts on high voltage.
        insulators: Names of the parts that insulate; all other parts are on earth potential.
    """

    parts: Mapping[str, Solid]
    sites: Mapping[str, Site]
    live: frozenset[str] = frozenset()
    insulators: frozenset[str] = frozenset()

    def renamed(self, ending: str) -> Assembly:
        """Return the assembly with an ending appended to all names."""
        return Assembly(
            {name + ending: solid for name, solid in self.parts.items()},
            {name + ending: site for name, site in self.sites.items()},
            frozenset(name + ending for name in self.live),
            frozenset(name + ending for name in self.insulators),
        )

    def joined(self, other: Assembly) -> Assembly:
        """Return an assembly with the parts and sites of both."""
        return Assembly(
            {**self.parts, **other.parts},
            {**self.sites, **other.sites},
            self.live | other.live,
            self.insulators | other.insulators,
        )
