"""What equipment is made of, to a radio wave between 1.5 and 2 GHz: how much of it passes, how much comes back."""

from __future__ import annotations

from typing import NamedTuple


class Material(NamedTuple):
    """How a material treats a wave.

    Attributes:
        loss_db: What a wave loses on its way through, or round, one piece of equipment, >= 0.
        reflection: Amplitude that a flat face sends back over what falls on it, in [-1, 1]; below 0 it turns over.
    """

    loss_db: float
    reflection: float


METAL = Material(loss_db=25.0, reflection=-0.8)
"""Assumed. Nothing passes a tank; 25 dB is what bends round its edges: a knife edge well within the shadow, eq. (31) of
ITU-R P.526 at 1.75 GHz, gives 20 to 30 dB. A smooth plate sends back -1; ribs and radiators scatter a part of it."""

CONCRETE = Material(loss_db=20.0, reflection=-0.39)
"""ITU-R P.2040, concrete at 1.75 GHz: permittivity 5.24, conductivity 0.072 S/m. Hence -0.39 at normal incidence, and
51 dB for every metre of wall, of which 0.4 m is assumed."""

PORCELAIN = Material(loss_db=10.0, reflection=-0.4)
"""Assumed: a slender insulator with a metal core lets much pass to both sides; permittivity 6 for its reflection."""

RACK = Material(loss_db=10.0, reflection=-0.3)
"""Assumed: units on an open frame, which both shade and reflect in part."""

MESH = Material(loss_db=2.0, reflection=-0.2)
"""Assumed: wire mesh whose openings are a third of a wavelength lets most pass."""

KERB = Material(loss_db=1.0, reflection=0.0)
"""Assumed: a stone a wavelength high neither shades nor mirrors what goes over it."""

GRAVEL = Material(loss_db=0.0, reflection=-0.3)
"""The ground: permittivity of 3.5 for dry gravel (assumed; ITU-R P.527 gives 3 to 4 for dry soil), normal incidence.
At a grazing angle more comes back, of which a circularly polarised helix receives only a part."""

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
