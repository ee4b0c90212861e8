"""Gates, in compiled loops: what a receiver reads from them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from dirmusic.kernels import dot
from dirmusic.pulses.batch import NO_DIRECTION, PulseBatch
from dirmusic.pulses.strength_kernels import strength_of, variance_of_strength

FloatArray = NDArray[np.float64]


class GateParameters(NamedTuple):
    """What a receiver knows of its gates.

    Attributes:
        energy_spread: Spread of the noise energies, as of `dirmusic.strength_variance`.
        noise_on_pulse: Noise on a pulse, as of `dirmusic.strength_variance`.
        mains_hz: Frequency of the receiver's own mains supply.
        full_v: What is at least so large is clipped.
    """

    energy_spread: float
    noise_on_pulse: float
    mains_hz: float
    full_v: float


@compiled
def read_gate(
    waveforms_v: FloatArray, background_v2: FloatArray, time_s: float, gate: GateParameters, k: int, pulses: PulseBatch
) -> None:
    """Read strengths, their variance, what is clipped, and the phase of the mains, into a row of a batch.

    Args:
        waveforms_v: The gate behind the converter, shape (n_elements, n_samples).
        background_v2: Power of a sample without a pulse, shape (n_elements,).
        time_s: Of the trigger.
        gate: What the receiver knows of it.
        k: The row.
        pulses: The batch.
    """
    n_elements, n_samples = waveforms_v.shape
    pulses.time_s[k] = time_s
    pulses.azimuth_rad[k], pulses.std_rad[k], pulses.misfit[k] = NO_DIRECTION
    pulses.mains_phase_rad[k] = np.mod(2 * np.pi * gate.mains_hz * time_s, 2 * np.pi)
    for e in range(n_elements):
        noise_v2, largest_v = background_v2[e], 0.0
        for t in range(n_samples):
            largest_v = max(largest_v, abs(waveforms_v[e, t]))
        strength_v = strength_of(dot(waveforms_v[e], waveforms_v[e]), n_samples * noise_v2)
        pulses.strengths_v[k, e] = strength_v
        pulses.variance_v2[k, e] = variance_of_strength(strength_v, noise_v2, gate.energy_spread, gate.noise_on_pulse)
        pulses.is_usable[k, e], pulses.is_clipped[k, e] = True, largest_v >= gate.full_v
