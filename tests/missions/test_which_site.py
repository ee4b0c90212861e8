"""Probabilities of the sites of a finding."""

import numpy as np
import pytest

from pdpatrol.envs.random_yard import random_yard
from pdpatrol.missions.record.which_site import ELSEWHERE, site_probabilities

YARD = random_yard(3, 10).yard
SHARP, BLUNT = np.diag([0.01, 0.01, 0.02]), np.diag([0.5, 0.5, 1.0])


def most_likely(position_m: np.ndarray, covariance_m2: np.ndarray) -> str:
    return next(iter(site_probabilities(YARD, position_m, covariance_m2)))


def test_most_likely_place_of_a_finding() -> None:
    for name in YARD.site_names():
        assert most_likely(YARD.site_position(name), SHARP) == name
        assert site_probabilities(YARD, YARD.site_position(name), SHARP)[name] > 0.5
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
    sharp, blunt = (site_probabilities(YARD, at_m, covariance) for covariance in (SHARP, BLUNT))
    for places in (sharp, blunt):
        assert sum(places.values()) == pytest.approx(1.0)
        assert len(places) == len(YARD.site_names()) + len(YARD.equipment) + 1
    assert max(blunt.values()) < max(sharp.values())


def test_probabilities_are_calibrated() -> None:
    """Stated probabilities equal the frequencies for findings that scatter according to their covariance."""
    rng, sites = np.random.default_rng(1), YARD.site_names()
    covariance = np.diag([0.09, 0.09, 0.16])
    stated, right = np.empty(400), np.empty(400)
    for k in range(400):
        name = sites[k % len(sites)]
        places = site_probabilities(YARD, rng.multivariate_normal(YARD.site_position(name), covariance), covariance)
        stated[k], right[k] = places[name], next(iter(places)) == name
    assert right.mean() > 0.6
    assert stated.mean() == pytest.approx(right.mean(), abs=0.2)
