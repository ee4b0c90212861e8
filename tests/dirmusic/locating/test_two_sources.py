"""Two sources close to each other: found one by one, or as a finding that is possibly two."""

from functools import cache

import numpy as np
import pytest

from dirmusic import Finding
from dirmusic.arrays import FloatArray
from dirmusic.locating.finding import SQUARE_95
from tests.dirmusic.locating.test_locator import confirmed, detections, listen, path_round

CENTRE_M = np.array([20.0, 15.0, 1.8])
N_CASES = 3


@cache
def surveyed(seed: int, apart_m: float) -> tuple[FloatArray, list[tuple[Finding, ...]]]:
    """Drive round two sources in a random direction from each other, or round one if `apart_m` is 0.

    Returns:
        Positions of the sources, and the findings at all times.
    """
    angle = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi)
    half_m = 0.5 * apart_m * np.array([np.cos(angle), np.sin(angle), 0.0])
    places_m = np.array([CENTRE_M + half_m, CENTRE_M - half_m])[: 1 + (apart_m > 0.0)]
    return places_m, listen(detections(path_round(CENTRE_M[:2], 4.0, 0.0, 250.0, 240), places_m, seed))[1]


def located(seed: int, apart_m: float) -> tuple[FloatArray, list[Finding]]:
    """Return the positions of the sources and the confirmed findings at the end of `surveyed`."""
    places_m, history = surveyed(seed, apart_m)
    return places_m, [finding for finding in history[-1] if finding.state == "confirmed"]


@pytest.mark.whole
@pytest.mark.parametrize("apart_m", [1.0, 1.5, 2.5])
def test_sources_a_metre_and_more_apart_are_found_one_by_one(apart_m: float) -> None:
    n_right = 0
    for seed in range(N_CASES):
        places_m, findings = located(seed, apart_m)
        off_m = np.array([finding.position_m - places_m[:, np.newaxis] for finding in findings])
        is_near = len(findings) == 2 and bool((np.linalg.norm(off_m, axis=-1).min(axis=0) < 0.3).all())
        n_right += is_near and not any(finding.possibly_two for finding in findings)
    assert n_right >= N_CASES - 1


@pytest.mark.whole
def test_pulses_of_places_far_apart_are_not_confirmed_as_one_finding() -> None:
    for seed in range(N_CASES):
        first = dict[int, Finding]()
        for findings in surveyed(seed, 2.5)[1]:
            first = {finding.id: finding for finding in findings if finding.state == "confirmed"} | first
        assert not any(finding.possibly_two for finding in first.values())


@pytest.mark.whole
def test_sources_half_a_metre_apart_are_possibly_two_or_found_one_by_one() -> None:
    """No finding is a confident point between both."""
    n_right = 0
    for seed in range(N_CASES):
        places_m, findings = located(seed, 0.5)
        if len(findings) == 1 and findings[0].possibly_two:
            off_m = places_m[:, :2] - findings[0].position_m[:2]
            inside = np.linalg.solve(findings[0].covariance_m2[:2, :2], off_m.T) * off_m.T
            n_right += bool((inside.sum(axis=0) < SQUARE_95).all())
        n_right += len(findings) == 2
    assert n_right >= N_CASES - 1


@pytest.mark.whole
def test_one_source_is_not_possibly_two() -> None:
    for seed in range(N_CASES):
        _, findings = located(seed, 0.0)
        assert len(findings) == 1
        assert not findings[0].possibly_two


def test_weaker_source_near_another_is_noticed_from_few_places() -> None:
    """Its pulses initiate no track within 2 m of the other source; still, they are not left aside."""
    n_right = 0
    for seed in range(6):
        angle = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi)
        half_m = 0.75 * np.array([np.cos(angle), np.sin(angle), 0.0])
        path = path_round(CENTRE_M[:2], 2.5, 0.0, 342.0, 20)
        weak, strong = (
            detections(path, place_m[np.newaxis], seed, rate=1.0, volts=volts)
            for place_m, volts in ((CENTRE_M + half_m, 0.3), (CENTRE_M - half_m, 1.0))
        )
        stops = [
            (20.0 * k + later_s, pose, pulses)
            for k, pair in enumerate(zip(weak, strong, strict=True))
            for later_s, (_, pose, pulses) in enumerate(pair)
        ]
        findings = confirmed(listen(stops)[0])
        n_right += len(findings) == 2 or any(finding.possibly_two for finding in findings)
    assert n_right >= 4
