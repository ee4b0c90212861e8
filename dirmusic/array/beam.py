"""Main beam of a pattern: its direction, its width and its front-to-back ratio."""

from typing import NamedTuple, Self

import numpy as np

from dirmusic.angles import wrap
from dirmusic.array.pattern import STEP_RAD, TABLE_SIZE, GainPattern

HALF_POWER = np.sqrt(0.5)
"""Gain at the edges of the beam relative to the largest gain, -3 dB."""

TURNED_RAD = np.radians(5.0)
"""Angle off the boresight from which a beam counts as turned. Assumed: more than twice the usual pointing error."""


class Beam(NamedTuple):
    """Main beam of a pattern in the plane.

    Attributes:
        strongest_rad: Direction of the largest gain, off boresight, in (-pi, pi].
        middle_rad: Direction midway between the edges of the beam; `strongest_rad` if the pattern has no edges.
        width_rad: Angle between the edges, where the gain is 3 dB below the largest; 2 pi without edges.
        front_to_back: Largest gain divided by the gain opposite to it.
    """

    strongest_rad: float
    middle_rad: float
    width_rad: float
    front_to_back: float

    @classmethod
    def of(cls, pattern: GainPattern) -> Self:
        """Measure the main beam of a pattern in steps of 0.1 degrees."""
        gain = pattern(STEP_RAD * np.arange(TABLE_SIZE))
        strongest = int(gain.argmax())
        from_strongest = np.roll(gain, -strongest)
        is_weak = from_strongest < HALF_POWER * from_strongest[0]
        left, right = (int(side.argmax()) for side in (is_weak, is_weak[::-1]))  # steps to the edges, right from -1
        has_edges = bool(is_weak.any())
        return cls(
            strongest_rad=float(wrap(STEP_RAD * strongest)),
            middle_rad=float(wrap(STEP_RAD * (strongest + 0.5 * (left - right - 1) * has_edges))),
            width_rad=STEP_RAD * (left + right) if has_edges else 2 * np.pi,
            front_to_back=float(from_strongest[0] / from_strongest[TABLE_SIZE // 2]),
        )


def describe_beam(pattern: GainPattern) -> str:
    """Describe the main beam of a pattern in one line; it says so if the beam does not point along the boresight."""
    beam = Beam.of(pattern)
    in_elevation = ""
    if pattern.vertical is not None:
        in_elevation = f" and {np.degrees(Beam.of(pattern.vertical).width_rad):.0f} degrees high"
    is_turned = min(abs(beam.strongest_rad), abs(beam.middle_rad)) > TURNED_RAD
    return (
        f"strongest at {np.degrees(beam.strongest_rad):.0f} degrees{', not at 0' if is_turned else ''}; beam "
        f"{np.degrees(beam.width_rad):.0f} degrees wide{in_elevation} at -3 dB; front-to-back ratio "
        f"{20 * np.log10(beam.front_to_back):.1f} dB"
    )
