"""Bounded quantities of a yard: lengths in metres, angles in degrees, and names.

All bounds are assumed. They are wider than those of any outdoor substation that a robot patrols; they exclude lengths
given in millimetres.
"""

from typing import Annotated

from pydantic import Field

LEAST_YARD_M, MOST_YARD_M = 1.0, 400.0
"""Smallest and largest side length of a yard."""

MOST_PIECES = 1000
"""Maximum number of pieces of equipment in a yard; a large 400 kV station has half as many."""

MOST_SITES = 100
"""Maximum number of sites on one piece of equipment."""

LEAST_STRETCHED_M = 0.5
"""Least length of a catalogue kind that is as long as stated; its parts do not fit into less."""

MOST_LETTERS = 64
"""Maximum length of a name, in characters."""


Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=MOST_LETTERS)]

YardLength = Annotated[float, Field(ge=LEAST_YARD_M, le=MOST_YARD_M)]
"""Side length of a yard; a robot does not fit into less than a metre."""

Coordinate = Annotated[float, Field(ge=-MOST_YARD_M, le=MOST_YARD_M)]
"""Coordinate in a yard, or in the frame of a piece of equipment."""

Length = Annotated[float, Field(ge=0.05, le=MOST_YARD_M)]
"""Length of a piece of equipment. Anything thinner than 5 cm is a wire, which is not modelled and cannot have sites."""

StretchedLength = Annotated[float, Field(ge=LEAST_STRETCHED_M, le=MOST_YARD_M)]
"""Length of a catalogue kind."""

Height = Annotated[float, Field(ge=0.05, le=50.0)]
"""Height above the ground; anything below 5 cm is not an obstacle, and 400 kV gantries are about 30 m high."""

Yaw = Annotated[float, Field(ge=-360.0, le=360.0)]
"""Yaw angle, degrees, counter-clockwise."""

AssetId = Annotated[str, Field(min_length=1, max_length=MOST_LETTERS, pattern=r"^[^\x00-\x1f\x7f]*$")]
"""Number or code of a piece of equipment in the register of its owner."""

PhaseName = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9 ,/-]*$", max_length=16)]
"""Phase or phases of the mains, such as `L1`, `B` or `L1-L2-L3`."""

NominalKv = Annotated[float, Field(gt=0.0, le=1500.0)]
"""Nominal voltage, kV, up to that of the highest lines."""
