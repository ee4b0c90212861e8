"""Transmission and reflection of equipment and ground materials for radio waves from 1.4 to 2.2 GHz."""

from typing import Literal, NamedTuple, Self

import numpy as np

FREQUENCY_GHZ = 1.75
"""Centre of the pulses' band, over which permittivity and conductivity change by a few per cent."""

WAVELENGTH_M = 0.299792458 / FREQUENCY_GHZ

DIFFRACTION_LOSS_DB = 15.0
"""Minimum loss of a box for which rays around its edges are traced. Assumed; below it, as for slender equipment, the
transmitted wave is as strong as the waves around it."""

LOSS_FACTOR = 17.98
"""Imaginary part of the relative permittivity, times frequency in GHz, per S/m of conductivity: 1 / (2 pi epsilon_0)
(ITU-R P.2040)."""


class Material(NamedTuple):
    """Response of a material to a wave.

    Attributes:
        permittivity: Real part, relative to vacuum.
        conductivity_spm: Conductivity at `FREQUENCY_GHZ`, S/m.
        transmission: Amplitude behind one piece of equipment relative to that in front of it, in [0, 1].
        flat_share: Reflected amplitude relative to that of a smooth surface, in [0, 1]. Ribs and openings scatter the
            rest; 0 means that nothing is reflected.
    """

    permittivity: float
    conductivity_spm: float
    transmission: float
    flat_share: float

    @classmethod
    def of_loss(cls, permittivity: float, conductivity_spm: float, loss_db: float, flat_share: float) -> Self:
        """Create a material from the transmission loss through one piece of equipment, which is infinite if opaque."""
        return cls(permittivity, conductivity_spm, 10.0 ** (-loss_db / 20.0), flat_share)

    @property
    def diffracts(self) -> bool:
        """True if so little is transmitted that rays around the edges matter."""
        return self.transmission <= 10.0 ** (-DIFFRACTION_LOSS_DB / 20.0)

    @property
    def largest_reflection(self) -> float:
        """Approximate upper bound of the reflection by a curved surface: 1.2 times the coefficient at normal incidence.

        A dielectric reflects more at grazing incidence, but a curved surface also spreads the wave more there.
        """
        index = np.sqrt(self.permittivity - 1j * LOSS_FACTOR * self.conductivity_spm / FREQUENCY_GHZ)
        return self.flat_share * min(1.2 * float(abs((1.0 - index) / (1.0 + index))), 1.0)


METAL = Material.of_loss(1.0, 1e7, np.inf, flat_share=0.8)
"""ITU-R P.2040-3, table 3, metal. Assumed: ribs and radiators scatter a fifth of the amplitude."""

CONCRETE = Material.of_loss(5.24, 0.0462 * FREQUENCY_GHZ**0.7822, 20.0, flat_share=1.0)
"""ITU-R P.2040-3, table 3 and eq. (29), concrete: 51 dB per metre of wall; a thickness of 0.4 m is assumed."""

PORCELAIN = Material.of_loss(6.0, 0.0, 10.0, flat_share=1.0)
"""Assumed: permittivity 6. Much of a wave passes on both sides of a slender insulator with a metal core."""

RACK = Material.of_loss(1.0, 1e7, 10.0, flat_share=0.3)
"""Assumed: units on an open frame, which attenuate in part and reflect in part."""

MESH = Material.of_loss(1.0, 1e7, 2.0, flat_share=0.2)
"""Assumed: wire mesh with openings of a third of a wavelength transmits most of a wave."""

KERB = Material.of_loss(5.24, 0.0, 1.0, flat_share=0.0)
"""Assumed: a stone one wavelength high neither attenuates nor reflects waves that pass over it."""

LATTICE = Material.of_loss(1.0, 1e7, 6.0, flat_share=0.0)
"""Assumed: a steel lattice a few wavelengths wide transmits half the amplitude and scatters the rest."""

GRAVEL = Material.of_loss(3.5, 0.0, 0.0, flat_share=1.0)
"""Ground of dry gravel. Assumed; ITU-R P.527 gives a permittivity of 3 to 4 for dry soil."""

GroundName = Literal["gravel", "moist_soil", "wet_soil", "concrete", "asphalt"]
GROUNDS: dict[GroundName, Material] = {
    "gravel": GRAVEL,
    "moist_soil": Material.of_loss(15.0 * FREQUENCY_GHZ**-0.1, 0.035 * FREQUENCY_GHZ**1.63, 0.0, flat_share=1.0),
    "wet_soil": Material.of_loss(30.0 * FREQUENCY_GHZ**-0.4, 0.15 * FREQUENCY_GHZ**1.30, 0.0, flat_share=1.0),
    "concrete": CONCRETE._replace(transmission=1.0),
    "asphalt": Material.of_loss(6.0, 0.0, 0.0, flat_share=1.0),
}
"""Materials of the ground, all smooth (assumed). Soils: ITU-R P.2040-3, table 3, medium dry and wet ground. Asphalt:
Shang et al. 1999, dry specimens up to 1.5 GHz; soaked ones have 6.5, which changes reflections by 4 %."""

KIND_MATERIALS: dict[str, Material] = {
    "building": CONCRETE,
    "busbar": PORCELAIN,
    "bushing": PORCELAIN,
    "cabinet": METAL,
    "cable_sealing_end": PORCELAIN,
    "cable_trench_cover": KERB,
    "capacitive_voltage_transformer": PORCELAIN,
    "capacitor_bank": RACK,
    "circuit_breaker": METAL,
    "control_building": CONCRETE,
    "current_transformer": PORCELAIN,
    "disconnector": PORCELAIN,
    "disconnector_centre_break": PORCELAIN,
    "disconnector_double_break": PORCELAIN,
    "disconnector_pantograph": PORCELAIN,
    "fence": MESH,
    "fire_wall": CONCRETE,
    "gantry": LATTICE,
    "gis": METAL,
    "gis_bay": METAL,
    "gis_outdoor": METAL,
    "kerb": KERB,
    "line_trap": PORCELAIN,
    "post_insulator": PORCELAIN,
    "power_transformer": METAL,
    "reactor": METAL,
    "shunt_reactor": METAL,
    "surge_arrester": PORCELAIN,
    "voltage_transformer": PORCELAIN,
    "wall": CONCRETE,
}
"""Material of every kind of equipment."""

ROUND_MATERIALS = KIND_MATERIALS | dict.fromkeys(
    ("circuit_breaker", "gis_outdoor", "power_transformer", "shunt_reactor"), PORCELAIN
)
"""Material of the cylinders of every kind: poles and bushings are insulators."""
