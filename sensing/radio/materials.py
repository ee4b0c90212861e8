"""Materials of equipment and ground for radio waves of 1.4 to 2.2 GHz: what they transmit and reflect."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

FREQUENCY_GHZ = 1.75
"""Middle of the pulses' band; over the band, permittivity and conductivity change by a few per cent."""

WAVELENGTH_M = 0.299792458 / FREQUENCY_GHZ

DIFFRACTION_LOSS_DB = 15.0
"""Loss from which on rays around the edges of a box are traced. Assumed; slender equipment transmits as much as comes
around it."""

LOSS_FACTOR = 17.98
"""Imaginary part of the permittivity per conductivity in S/m, times GHz: 1 / (2 pi epsilon_0) (ITU-R P.2040)."""


class Material(NamedTuple):
    """Response of a material to a wave.

    Attributes:
        permittivity: Real part, relative to vacuum.
        conductivity_spm: Conductivity at `FREQUENCY_GHZ`, S/m.
        transmission: Amplitude of a wave behind one piece of equipment, over that before, in [0, 1].
        flat_share: Share of the amplitude that a smooth surface would reflect, in [0, 1]; ribs and openings scatter the
            rest, and 0 is for what does not reflect at all.
    """

    permittivity: float
    conductivity_spm: float
    transmission: float
    flat_share: float

    @classmethod
    def of_loss(cls, permittivity: float, conductivity_spm: float, loss_db: float, flat_share: float) -> Self:
        """Make a material from the loss of a wave on its way through one piece of equipment; infinite if opaque."""
        return cls(permittivity, conductivity_spm, 10.0 ** (-loss_db / 20.0), flat_share)

    @property
    def diffracts(self) -> bool:
        """True where so little is transmitted that rays around the edges count."""
        return self.transmission <= 10.0 ** (-DIFFRACTION_LOSS_DB / 20.0)

    @property
    def largest_reflection(self) -> float:
        """Approximate upper bound of the reflection by a curved surface: 1.2 times the coefficient at normal incidence.

        A dielectric reflects more towards grazing incidence, but there a curved surface spreads the wave.
        """
        index = np.sqrt(self.permittivity - 1j * LOSS_FACTOR * self.conductivity_spm / FREQUENCY_GHZ)
        return self.flat_share * min(1.2 * float(abs((1.0 - index) / (1.0 + index))), 1.0)


def _p2040(a: float, b: float, c: float, d: float, loss_db: float, flat_share: float) -> Material:
    """Make a material with the constants of ITU-R P.2040-3, table 3, by its eq. (28) and (29)."""
    return Material.of_loss(a * FREQUENCY_GHZ**b, c * FREQUENCY_GHZ**d, loss_db, flat_share)


METAL = _p2040(1.0, 0.0, 1e7, 0.0, np.inf, flat_share=0.8)
"""ITU-R P.2040, metal. Assumed: ribs and radiators scatter a fifth of the amplitude."""

CONCRETE = _p2040(5.24, 0.0, 0.0462, 0.7822, 20.0, flat_share=1.0)
"""ITU-R P.2040, concrete: 51 dB per metre of wall, of which 0.4 m is assumed."""

BRICK = _p2040(3.91, 0.0, 0.0238, 0.16, 4.0, flat_share=1.0)
"""ITU-R P.2040, brick: 26 dB per metre of wall, of which 0.15 m is assumed."""

PORCELAIN = Material.of_loss(6.0, 0.0, 10.0, flat_share=1.0)
"""Assumed: permittivity 6; much of a wave passes a slender insulator with a metal core on both sides."""

RACK = _p2040(1.0, 0.0, 1e7, 0.0, 10.0, flat_share=0.3)
"""Assumed: units on an open frame, which both shade and reflect in part."""

MESH = _p2040(1.0, 0.0, 1e7, 0.0, 2.0, flat_share=0.2)
"""Assumed: wire mesh with openings of a third of a wavelength transmits most of a wave."""

KERB = Material.of_loss(5.24, 0.0, 1.0, flat_share=0.0)
"""Assumed: a stone one wavelength high neither shades nor reflects waves that pass over it."""

GRAVEL = Material.of_loss(3.5, 0.0, 0.0, flat_share=1.0)
"""Ground of dry gravel. Assumed; ITU-R P.527 gives a permittivity of 3 to 4 for dry soil."""

KIND_MATERIALS: dict[str, Material] = {
    "building": CONCRETE,
    "busbar": PORCELAIN,
    "bushing": PORCELAIN,
    "cabinet": METAL,
    "capacitor_bank": RACK,
    "circuit_breaker": METAL,
    "control_building": CONCRETE,
    "current_transformer": PORCELAIN,
    "disconnector": PORCELAIN,
    "fence": MESH,
    "fire_wall": CONCRETE,
    "gis": METAL,
    "gis_bay": METAL,
    "kerb": KERB,
    "power_transformer": METAL,
    "reactor": METAL,
    "surge_arrester": PORCELAIN,
    "voltage_transformer": PORCELAIN,
    "wall": CONCRETE,
}
"""Material of every kind of equipment."""

ROUND_MATERIALS: dict[str, Material] = {"circuit_breaker": PORCELAIN, "power_transformer": PORCELAIN}
"""Material of the cylinders of a kind where it differs from the rest: poles and bushings are insulators."""
