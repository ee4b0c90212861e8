"""The data sheet of an array, and a grid, as plain data in a log, which can be rendered again without another file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from dirmusic import ArrayModel, GainManifold, GaussianPattern, TabulatedPattern
from dirmusic.locating.yard_likelihood import Grid


def describe_array(array: ArrayModel) -> dict[str, Any]:
    """Boresights, places and pattern table of the elements; no table for eq. (1) of the Dir-MUSIC paper."""
    manifold, table = array.manifold, None
    if isinstance(manifold.pattern, TabulatedPattern):
        pattern = manifold.pattern
        table = {"off_boresight_rad": pattern.off_boresight_rad.tolist(), "gain": pattern.table_gain.tolist()}
    return {
        "boresights_rad": manifold.boresights_rad.tolist(),
        "boresight_elevations_rad": manifold.boresight_elevations_rad.tolist(),
        "positions_m": array.positions_m.tolist(),
        "pattern": table,
    }


def described_manifold(description: Mapping[str, Any]) -> GainManifold:
    """The manifold of an array from its description; elements are level where it says nothing else."""
    table = description.get("pattern")
    return GainManifold(
        TabulatedPattern(**table) if table else GaussianPattern(),
        description["boresights_rad"],
        boresight_elevations_rad=description.get("boresight_elevations_rad", 0.0),
    )


def describe_grid(grid: Grid) -> dict[str, Any]:
    """Corner, cells and their number."""
    return {"corner_m": grid.corner_m.tolist(), "cell_m": grid.cell_m, "shape": list(grid.shape)}


def described_grid(description: Mapping[str, Any]) -> Grid:
    """The grid of its description."""
    nx, ny = description["shape"]
    return Grid(np.array(description["corner_m"]), description["cell_m"], (nx, ny))
