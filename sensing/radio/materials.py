"""What equipment and ground are made of, to a radio wave between 1.4 and 2.2 GHz: what passes, and what comes back."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

FREQUENCY_GHZ = 1.75
"""Middle of the pulses' band: over it, neither changes by more than a few per cent."""

WAVELENGTH_M = 0.299792458 / FREQUENCY_GHZ
"""At that frequency, in air."""

OPAQUE = np.inf
"""Loss of what nothing passes: waves come round it only."""


BENDS_DB = 15.0
"""Loss from which on waves are followed round the edges of a box (assumed): a slender one leaves as much."""


LOSS_FACTOR = 17.98
"""Imaginary part of the permittivity by conductivity in S/m, times GHz: one over 2 pi epsilon_0 (ITU-R P.2040)."""


class Material(NamedTuple):
    """How a material treats a wave.

    Attributes:
        permittivity: Real part, relative to vacuum.
        conductivity_spm: Conductivity, S/m, at `FREQUENCY_GHZ`.
        loss_db: What a wave loses on its way through one piece of equipment, >= 0; `OPAQUE` if nothing passes.
        flat_share: Share of the amplitude that a smooth surface would mirror, in [0, 1]: ribs and openings scatter the
            rest, and 0 is what is no mirror at all.
    """

    permittivity: float
    conductivity_spm: float
    loss_db: float
    flat_share: float

    @property
    def bends(self) -> bool:
        """Whether so little passes that what comes round its edges counts."""
        return self.loss_db >= BENDS_DB

    @property
    def substance(self) -> Substance:
        """For compiled loops."""
        return Substance(self.permittivity, self.conductivity_spm, 10.0 ** (-self.loss_db / 20.0), self.flat_share)

    @property
    def mirrors(self) -> float:
        """About the largest share of an amplitude that comes back from something round: a fifth more than head on.

        Towards grazing a dielectric mirrors more, but something round mirrors less.
        """
        root = np.sqrt(self.permittivity - 1j * LOSS_FACTOR * self.conductivity_spm / FREQUENCY_GHZ)
        return self.flat_share * min(1.2 * float(abs((1.0 - root) / (1.0 + root))), 1.0)


class Substance(NamedTuple):
    """A material as compiled loops hand it on: as of `Material`.

    Attributes:
        permittivity: As said.
        conductivity_spm: As said.
        passes: Share of the amplitude that passes.
        flat_share: As said.
    """

    permittivity: float
    conductivity_spm: float
    passes: float
    flat_share: float


def _by_recommendation(a: float, b: float, c: float, d: float) -> tuple[float, float]:
    """Permittivity and conductivity after ITU-R P.2040-3, eq. (28) and (29), with the constants of its table 3."""
    return a * FREQUENCY_GHZ**b, c * FREQUENCY_GHZ**d


METAL = Material(*_by_recommendation(1.0, 0.0, 1e7, 0.0), OPAQUE, flat_share=0.8)
"""ITU-R P.2040, metal. Ribs and radiators scatter a fifth of the amplitude (assumed)."""

CONCRETE = Material(*_by_recommendation(5.24, 0.0, 0.0462, 0.7822), 20.0, flat_share=1.0)
"""ITU-R P.2040, concrete: 51 dB for every metre of wall, of which 0.4 m is assumed."""

BRICK = Material(*_by_recommendation(3.91, 0.0, 0.0238, 0.16), 4.0, flat_share=1.0)
"""ITU-R P.2040, brick: 26 dB for every metre, of which 0.15 m is assumed."""

PORCELAIN = Material(6.0, 0.0, 10.0, flat_share=1.0)
"""Assumed: permittivity 6; a slender insulator with a metal core lets much pass to both sides."""

RACK = Material(*_by_recommendation(1.0, 0.0, 1e7, 0.0), 10.0, flat_share=0.3)
"""Assumed: units on an open frame, which both shade and mirror in part."""

MESH = Material(*_by_recommendation(1.0, 0.0, 1e7, 0.0), 2.0, flat_share=0.2)
"""Assumed: wire mesh whose openings are a third of a wavelength lets most pass."""

KERB = Material(5.24, 0.0, 1.0, flat_share=0.0)
"""Assumed: a stone a wavelength high neither shades nor mirrors what goes over it."""

GRAVEL = Material(3.5, 0.0, 0.0, flat_share=1.0)
"""The ground: dry gravel (assumed; ITU-R P.527 gives a permittivity of 3 to 4 for dry soil)."""

DRY_GROUND = Material(*_by_recommendation(15.0, -0.1, 0.035, 1.63), 0.0, flat_share=1.0)
"""ITU-R P.2040, medium dry ground."""

WET_GROUND = Material(*_by_recommendation(30.0, -0.4, 0.15, 1.30), 0.0, flat_share=1.0)
"""ITU-R P.2040, wet ground."""
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
"""Material of every kind of equipment that a yard may hold."""

ROUND_MATERIALS: dict[str, Material] = {"circuit_breaker": PORCELAIN, "power_transformer": PORCELAIN}
"""Of what is round about a kind of equipment, where that is not as the rest: poles and bushings are insulators."""
