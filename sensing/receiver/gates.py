"""Gates, in compiled loops: what a receiver reads from them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from dirmusic.kernels import dot
from dirmusic.pulses.batch import NO_DIRECTION, PulseBatch
from dirmusic.pulses.strengths import strength_of, variance_of_strength

FloatArray = NDArray[np.float64]


class BandReading(NamedTuple):
    """How strengths in sub-bands are read; as of `dirmusic.bearing.sub_bands.SubBands`.

    Attributes:
        lines: Shape (n_bands, n_lines, n_samples); no bands if none are read.
        noise_samples: Shape (n_bands,).
        energy_spread: Shape (n_bands,).
        noise_on_pulse: Shape (n_bands,).
    """

    lines: FloatArray
    noise_samples: FloatArray
    energy_spread: FloatArray
    noise_on_pulse: FloatArray


class GateParameters(NamedTuple):
    """What a receiver knows of its gates.

    Attributes:
        energy_spread: Spread of the noise energies, as of `dirmusic.strength_variance`.
        noise_on_pulse: Noise on a pulse, as of `dirmusic.strength_variance`.
        mains_hz: Frequency of the receiver's own mains supply.
        full_v: What is at least so large is clipped.
        bands: How sub-bands are read.
    """

    energy_spread: float
    noise_on_pulse: float
    mains_hz: float
    full_v: float
    bands: BandReading


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
        read_bands(waveforms_v[e], noise_v2, gate.bands, k, e, pulses)


@compiled
def read_bands(waveform_v: FloatArray, noise_v2: float, bands: BandReading, k: int, e: int, pulses: PulseBatch) -> None:
    """Read strengths in sub-bands and their variance from the gate of one channel, (n_samples,), into row k."""
    for b in range(bands.noise_samples.size):
        energy_v2 = 0.0
        for line in range(bands.lines.shape[1]):
            energy_v2 += dot(waveform_v, bands.lines[b, line]) ** 2
        strength_v = strength_of(energy_v2, bands.noise_samples[b] * noise_v2)
        pulses.band_strengths_v[k, b, e] = strength_v
        pulses.band_variance_v2[k, b, e] = variance_of_strength(
            strength_v, noise_v2, bands.energy_spread[b], bands.noise_on_pulse[b]
        )
