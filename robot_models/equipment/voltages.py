"""Voltage levels of substations, with the clearances in air and the typical spacings of each."""

from typing import Literal, NamedTuple

Kv = Literal[110, 220, 400]
"""Nominal voltage of a level, kV."""


class VoltageLevel(NamedTuple):
    """Insulation and spacings of a voltage level.

    Clearances follow IEC 61936-1, tables 1 and 2, for the impulse voltage. Heights of post insulators are those
    of IEC 60273 for the same voltage. Spacings are assumed, and typical of outdoor stations with tubular busbars.

    Attributes:
        impulse_kv: Rated lightning impulse withstand voltage.
        to_earth_m: Minimum clearance N between live and earthed parts.
        to_phase_m: Minimum clearance between live parts of different phases.
        post_m: Height of a post insulator.
        spacing_m: Distance between the centres of the phases of a bay.
        bay_width_m: Width of a bay.
        fire_m: Clearance between transformers without a fire wall, and to buildings (IEC 61936-1, table 3, for oil
            volumes from 20 000 to 45 000 litres, and from 45 000 litres).
    """

    impulse_kv: int
    to_earth_m: float
    to_phase_m: float
    post_m: float
    spacing_m: float
    bay_width_m: float
    fire_m: float

    @property
    def live_height_m(self) -> float:
        """Minimum height of live parts above ground that people walk on (IEC 61936-1: N + 2.25 m)."""
        return self.to_earth_m + INSULATION_HEIGHT_M

    @property
    def to_fence_m(self) -> float:
        """Minimum horizontal distance of live parts from an external fence of mesh (IEC 61936-1: N + 1.5 m)."""
        return self.to_earth_m + 1.5


INSULATION_HEIGHT_M = 2.25
"""Minimum height of the lowest part of an insulator above the ground (IEC 61936-1)."""

VOLTAGES: dict[Kv, VoltageLevel] = {
    110: VoltageLevel(550, 1.1, 1.1, 1.22, 2.2, 9.0, 10.0),
    220: VoltageLevel(1050, 2.1, 2.1, 2.3, 4.0, 16.0, 15.0),
    400: VoltageLevel(1425, 3.4, 4.2, 3.15, 6.0, 22.0, 15.0),
}
"""All levels. At 400 kV the clearances follow from the switching impulse 1050 kV, from rod to structure and from rod
to conductor."""
