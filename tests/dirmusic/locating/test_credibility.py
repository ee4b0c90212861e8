"""Pulses that are consistent with a single plane wave, and pulses that are not."""

import numpy as np
import pytest

from dirmusic import ESTIMATORS, BearingEstimator, PulseBatch
from dirmusic.bearing.maximum_likelihood import maximum_likelihood
from dirmusic.locating.plane_wave import MethodDeviation, is_credible
from dirmusic.locating.rules import CredibilityRules
from tests.dirmusic.scenes import ARRAY, RING, detected, with_bearings


def pulses_of(strengths: np.ndarray, estimator: BearingEstimator = maximum_likelihood) -> PulseBatch:
    """Make pulses of strengths (n, 6) in noise of 1 mV with their directions."""
    return with_bearings(detected(strengths, 1e-3), ARRAY, estimator)


def credible(pulses: PulseBatch, estimator: BearingEstimator = maximum_likelihood) -> list[bool]:
    return is_credible(pulses, ARRAY, MethodDeviation(estimator, ARRAY).of(pulses), CredibilityRules()).tolist()


def test_strengths_of_no_plane_wave_are_not_credible() -> None:
    pulses = pulses_of(np.array([[1.0, 0.1, 1.0, 0.1, 1.0, 0.1], 0.5 * RING.gain(0.3), np.zeros(6)]))
    assert credible(pulses) == [False, True, False]


@pytest.mark.parametrize("elevation_deg", [20.0, 37.0, 52.0, 70.0])
def test_source_above_is_credible(elevation_deg: float) -> None:
    rng = np.random.default_rng(3)
    off = rng.uniform(-np.pi, np.pi, (200, 1)) - rng.normal(RING.boresights_rad, np.radians(2.0), (200, 6))
    gain = RING.response_in_space(off, np.full((200, 1), np.radians(elevation_deg))).gain
    pulses = pulses_of(0.5 * gain * (1.0 + rng.normal(0.0, 0.05, (200, 6))))
    assert np.mean(credible(pulses)) > 0.97
    if elevation_deg > 45.0:
        assert np.median(pulses.misfit) > 3 * 0.02  # three times the misfit in the plane with the same array errors


def test_clipped_pulse_is_not_credible() -> None:
    pulses = pulses_of(np.tile(0.5 * RING.gain(0.3), (3, 1)))
    is_clipped, is_usable = np.zeros((3, 6), dtype=np.bool_), np.ones((3, 6), dtype=np.bool_)
    is_clipped[1:, 2] = True
    is_usable[2, 2] = False
    assert credible(pulses._replace(is_clipped=is_clipped, is_usable=is_usable)) == [True, False, True]


@pytest.mark.parametrize("method", ESTIMATORS)
def test_credibility_does_not_depend_on_the_estimator(method: str) -> None:
    estimator = ESTIMATORS[method]
    for azimuth_deg in range(0, 360, 10):
        gain = RING.gain(np.radians(azimuth_deg))
        assert credible(pulses_of(np.array([0.5, 0.005])[:, np.newaxis] * gain, estimator), estimator) == [True, False]


def test_method_deviation_is_that_of_usable_channels() -> None:
    strongest = ESTIMATORS["strongest"]
    pulses = pulses_of(np.tile(0.5 * RING.gain(np.pi / 2), (2, 1)), strongest)  # element 1 looks there
    is_usable = np.ones((2, 6), dtype=np.bool_)
    is_usable[1, 1] = False
    whole_rad, partial_rad = MethodDeviation(strongest, ARRAY).of(pulses._replace(is_usable=is_usable))
    assert whole_rad == pytest.approx(np.radians(60.0) / np.sqrt(12.0), rel=0.02)  # uniform over 60 degrees
    assert partial_rad > 1.2 * whole_rad  # it takes half the sector of its neighbour
