"""Labels of the plan."""

import numpy as np
import pytest
from numpy.typing import ArrayLike

from pdpatrol.missions.designations import bay_of, without_phase
from pdpatrol.missions.recording.labels import (
    AROUND_PX,
    CHARACTER_PX,
    LABEL_HEIGHT_PX,
    MARGIN_PX,
    equipment_labels,
    fitting,
)


@pytest.mark.parametrize("shifts_px", [((0.0, 0.0),), AROUND_PX])
def test_labels_that_are_kept_do_not_overlap_and_none_is_dropped_without_need(
    shifts_px: list[tuple[float, float]],
) -> None:
    rng, pixel_size_m = np.random.default_rng(5), 0.1
    places = {f"piece_{k}" + "x" * int(rng.integers(8)): [*rng.uniform(0.0, 60.0, 2), 0.0] for k in range(60)}
    kept = fitting(places, pixel_size_m, [], shifts_px)
    size_m = {name: pixel_size_m * np.array([CHARACTER_PX * len(name) + MARGIN_PX, LABEL_HEIGHT_PX]) for name in places}

    def overlap(one: str, at_m: ArrayLike, other: str) -> bool:
        apart_m = np.abs(np.subtract(at_m, kept[other])[:2]) + 1e-9
        return bool((apart_m < [0.5 * (size_m[one] + size_m[other])[0], size_m[one][1]]).all())

    assert 5 < len(kept) < len(places)
    assert not [(a, b) for a in kept for b in kept if a < b and overlap(a, kept[a], b)]
    for name in set(places) - set(kept):
        for right_px, up_px in shifts_px:
            at_m = np.add(places[name], [pixel_size_m * right_px, pixel_size_m * up_px, 0.0])
            assert any(overlap(name, at_m, other) for other in kept)


def test_pieces_of_one_bay_share_a_label_at_their_middle() -> None:
    names = ("e01_qb1", "ct_2_a", "busbar_a", "e08_e14_ua1")
    assert [bay_of(name) or without_phase(name) for name in names] == ["e01", "ct_2", "busbar_a", "e08_e14_ua1"]
    solids = [
        {"name": f"equipment/e01_{part}", "shape": "cylinder", "size_m": [0.2, 1.0, 0.0], "position_m": [x, 5.0, 1.0]}
        for part, x in (("qa1", 2.0), ("qb1", 6.0))
    ]
    (place,) = equipment_labels(solids, 0.1).values()
    np.testing.assert_allclose(place[:2], [4.0, 5.2 + 0.1 * LABEL_HEIGHT_PX])


def test_pieces_with_sites_are_labelled_before_larger_ones() -> None:
    solids = [
        {"name": f"equipment/{name}", "shape": "box", "size_m": [size_m] * 3, "position_m": [5.0, 5.0, 1.0]}
        for name, size_m in (("house", 4.0), ("ct_2_a", 0.5), ("wall", 1.0), ("breaker_1", 0.8))
    ]
    assert list(equipment_labels(solids, 0.1, {"ct_2_a", "breaker_1"})) == ["breaker_1", "ct_2", "house", "wall"]
