"""The seam for direction finding: what every bearing estimator promises."""

from __future__ import annotations

from typing import Protocol

from dirmusic.array.model import ArrayModel
from dirmusic.bearing.bearings import Bearings
from dirmusic.pulses.batch import PulseBatch


class BearingEstimator(Protocol):
    """Turns the strengths of detected pulses into directions of arrival.

    An estimator knows the array's data sheet, never the truth. It is called once for all pulses of a control step, of
    one robot or of many: row i of the answer must depend on row i of the pulses alone, so that a mission does not
    depend on how many robots run beside it. Channels that are at fault are left out before the call, from the pulses
    and from the array alike, so that the number of elements may shrink in the course of a mission.
    """

    def __call__(self, pulses: PulseBatch, array: ArrayModel) -> Bearings:
        """Directions of the pulses.

        Args:
            pulses: What the receiver detected, n_pulses rows, n_pulses >= 0; its own direction columns are not set yet.
            array: Data sheet of the channels in use; `array.manifold` has an element for each strength of a pulse.

        Returns:
            Columns of shape (n_pulses,), all finite: azimuths in the array frame, radians; their standard deviations
            by noise and by the method itself, radians, > 0, pi where a pulse tells nothing; and the share of its energy
            that the direction does not explain, in [0, 1] (`bearings_towards` gives deviation by noise
            and misfit of any direction).
        """
        ...
