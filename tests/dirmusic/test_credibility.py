"""Which pulses look like one plane wave from one direction."""

import numpy as np

from dirmusic import ArrayModel, ElementSpread, GainManifold, PulseBatch
from dirmusic.bearing.maximum_likelihood import MaximumLikelihood
from dirmusic.locating.credibility import is_credible
from dirmusic.locating.rules import CredibilityRules

NOMINAL = GainManifold.ring(6)
ARRAY = ArrayModel(
    manifold=NOMINAL, positions_m=np.zeros((6, 2)), spread=ElementSpread(gain=0.05, pointing_rad=np.radians(2.0))
)


def pulses_of(strengths: np.ndarray, variance_v2: float = 1e-6) -> PulseBatch:
    """Pulses of these strengths (n, 6) with their likeliest directions."""
    pulses = PulseBatch.detected(np.zeros(len(strengths)), strengths, np.full(strengths.shape, variance_v2))
    found = MaximumLikelihood()(pulses, ARRAY)
    return pulses._replace(azimuth_rad=found.azimuth_rad, std_rad=found.std_rad, misfit=found.misfit)


def credible(pulses: PulseBatch) -> list[bool]:
    return is_credible(pulses, ARRAY, CredibilityRules()).tolist()


def test_strengths_that_no_direction_explains_are_not_credible() -> None:
    pulses = pulses_of(np.array([[1.0, 0.1, 1.0, 0.1, 1.0, 0.1], 0.5 * NOMINAL.gain(0.3), np.zeros(6)]))
    assert credible(pulses) == [False, True, False]


def test_a_pulse_too_weak_to_tell_its_direction_is_not_credible() -> None:
    assert credible(pulses_of(np.array([0.5, 0.005])[:, np.newaxis] * NOMINAL.gain(0.3))) == [True, False]


def test_a_pulse_that_met_the_end_of_the_scale_in_a_channel_in_use_is_not_credible() -> None:
    pulses = pulses_of(np.tile(0.5 * NOMINAL.gain(0.3), (3, 1)))
    is_clipped, is_usable = np.zeros((3, 6), dtype=np.bool_), np.ones((3, 6), dtype=np.bool_)
    is_clipped[1:, 2] = True
    is_usable[2, 2] = False
    assert credible(pulses._replace(is_clipped=is_clipped, is_usable=is_usable)) == [True, False, True]
