"""Covers detect every target over its aperture from few places."""

from itertools import combinations

import numpy as np
import pytest

from dirmusic.angles import aperture
from pdpatrol.missions.planning.cover import GAP, cover, coverage
from pdpatrol.missions.planning.detectability import Detectability


def drawn(seed: int, n_targets: int = 4, n_columns: int = 10) -> Detectability:
    """Draw targets and places; the first target is not detectable."""
    rng = np.random.default_rng(seed)
    targets_m, places_m = rng.uniform(0.0, 10.0, (n_targets, 3)), rng.uniform(0.0, 10.0, (n_columns, 2))
    away_m = places_m - targets_m[:, np.newaxis, :2]
    is_detectable = rng.uniform(size=(n_targets, n_columns)) < 0.6
    is_detectable[0] = False
    return Detectability(
        names=tuple(map(str, range(n_targets))),
        positions_m=targets_m,
        cells=np.arange(n_columns),
        places_m=places_m,
        level_db=np.zeros(is_detectable.shape),
        range_m=np.linalg.norm(away_m, axis=-1),
        aspect_rad=np.arctan2(away_m[..., 1], away_m[..., 0]),
        is_detectable=is_detectable,
    )


def covers_all(detectability: Detectability, columns: np.ndarray, needed_rad: np.ndarray) -> bool:
    for k in np.flatnonzero(~detectability.is_blind):
        own = columns[detectability.is_detectable[k, columns]]
        if own.size == 0 or aperture(detectability.aspect_rad[k, own]) < needed_rad[k] - 1e-9:
            return False
    return True


@pytest.mark.parametrize("needed_deg", [0.0, 60.0, 150.0])
def test_cover_is_complete_and_nearly_smallest(needed_deg: float) -> None:
    for seed in range(12):
        detectability = drawn(seed)
        everywhere = np.arange(detectability.cells.size)
        needed_rad = np.minimum(coverage(detectability, everywhere)[:, 0], np.radians(needed_deg))
        chosen = cover(detectability, everywhere, needed_rad)
        assert covers_all(detectability, chosen, needed_rad)
        fewer = range(int(chosen.size * (1 - GAP)))  # fewer than the optimality gap allows
        assert not any(
            covers_all(detectability, np.array(some, dtype=np.intp), needed_rad)
            for n in fewer
            for some in combinations(everywhere, n)
        )
