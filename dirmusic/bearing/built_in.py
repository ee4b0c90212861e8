"""The estimators that a scenario can name."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.manifold import SEARCH_AZIMUTHS_RAD
from dirmusic.array.model import ArrayModel
from dirmusic.bearing.coarse_estimators import Music, Strongest
from dirmusic.bearing.estimator import BearingEstimator
from dirmusic.bearing.maximum_likelihood import MaximumLikelihood
from dirmusic.pulses.batch import PulseBatch


def _sub_bands() -> BearingEstimator:
    from dirmusic.bearing.sub_band_likelihood import SubBandLikelihood  # loads the compiler

    return SubBandLikelihood()


ESTIMATORS: dict[str, Callable[[], BearingEstimator]] = {
    "maximum_likelihood": MaximumLikelihood,
    "sub_bands": _sub_bands,
    "music": Music,
    "strongest": Strongest,
}
"""By name, the best first."""


def method_std(estimator: BearingEstimator, array: ArrayModel) -> NDArray[np.float64]:
    """Deviation that an estimator states of itself where there is no noise, for each of `SEARCH_AZIMUTHS_RAD`, radians.

    Zero for maximum likelihood, about 17 degrees for the loudest of six elements.
    """
    strengths = array.manifold.gain(SEARCH_AZIMUTHS_RAD).T.copy()
    return estimator(PulseBatch.detected(np.zeros(len(strengths)), strengths, np.zeros_like(strengths)), array).std_rad
