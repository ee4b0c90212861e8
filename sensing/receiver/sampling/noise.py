"""Noise behind the band-pass, in compiled loops."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from pdpatrol.sensing.receiver.front_end import NoiseFilter

FloatArray = NDArray[np.float64]


@compiled
def settle(noise: NoiseFilter, rng: np.random.Generator, state: FloatArray) -> None:
    """Draw the state that the filter has after a long time in white noise.

    Args:
        noise: The filter.
        rng: Draws.
        state: Becomes that of each channel, shape (n_sections, 2, n_elements).
    """
    n_states, n_elements = noise.settled.shape[0], state.shape[2]
    row = np.empty(n_elements)
    state[:] = 0.0
    for j in range(n_states):
        for e in range(n_elements):
            row[e] = rng.standard_normal()
        for i in range(n_states):
            into, share = state[i // 2, i % 2], noise.settled[i, j]
            for e in range(n_elements):
                into[e] += share * row[e]


@compiled
def add_noise(noise: NoiseFilter, rng: np.random.Generator, state: FloatArray, record_v: FloatArray) -> None:
    """Add noise behind the filter to a record (n_samples, n_elements); the state goes on, for the next piece of it."""
    n_elements, sections = record_v.shape[1], noise.sections
    row = np.empty(n_elements)
    for t in range(record_v.shape[0]):
        for e in range(n_elements):
            row[e] = rng.standard_normal()
        for s in range(sections.shape[0]):
            b0, b1, b2, a1, a2 = sections[s, 0], sections[s, 1], sections[s, 2], sections[s, 4], sections[s, 5]
            z1, z2 = state[s, 0], state[s, 1]
            for e in range(n_elements):
                into = row[e]
                out = b0 * into + z1[e]
                z1[e] = b1 * into - a1 * out + z2[e]
                z2[e] = b2 * into - a2 * out
                row[e] = out
        for e in range(n_elements):
            record_v[t, e] += noise.std_v * row[e]


@compiled
def tail_probability(sigmas: float) -> float:
    """That a standard normal number is larger."""
    return 0.5 * math.erfc(sigmas * math.sqrt(0.5))


@compiled
def draw_tail(sigmas: float, rng: np.random.Generator) -> float:
    """A standard normal number, given that it is larger than `sigmas`.

    By rejection from an exponential (C. P. Robert, Simulation of truncated normal variables, 1995); below 0.5 simply
    from normal numbers.
    """
    if sigmas < 0.5:
        drawn = rng.standard_normal()
        while drawn <= sigmas:
            drawn = rng.standard_normal()
        return drawn
    rate = 0.5 * (sigmas + math.sqrt(sigmas * sigmas + 4.0))
    while True:
        drawn = sigmas - math.log(1.0 - rng.random()) / rate
        if rng.random() <= math.exp(-0.5 * (drawn - rate) ** 2):
            return drawn
