"""The `[array]` table of a scenario file: settings of the array, with paths of files that start at the scenario."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, cast

import numpy as np
from pydantic import BeforeValidator, ValidationInfo

from dirmusic import ArrayModel, ElementSpread
from dirmusic.array.element_errors import UNEXPLAINED
from pdpatrol.envs.scenario.base import beside_the_scenario
from pdpatrol.sensing import ArrayConfig, HelicalArray
from pdpatrol.sensing.array.config import SHIPPED_PATTERNS

PATTERN_KEYS = ("pattern", "true_pattern")


def _start_at_the_scenario(table: object, info: ValidationInfo) -> object:
    if not isinstance(table, dict):
        return table
    table = cast("dict[str, Any]", table)
    named = {key: table[key] for key in PATTERN_KEYS if isinstance(table.get(key), str)}
    paths = {key: path for key, path in named.items() if path not in SHIPPED_PATTERNS}
    return {**table, **{key: beside_the_scenario(path, info) for key, path in paths.items()}}


ArraySection = Annotated[ArrayConfig, BeforeValidator(_start_at_the_scenario)]
"""An `ArrayConfig` whose relative paths start at the scenario's file."""


def data_sheet(config: ArrayConfig, band_edges_hz: Sequence[float] = ()) -> ArrayModel:
    """The array's data sheet, and how far real arrays spread about it.

    Args:
        config: Settings of the array.
        band_edges_hz: Of the sub-bands that the receiver reads, rising, or none.
    """
    nominal = HelicalArray.nominal(config)
    return ArrayModel(
        manifold=nominal.manifold(),
        positions_m=nominal.positions_m,
        spread=ElementSpread(
            gain=config.gain_error,
            pointing_rad=float(np.radians(config.pointing_error_deg)),
            offset=config.gain_offset / np.sqrt(3),
            pattern=config.pattern_error,
            unexplained=UNEXPLAINED,
        ),
        band_manifolds=nominal.band_manifolds(band_edges_hz) if len(band_edges_hz) else (),
    )
