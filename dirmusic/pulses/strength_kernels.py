"""From the energy of a gate to a strength and its variance, number by number; see `strengths`."""

from __future__ import annotations

import numpy as np

from dirmusic.compiled import elementwise

SMALLEST = float(np.finfo(np.float64).tiny)


@elementwise
def strength_of(energy_v2: float, noise_energy_v2: float) -> float:
    """Strength of a pulse in a gate with that energy, of which noise makes so much on average."""
    return np.sqrt(max(energy_v2 - noise_energy_v2, 0.0))


@elementwise
def variance_of_strength(strength_v: float, noise_v2: float, energy_spread: float, noise_on_pulse: float) -> float:
    """Variance of a strength; formula and arguments as of `strengths.strength_variance`."""
    energy = max(strength_v * strength_v, np.sqrt(0.5 * energy_spread) * noise_v2, SMALLEST)
    return noise_on_pulse * noise_v2 + 0.5 * energy_spread * noise_v2 * noise_v2 / energy
