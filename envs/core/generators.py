"""One generator of random numbers for each subsystem, so that a draw more in one shifts nothing in the others."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np


class Generators(NamedTuple):
    """Of one episode. Two policies on one seed meet the same sources, array and emissions, whatever they do.

    Attributes:
        episode: What is drawn at the start: sources and their amplitudes, the array as built, the heading at the dock.
        motion: Errors of pose sensor, odometry and gyro.
        lidar: Noise of its ranges.
        nature: When sources discharge, and how strongly.
        receiver: Noise in its channels, and what that triggers.
        policy: For policies that draw.
        polarisation: Of the sources.
    """

    episode: np.random.Generator
    motion: np.random.Generator
    lidar: np.random.Generator
    nature: np.random.Generator
    receiver: np.random.Generator
    policy: np.random.Generator
    polarisation: np.random.Generator

    @classmethod
    def spawn(cls, parent: np.random.Generator) -> Self:
        """Independent children of a generator; each call gives new ones, the same for the same seed of the parent."""
        return cls(*parent.spawn(len(cls._fields)))
