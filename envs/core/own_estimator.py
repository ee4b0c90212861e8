"""A bearing estimator that the user named, called so that each of its faults is one line."""

from __future__ import annotations

from typing import Any

import numpy as np

from dirmusic import ESTIMATORS, ArrayModel, BearingEstimator, Bearings, PulseBatch
from dirmusic.bearing.estimators import method_std
from pdpatrol.envs.foreign_code import ForeignCodeError, calling, load_object, place_of

EXPECTED = "an estimator: MyEstimator() makes one, estimator(pulses, array) returns dirmusic.Bearings"


class OwnEstimator:
    """Loads, makes and calls an estimator of the user's.

    It is tried once on pulses without noise, so that what cannot work is refused before anything starts. Copies and
    pickles load it anew: an estimator has no memory.

    Args:
        name: `my_file.py:MyEstimator` with an absolute path or one from the current folder, or
            `package.module:MyEstimator`.
        array: Whose pulses it is tried on.

    Raises:
        ForeignCodeError: If it cannot be loaded, made or called, or gives something else than bearings.
    """

    def __init__(self, name: str, array: ArrayModel) -> None:
        self._arguments = name, array
        definition: Any = load_object(name, ".", EXPECTED)
        with calling(definition, EXPECTED):
            self._estimator: BearingEstimator = definition()
        if not callable(self._estimator):
            raise ForeignCodeError(f"{place_of(definition)}: what it makes cannot be called; expected {EXPECTED}")
        method_std(self, array)

    def __call__(self, pulses: PulseBatch, array: ArrayModel) -> Bearings:
        """What the estimator returns, checked; see `dirmusic.BearingEstimator`."""
        n = pulses.n_pulses
        expected = f"three columns of shape ({n},), finite: azimuths, deviations above 0, misfits in [0, 1]"
        with calling(self._estimator, expected):
            found = Bearings(*(np.asarray(column, dtype=np.float64) for column in self._estimator(pulses, array)))
        wrong = [f"{name} of shape {column.shape}" for name, column in found._asdict().items() if column.shape != (n,)]
        if not wrong:
            least = np.where(pulses.variance_v2.any(axis=-1), 0.0, -np.finfo(np.float64).tiny)  # 0 without any noise
            faults = {
                "azimuth_rad": ~np.isfinite(found.azimuth_rad),
                "std_rad": ~((found.std_rad > least) & (found.std_rad < np.inf)),
                "misfit": ~((found.misfit >= 0.0) & (found.misfit <= 1.0)),
            }
            wrong = [f"{name} {getattr(found, name)[bad][0]}" for name, bad in faults.items() if bad.any()]
        if wrong:
            raise ForeignCodeError(f"{place_of(self._estimator)}: returned {', '.join(wrong)}; expected {expected}")
        return found

    def __reduce__(self) -> tuple[type[OwnEstimator], tuple[str, ArrayModel]]:
        return OwnEstimator, self._arguments


def make_estimator(name: str, array: ArrayModel) -> BearingEstimator:
    """The estimator that a scenario names, for an array.

    Raises:
        ForeignCodeError: If it is not built in and does not work.
    """
    return ESTIMATORS[name]() if name in ESTIMATORS else OwnEstimator(name, array)
