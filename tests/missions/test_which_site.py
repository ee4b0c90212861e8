"""Probabilities of the sites of a finding."""

import numpy as np
import pytest

from pdpatrol.envs.random_yard import random_yard
from pdpatrol.missions.record.which_site import ELSEWHERE, ON_EQUIPMENT, ON_SITES, site_probabilities

YARD = random_yard(3, 10).yard
SITES_M = {name: YARD.site_position(name) for name in YARD.site_names()}
SHARP, BLUNT = np.diag([0.01, 0.01, 0.02]), np.diag([0.5, 0.5, 1.0])


def most_likely(position_m: np.ndarray, covariance_m2: np.ndarray) -> str:
    return next(iter(site_probabilities(YARD, position_m, covariance_m2, 0.05)))


def test_most_likely_place_of_a_finding() -> None:
    for name in YARD.site_names():
        assert most_likely(YARD.site_position(name), SHARP) == name
        assert site_probabilities(YARD, YARD.site_position(name), SHARP, 0.15)[name] > 0.5
    places = YARD.free_place(np.random.default_rng(0), 2.0)
    assert most_likely(np.array([*places, 1.0]), SHARP) == ELSEWHERE


def test_place_off_sites_is_named_by_its_piece() -> None:
    item = max(YARD.equipment, key=lambda one: float(one.solids.half_size_m.prod(axis=-1).max()))
    k = int(item.solids.half_size_m.prod(axis=-1).argmax())
    roof_m = np.append(item.solids.centre_m[k], item.solids.top_m[k])
    assert min(np.linalg.norm(YARD.site_position(name) - roof_m) for name in YARD.site_names()) > 0.5
    assert most_likely(roof_m, SHARP) == item.name


def test_probabilities_add_up_to_one() -> None:
    at_m = YARD.site_position(YARD.site_names()[0])
    sharp, blunt = (site_probabilities(YARD, at_m, covariance, 0.15) for covariance in (SHARP, BLUNT))
    for places in (sharp, blunt):
        assert sum(places.values()) == pytest.approx(1.0)
        assert len(places) == len(YARD.site_names()) + len(YARD.equipment) + 1
    assert max(blunt.values()) < max(sharp.values())


@pytest.mark.whole
@pytest.mark.parametrize(("displacement", "accuracy_m"), [("normal", 0.3), ("tails", 0.15), ("0.3 m", 0.15)])
def test_probabilities_are_calibrated_with_displaced_pieces(displacement: str, accuracy_m: float) -> None:
    """Stated probabilities equal frequencies, and the place named first is right as often as the nearest site.

    Places follow the prior. Pieces are displaced as believed, with the tails of Student's t of 4 degrees of freedom, or
    all by twice the accuracy. Findings scatter with tails heavier than their covariance states.
    """
    rng, sites, n = np.random.default_rng(1), [*SITES_M], 200
    stated, right, nearest = np.empty((3, n))
    for k in range(n):
        off_m = accuracy_m * (rng.standard_t(4, 2) / np.sqrt(2) if displacement == "tails" else rng.standard_normal(2))
        if displacement == "0.3 m":
            off_m *= 0.3 / np.linalg.norm(off_m)
        place_m, truth = rng.uniform([0.0, 0.0, 0.0], [*YARD.size_m, 5.0]), ELSEWHERE
        if rng.random() < ON_SITES / (1.0 - ON_EQUIPMENT):  # other places on equipment are omitted
            truth = sites[rng.integers(len(sites))]
            place_m = SITES_M[truth] - [*off_m, 0.0]
        std_m = rng.uniform(0.03, 0.12, 3)
        found_m = place_m + std_m * rng.standard_t(6, 3)
        first, stated[k] = next(iter(site_probabilities(YARD, found_m, np.diag(std_m**2), accuracy_m).items()))
        right[k] = first == truth
        nearest[k] = truth == min(sites, key=lambda name: float(np.linalg.norm(SITES_M[name] - found_m)))
    assert right.mean() >= nearest.mean()
    assert stated.mean() == pytest.approx(right.mean(), abs=0.03)
    assert right[stated > 0.99].mean() > 0.985
    assert (stated > 0.9).mean() > 0.75
