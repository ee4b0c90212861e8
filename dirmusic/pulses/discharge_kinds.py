"""What kinds of discharges look like over the phase of the mains: knowledge that robot and nature share.

Nature's own discharges differ from these typical ones, each in its own way; `sensing` draws how.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

KindName = Literal["corona", "void", "surface", "floating"]


@dataclass(frozen=True, kw_only=True)
class Cluster:
    """Pulses that come around one phase.

    Attributes:
        share: Of all pulses.
        centre_deg: Phase of the voltage across the defect, sine, in [0, 360).
        width_deg: Standard deviation of the phase.
        level_db: Level of the pulses against the kind's typical one.
        spread_db: Standard deviation of the level.
        polarity: Sign of the pulses.
    """

    share: float
    centre_deg: float
    width_deg: float
    level_db: float
    spread_db: float
    polarity: int


KINDS: dict[KindName, tuple[Cluster, ...]] = {
    "corona": (Cluster(share=1.0, centre_deg=270, width_deg=14, level_db=0.0, spread_db=0.7, polarity=-1),),
    "void": (
        Cluster(share=0.5, centre_deg=45, width_deg=20, level_db=0.0, spread_db=3.0, polarity=1),
        Cluster(share=0.5, centre_deg=225, width_deg=20, level_db=0.0, spread_db=3.0, polarity=-1),
    ),
    "surface": (
        Cluster(share=0.4, centre_deg=55, width_deg=28, level_db=4.0, spread_db=4.0, polarity=1),
        Cluster(share=0.6, centre_deg=235, width_deg=28, level_db=-4.0, spread_db=4.0, polarity=-1),
    ),
    "floating": (
        Cluster(share=0.5, centre_deg=60, width_deg=7, level_db=0.0, spread_db=0.7, polarity=1),
        Cluster(share=0.5, centre_deg=240, width_deg=7, level_db=0.0, spread_db=0.7, polarity=-1),
    ),
}
"""Corona at a point: one half cycle, about the crest, all pulses alike. Voids: both half cycles alike, where the
voltage rises, levels spread. Surface: both, unlike in level and number, wide. Floating metal: both, few degrees, all
pulses alike.

References:
    CIGRE TB 226, "Knowledge rules for partial discharge diagnosis in service", 2003, for the shapes; the figures are
    assumed.
"""
