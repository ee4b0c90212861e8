"""Bays and phases in the names of equipment."""

import re

BAY = re.compile(r"([a-z]{1,2}[0-9]+)_(?![a-z]{1,2}[0-9]+_)")
"""Designation of a bay at the beginning of a name, such as `d01` in `d01_qa1`; a gantry of two bays has two."""

PHASE = re.compile(r"_l[123]$|(?<=[0-9])_[abc]$")
"""Phase at the end of the name of a piece of one phase, such as `_l1` in `d01_bc1_l1` and `_a` in `ct_2_a`."""


def bay_of(name: str) -> str | None:
    """Return the designation of the bay in a name, or None without one, or if the piece belongs to two bays."""
    bay = BAY.match(name)
    return bay and bay[1]


def without_phase(name: str) -> str:
    """Return a name without its phase, which is the same for the pieces of all phases."""
    return PHASE.sub("", name)
