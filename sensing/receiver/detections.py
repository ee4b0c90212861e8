"""What listening gives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from dirmusic.pulses.batch import PulseBatch

FloatArray = NDArray[np.float64]


class Detections(NamedTuple):
    """What one interval of listening gave: nothing is an answer, with no pulse. Robot by robot, and then by time.

    Attributes:
        robot: Number of the robot that detected each pulse, shape (n_pulses,).
        pulses: The pulses, their directions not known yet.
        waveforms_v: The gates, shape (n_pulses, n_elements, gate_samples), volts.
        n_rejected: What triggered and did not look like a pulse.
    """

    robot: NDArray[np.intp]
    pulses: PulseBatch
    waveforms_v: FloatArray
    n_rejected: int

    @classmethod
    def join(cls, parts: Sequence[Detections]) -> Self:
        """All detections of some parts, in order."""
        robot = np.concatenate([part.robot for part in parts])
        pulses = PulseBatch.join([part.pulses for part in parts])
        order = np.lexsort((pulses.time_s, robot))
        return cls(
            robot=robot[order],
            pulses=pulses.take(order),
            waveforms_v=np.concatenate([part.waveforms_v for part in parts])[order],
            n_rejected=sum(part.n_rejected for part in parts),
        )
