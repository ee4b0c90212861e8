"""A Butterworth band-pass as a cascade of second-order sections.

`scipy.signal` makes and runs the same, and a test holds it against this. But it loads SciPy's statistics, for which
every command and every worker would wait for half a second.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def butterworth_sections(order: int, band_hz: tuple[float, float], rate_hz: float) -> FloatArray:
    """Second-order sections b0, b1, b2, 1, a1, a2 of a digital band-pass by the bilinear transform.

    Args:
        order: Of the low-pass prototype; even, and so each pole has its conjugate beside it.
        band_hz: Where the filter is 3 dB down, rising, within (0, rate_hz / 2).
        rate_hz: Samples per second.

    Returns:
        Shape (order, 6): zeros at -1 in the first half, at 1 in the others; poles come nearer and nearer to the unit
        circle, so that no state grows much larger than what comes out. All of the gain is in the first.

    References:
        A. V. Oppenheim, R. W. Schafer, Discrete-Time Signal Processing, 3rd ed., sections 7.2 and 7.3.
    """
    low, high = 2.0 * rate_hz * np.tan(np.pi * np.asarray(band_hz) / rate_hz)  # rad/s, before the transform
    prototype = np.exp(0.5j * np.pi * (1.0 + (2.0 * np.arange(order) + 1.0) / order))
    half = 0.5 * (high - low) * prototype
    root = np.sqrt(half**2 - low * high)
    poles = _to_digital(np.concatenate([half + root, half - root]), rate_hz)
    poles = poles[poles.imag > 0.0]
    poles = poles[np.argsort(np.abs(poles))]
    sections = np.ones((order, 6))
    sections[:, 1] = np.repeat([2.0, -2.0], order // 2)
    sections[:, 4], sections[:, 5] = -2.0 * poles.real, np.abs(poles) ** 2
    middle_rad = float(np.angle(_to_digital(np.array([1j * np.sqrt(low * high)]), rate_hz))[0])
    sections[0, :3] /= abs(response(sections, middle_rad))
    return sections


def _to_digital(s: NDArray[np.complex128], rate_hz: float) -> NDArray[np.complex128]:
    """Bilinear transform."""
    return (2.0 * rate_hz + s) / (2.0 * rate_hz - s)


def response(sections: FloatArray, turn_rad: float) -> complex:
    """Gain for a steady tone that turns by so much from sample to sample."""
    delays = np.exp(-1j * turn_rad * np.arange(3))
    return complex(np.prod((sections[:, :3] @ delays) / (sections[:, 3:] @ delays)))


def run(sections: FloatArray, samples: FloatArray) -> FloatArray:
    """Run forward in time along the last axis, starting from rest; same shape."""
    from scipy.linalg import solve_banded  # here, so that a command line help need not wait for it

    rows = samples.reshape(-1, samples.shape[-1]).T
    for section in sections:
        driven = section[0] * rows
        driven[1:] += section[1] * rows[:-1]
        driven[2:] += section[2] * rows[:-2]
        recursion = np.repeat(section[3:, np.newaxis], len(rows), axis=1)  # a lower triangle of three diagonals
        rows = np.asarray(solve_banded((2, 0), recursion, driven), dtype=np.float64)
    return np.ascontiguousarray(rows.T).reshape(samples.shape)


def state_space(sections: FloatArray) -> tuple[FloatArray, FloatArray]:
    """How the state of the sections, transposed direct form II, goes on, and what a sample of 1 adds to it.

    Returns:
        Shapes (2 n_sections, 2 n_sections) and (2 n_sections, 1); two numbers of each section side by side.
    """
    n = 2 * len(sections)
    state = np.hstack([np.eye(n), np.zeros((n, 1))])  # each column is a case: one state, or a sample that comes in
    into, stepped = np.eye(n + 1)[n], np.empty((n, n + 1))
    for (b0, b1, b2, _, a1, a2), i in zip(sections, range(0, n, 2), strict=True):
        out = b0 * into + state[i]
        stepped[i] = b1 * into - a1 * out + state[i + 1]
        stepped[i + 1] = b2 * into - a2 * out
        into = out
    return stepped[:, :n], stepped[:, n:]
