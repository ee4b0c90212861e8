"""Two emitters at once."""

from typing import Any

import numpy as np

from dirmusic.locating.level_model import LevelChannel, LevelModel, LevelRows
from dirmusic.locating.level_pair import locate_two_levels

MODEL = LevelModel((LevelChannel(),), white_db=1.0, shadow_db=0.0, least_range_m=1.0)
CELL_M = np.stack(np.meshgrid(np.arange(0.0, 100.0, 10.0), np.arange(0.0, 100.0, 10.0)), axis=-1).reshape(-1, 2)


def test_pair_is_found_where_powers_add() -> None:
    """Of 20 pairs, at least 14 are found to within a cell, the stronger emitter first (16 when written)."""
    rng = np.random.default_rng(0)
    n_found = 0
    for _ in range(20):
        receiver_m = rng.uniform(0.0, 90.0, (25, 2))
        first, second = CELL_M[rng.choice(len(CELL_M), 2, replace=False)]
        range_m = [np.maximum(np.linalg.norm(receiver_m - each, axis=1), 1.0) for each in (first, second)]
        level_db = 10 * np.log10(range_m[0] ** -2.0 + 0.3 * range_m[1] ** -2.0) + rng.normal(0.0, 1.0, 25)
        rows = LevelRows(level_db - 50.0, receiver_m, np.zeros(25), np.zeros(25, dtype=np.intp))
        found = locate_two_levels(rows, MODEL, CELL_M)
        n_found += np.linalg.norm(found.position_m - [first, second], axis=1).max() < 15.0
    assert n_found >= 14


def test_exchange_of_receivers_changes_nothing() -> None:
    rng = np.random.default_rng(1)
    rows = LevelRows(
        rng.normal(-60.0, 5.0, 12), rng.uniform(0.0, 90.0, (12, 2)), np.zeros(12), np.zeros(12, dtype=np.intp)
    )
    order = rng.permutation(12)
    columns: list[Any] = [column[order] for column in rows]
    other = LevelRows(*columns)
    first, second = (locate_two_levels(each, MODEL, CELL_M) for each in (rows, other))
    np.testing.assert_array_equal(first.position_m, second.position_m)
    np.testing.assert_allclose(first.probability, second.probability, rtol=1e-9)
