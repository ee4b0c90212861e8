"""Covers: every target under its aperture, from few places."""

from itertools import combinations

import numpy as np
import pytest

from dirmusic.angles import aperture
from pdpatrol.missions.planning.cover import GAP, apertures, candidates, cover
from pdpatrol.missions.planning.hearing import Hearing, Target
from tests.missions.planning.one_plan import plan_of


def drawn(seed: int, n_targets: int = 4, n_columns: int = 10) -> Hearing:
    """Targets and places at random; one target is heard nowhere."""
    rng = np.random.default_rng(seed)
    targets_m, places_m = rng.uniform(0.0, 10.0, (n_targets, 3)), rng.uniform(0.0, 10.0, (n_columns, 2))
    away_m = places_m - targets_m[:, np.newaxis, :2]
    is_heard = rng.uniform(size=(n_targets, n_columns)) < 0.6
    is_heard[0] = False
    return Hearing(
        targets=tuple(Target(str(k), at_m) for k, at_m in enumerate(targets_m)),
        cells=np.arange(n_columns),
        places_m=places_m,
        level_db=np.zeros(is_heard.shape),
        range_m=np.linalg.norm(away_m, axis=-1),
        aspect_rad=np.arctan2(away_m[..., 1], away_m[..., 0]),
        is_heard=is_heard,
    )


def hears_all(hearing: Hearing, columns: np.ndarray, needed_rad: np.ndarray) -> bool:
    for k in np.flatnonzero(~hearing.is_blind):
        heard = columns[hearing.is_heard[k, columns]]
        if heard.size == 0 or aperture(hearing.aspect_rad[k, heard]) < needed_rad[k] - 1e-9:
            return False
    return True


@pytest.mark.parametrize("needed_deg", [0.0, 60.0, 150.0])
def test_a_cover_hears_all_from_about_as_few_places_as_any(needed_deg: float) -> None:
    for seed in range(12):
        hearing = drawn(seed)
        needed_rad = np.minimum(apertures(hearing), np.radians(needed_deg))
        everywhere = np.arange(hearing.cells.size)
        chosen = cover(hearing, everywhere, needed_rad)
        assert hears_all(hearing, chosen, needed_rad)
        fewer = range(int(chosen.size * (1 - GAP)))  # what the gap leaves open does not count
        assert not any(
            hears_all(hearing, np.array(some, dtype=np.intp), needed_rad)
            for n in fewer
            for some in combinations(everywhere, n)
        )


def test_where_nothing_is_heard_no_place_is_needed() -> None:
    hearing = drawn(0)
    deaf = hearing._replace(is_heard=np.zeros_like(hearing.is_heard))
    assert cover(deaf, np.arange(10), np.zeros(4)).size == 0


def test_candidates_offer_every_site_the_aperture_that_all_cells_offer(monkeypatch: pytest.MonkeyPatch) -> None:
    plan = plan_of("one_source")
    hearing, clearance_m = plan.hearing, plan.site_map.clearance_m[plan.hearing.cells]
    monkeypatch.setattr("pdpatrol.missions.planning.cover.SPACING_M", 12.0)
    for needed_rad in (np.minimum(apertures(hearing), np.radians(needed_deg)) for needed_deg in (60.0, 200.0)):
        columns = candidates(hearing, clearance_m, needed_rad)
        assert (apertures(hearing, columns) >= needed_rad - 1e-9).all()
        assert hearing.is_heard[:, columns].any(axis=0).all()
        assert 9 < columns.size < 100
