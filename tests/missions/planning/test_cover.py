"""Covers detect every target over its aperture from few places."""

from itertools import combinations

import numpy as np
import pytest

from dirmusic.angles import aperture, azimuth_of
from pdpatrol.missions.planning.cover import GAP, cover, coverage
from pdpatrol.missions.planning.detectability import Detectability


def drawn(seed: int, n_targets: int = 4, n_columns: int = 10) -> Detectability:
    """Draw targets and places; the first target is not detectable."""
    rng = np.random.default_rng(seed)
    targets_m, places_m = rng.uniform(0.0, 10.0, (n_targets, 3)), rng.uniform(0.0, 10.0, (n_columns, 2))
    target, column = np.nonzero(rng.uniform(size=(n_targets, n_columns)) < 0.6)
    target, column = target[target > 0], column[target > 0]
    aspect_rad = azimuth_of(places_m[column] - targets_m[target, :2])
    order = np.lexsort((aspect_rad, target))
    return Detectability(
        names=tuple(map(str, range(n_targets))),
        positions_m=targets_m,
        cells=np.arange(n_columns),
        places_m=places_m,
        first=np.append(0, np.cumsum(np.bincount(target, minlength=n_targets))),
        column=column[order],
        level_db=np.zeros(order.size),
        range_m=np.ones(order.size),
        aspect_rad=aspect_rad[order],
    )


def covers_all(detectability: Detectability, columns: np.ndarray, needed_rad: np.ndarray) -> bool:
    for k in np.flatnonzero(~detectability.is_blind):
        pairs = detectability.pairs(int(k))
        own = np.isin(detectability.column[pairs], columns)
        if not own.any() or aperture(detectability.aspect_rad[pairs][own]) < needed_rad[k] - 1e-9:
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


def test_coverage_is_that_of_the_angles_of_each_target() -> None:
    for seed in range(5):
        where, cells = drawn(seed, n_columns=30), np.arange(0, 30, 2)
        for k, (wide_rad, crossing_rad, n_cells) in enumerate(coverage(where, cells).tolist()):
            pairs = where.pairs(k)
            seen_rad = where.aspect_rad[pairs][np.isin(where.column[pairs], cells)]
            assert n_cells == seen_rad.size
            assert wide_rad == pytest.approx(aperture(seen_rad))
            assert crossing_rad == pytest.approx(min(0.5 * aperture(2.0 * seen_rad), 0.5 * np.pi))
