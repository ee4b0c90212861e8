"""Noise behind the band-pass of a receiver."""

import numpy as np
from numpy.typing import NDArray

from pdpatrol.sensing.receiver.front_end import FrontEnd
from pdpatrol.sensing.receiver.sampling import add_noise, settle


def noise_of(front_end: FrontEnd, n: int, n_samples: int, std_v: float = 1.0) -> NDArray[np.float64]:
    """Draw filtered noise, shape (n, n_samples); rows are independent."""
    noise, rng, drawn = front_end.noise_filter(std_v), np.random.default_rng(0), np.zeros((n, n_samples))
    state = np.empty((len(noise.sections), 2, n))
    settle(noise, rng, state)
    add_noise(noise, rng, state, drawn, 0, n_samples)
    return drawn
