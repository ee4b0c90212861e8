"""Which pulses look like one plane wave from one direction."""

import numpy as np
import pytest

from dirmusic import ESTIMATORS, ArrayModel, BearingEstimator, ElementSpread, GainManifold, PulseBatch
from dirmusic.bearing.maximum_likelihood import MaximumLikelihood
from dirmusic.locating.plane_wave import MethodDeviation, is_credible
from dirmusic.locating.rules import CredibilityRules

LIKELIHOOD = MaximumLikelihood()
NOMINAL = GainManifold.ring(6)
ARRAY = ArrayModel(
    manifold=NOMINAL, positions_m=np.zeros((6, 3)), spread=ElementSpread(gain=0.05, pointing_rad=np.radians(2.0))
)


def pulses_of(strengths: np.ndarray, estimator: BearingEstimator = LIKELIHOOD) -> PulseBatch:
    """Pulses of these strengths (n, 6) in noise of 1 mV with their directions."""
    pulses = PulseBatch.detected(np.zeros(len(strengths)), strengths, np.full(strengths.shape, 1e-6))
    found = estimator(pulses, ARRAY)
    return pulses._replace(azimuth_rad=found.azimuth_rad, std_rad=found.std_rad, misfit=found.misfit)


def credible(pulses: PulseBatch, estimator: BearingEstimator = LIKELIHOOD) -> list[bool]:
    return is_credible(pulses, ARRAY, MethodDeviation(estimator, ARRAY).of(pulses), CredibilityRules()).tolist()


def test_strengths_that_no_direction_explains_are_not_credible() -> None:
    pulses = pulses_of(np.array([[1.0, 0.1, 1.0, 0.1, 1.0, 0.1], 0.5 * NOMINAL.gain(0.3), np.zeros(6)]))
    assert credible(pulses) == [False, True, False]


@pytest.mark.parametrize("elevation_deg", [20.0, 37.0, 52.0, 70.0])
def test_what_stands_above_is_credible_though_it_is_no_plane_wave_in_the_plane(elevation_deg: float) -> None:
    rng = np.random.default_rng(3)
    azimuth, pointing = rng.uniform(-np.pi, np.pi, (200, 1)), rng.normal(0.0, np.radians(2.0), (200, 6))
    off = azimuth - NOMINAL.boresights_rad - pointing
    gain = NOMINAL.response_in_space(off, np.full((200, 1), np.radians(elevation_deg))).gain
    pulses = pulses_of(0.5 * gain * (1.0 + rng.normal(0.0, 0.05, (200, 6))))
    assert np.mean(credible(pulses)) > 0.97
    if elevation_deg > 45.0:
        assert np.median(pulses.misfit) > 3 * 0.02  # three times what an array off by so much leaves in the plane


def test_a_pulse_too_weak_to_tell_its_direction_is_not_credible() -> None:
    assert credible(pulses_of(np.array([0.5, 0.005])[:, np.newaxis] * NOMINAL.gain(0.3))) == [True, False]


def test_a_pulse_that_met_the_end_of_the_scale_in_a_channel_in_use_is_not_credible() -> None:
    pulses = pulses_of(np.tile(0.5 * NOMINAL.gain(0.3), (3, 1)))
    is_clipped, is_usable = np.zeros((3, 6), dtype=np.bool_), np.ones((3, 6), dtype=np.bool_)
    is_clipped[1:, 2] = True
    is_usable[2, 2] = False
    assert credible(pulses._replace(is_clipped=is_clipped, is_usable=is_usable)) == [True, False, True]


def test_the_own_deviation_of_maximum_likelihood_is_none_and_that_of_the_loudest_element_its_sector() -> None:
    pulses = pulses_of(0.5 * NOMINAL.gain(np.linspace(-3.0, 3.0, 25)).T)
    np.testing.assert_array_equal(MethodDeviation(LIKELIHOOD, ARRAY).of(pulses), 0.0)
    sector_rad = MethodDeviation(ESTIMATORS["strongest"](), ARRAY).of(pulses)
    np.testing.assert_allclose(sector_rad, np.radians(60.0) / np.sqrt(12.0), rtol=0.02)  # uniform over 60 degrees


@pytest.mark.parametrize("method", ESTIMATORS)
def test_a_strong_pulse_is_credible_and_a_weak_one_is_not_however_coarse_the_estimator(method: str) -> None:
    estimator = ESTIMATORS[method]()
    for azimuth_deg in range(0, 360, 10):
        gain = NOMINAL.gain(np.radians(azimuth_deg))
        assert credible(pulses_of(np.array([0.5, 0.005])[:, np.newaxis] * gain, estimator), estimator) == [True, False]


def test_the_own_deviation_is_that_of_the_channels_in_use() -> None:
    strongest = ESTIMATORS["strongest"]()
    pulses = pulses_of(np.tile(0.5 * NOMINAL.gain(np.pi / 2), (2, 1)), strongest)  # element 1 looks there
    is_usable = np.ones((2, 6), dtype=np.bool_)
    is_usable[1, 1] = False
    whole_rad, partial_rad = MethodDeviation(strongest, ARRAY).of(pulses._replace(is_usable=is_usable))
    assert partial_rad > 1.2 * whole_rad  # it takes half the sector of its neighbour
