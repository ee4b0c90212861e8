"""Bounded quantities of a yard: metres, degrees and names. -0.0 becomes 0.

All bounds are assumed: wider than any outdoor substation that a robot patrols, and above millimetres.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field

MOST_YARD_M = 200.0
"""Longest side of a yard."""

MOST_PIECES = 200
"""Most pieces of equipment in a yard: a large one of 110 kV has half as many."""

MOST_SITES = 100
"""Most sites of one piece of equipment."""

MOST_LETTERS = 64
"""Longest name."""


def _without_sign_of_zero(value: float) -> float:
    return value + 0.0


PLAIN_ZERO = AfterValidator(_without_sign_of_zero)
"""Validator that turns -0.0 into 0."""

Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=MOST_LETTERS)]

YardLength = Annotated[float, Field(ge=1.0, le=MOST_YARD_M), PLAIN_ZERO]
"""Side of a yard: a robot does not fit into less than a metre."""

Coordinate = Annotated[float, Field(ge=-MOST_YARD_M, le=MOST_YARD_M), PLAIN_ZERO]
"""Coordinate in a yard, or in the frame of a piece of equipment."""

Length = Annotated[float, Field(ge=0.05, le=MOST_YARD_M), PLAIN_ZERO]
"""Length of a piece of equipment: below 5 cm it is a wire, which is not modelled and has no sides for a site."""

StretchedLength = Annotated[float, Field(ge=0.5, le=MOST_YARD_M), PLAIN_ZERO]
"""Length of a kind of the catalogue: shorter, there is no room for its parts."""

Height = Annotated[float, Field(ge=0.05, le=50.0), PLAIN_ZERO]
"""Height above the ground: lower is no obstacle, and gantries of 400 kV are some 30 m high."""

Yaw = Annotated[float, Field(ge=-360.0, le=360.0), PLAIN_ZERO]
"""Degrees, counter-clockwise."""
