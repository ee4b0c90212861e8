"""Quantities of a yard: metres and degrees, and what they may sensibly be. -0.0 is 0, and nothing is infinite.

All bounds are assumed: wide of any outdoor substation that a robot patrols, and short of where millimetres begin.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field

MOST_YARD_M = 200.0
"""Longest side of a yard."""

MOST_PIECES = 200
"""Of equipment in a yard: a large one of 110 kV has half as many."""

MOST_SITES = 100
"""Of one piece of equipment."""

MOST_LETTERS = 64
"""Of a name."""


def _without_sign_of_zero(value: float) -> float:
    return value + 0.0


PLAIN_ZERO = AfterValidator(_without_sign_of_zero)
"""-0.0 is 0."""

NAME_PATTERN = r"^[a-z][a-z0-9_]*$"
Name = Annotated[str, Field(pattern=NAME_PATTERN, max_length=MOST_LETTERS)]

YardLength = Annotated[float, Field(ge=1.0, le=MOST_YARD_M), PLAIN_ZERO]
"""Of a side of the yard: a robot does not fit into less than a metre."""

Coordinate = Annotated[float, Field(ge=-MOST_YARD_M, le=MOST_YARD_M), PLAIN_ZERO]
"""Of the yard, or of a piece of equipment in its own frame."""

Length = Annotated[float, Field(ge=0.05, le=MOST_YARD_M), PLAIN_ZERO]
"""Of a piece of equipment: thinner than 5 cm is a wire, which nothing here stands for, and has no sides for a site to
lie on."""

StretchedLength = Annotated[float, Field(ge=0.5, le=MOST_YARD_M), PLAIN_ZERO]
"""Of a kind of the catalogue: what is shorter has no room for its parts."""

Height = Annotated[float, Field(ge=0.05, le=50.0), PLAIN_ZERO]
"""Above the ground: what is lower is no obstacle, and gantries of 400 kV are some 30 m high."""

Yaw = Annotated[float, Field(ge=-360.0, le=360.0), PLAIN_ZERO]
"""Degrees, counter-clockwise."""
