"""What a robot knows of the array that its scenario gives it."""

from __future__ import annotations

import numpy as np

from dirmusic import ArrayModel, ElementSpread
from envs.scenario.scenario import Scenario
from sensing import HelicalArray


def known_array(scenario: Scenario) -> ArrayModel:
    """The array's data sheet, and how far real arrays spread about it."""
    nominal = HelicalArray.nominal(scenario.array)
    return ArrayModel(
        manifold=nominal.manifold(),
        positions_m=nominal.positions_m,
        spread=ElementSpread(
            gain=scenario.array.gain_error,
            pointing_rad=float(np.radians(scenario.array.pointing_error_deg)),
            offset=scenario.array.gain_offset / np.sqrt(3),
            pattern=scenario.array.pattern_error,
        ),
        band_manifolds=nominal.band_manifolds(scenario.receiver.band_edges_hz),
    )
