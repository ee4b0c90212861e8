"""Bays of a substation: what they connect, and the order of their equipment from the busbar outwards.

Letters of the designations follow IEC 81346-2: QA breaker, QB disconnector, BC current transformer, BA voltage
transformer, RA line trap, FA arrester, XB cable end, TA transformer, RL reactor, WB busbar.
"""

from typing import Literal

import numpy as np

from pdpatrol.envs.substation.drawing import Chain
from pdpatrol.robot_models.equipment.voltages import Kv

Purpose = Literal["line", "cable", "transformer", "reactor", "coupler"]

TITLES: dict[Purpose, str] = {
    "line": "overhead line",
    "cable": "cable",
    "transformer": "transformer",
    "reactor": "shunt reactor",
    "coupler": "coupler of the busbars",
}

CABLE_SHARE, TRAP_SHARE, TRANSFORMER_SHARE, REACTOR_SHARE = 0.2, 0.4, 0.25, 0.6
"""Shares of cables among lines, of lines with line traps, of transformers among bays, and of stations above 110 kV that
have a reactor (assumed)."""

BUSBAR_DISCONNECTORS: dict[Kv, tuple[str, ...]] = {
    110: ("disconnector_centre_break",),
    220: ("disconnector_pantograph", "disconnector_centre_break"),
    400: ("disconnector_pantograph", "disconnector_double_break"),
}
LINE_DISCONNECTORS: dict[Kv, tuple[str, ...]] = {
    110: ("disconnector_centre_break",),
    220: ("disconnector_centre_break", "disconnector_double_break"),
    400: ("disconnector_double_break", "disconnector_centre_break"),
}
"""Disconnectors in use at each level (assumed); one of them is drawn for a station."""


def draw_purposes(kv: Kv, n_bays: int, first: int, has_coupler: bool, rng: np.random.Generator) -> list[Purpose]:
    """Draw what each bay connects.

    Args:
        kv: Voltage level.
        n_bays: Number of bays.
        first: Number of bays at the beginning that are next to the building and must not contain oil.
        has_coupler: Whether one bay couples two busbars.
        rng: Random generator.
    """
    purposes: list[Purpose] = ["cable" if rng.uniform() < CABLE_SHARE else "line" for _ in range(n_bays)]
    free = rng.permutation(np.arange(first, n_bays)).tolist()
    if has_coupler and free:
        purposes[free.pop()] = "coupler"
    n_transformers = min(max(1, round(TRANSFORMER_SHARE * n_bays)), len(free))
    for number in free[:n_transformers]:
        purposes[number] = "transformer"
    if kv >= 220 and len(free) > n_transformers + 1 and rng.uniform() < REACTOR_SHARE:
        purposes[free[n_transformers]] = "reactor"
    return purposes


def add_feeder(chain: Chain, name: str, purpose: Purpose, disconnector: str, rng: np.random.Generator) -> None:
    """Place the equipment between the current transformers and the outer end of a bay; gantries are added later."""
    if purpose in ("line", "cable"):
        chain.row(f"{name}_qb9", disconnector)
    if purpose == "line":
        chain.row(f"{name}_ba1", "capacitive_voltage_transformer")
        if rng.uniform() < TRAP_SHARE:
            chain.row(f"{name}_ra1", "line_trap", (1, 3))
    if purpose != "coupler":
        chain.row(f"{name}_fa1", "surge_arrester")
    if purpose == "cable":
        chain.row(f"{name}_xb1", "cable_sealing_end")
    elif purpose == "transformer":
        chain.row(f"{name}_ta1", "power_transformer")
    elif purpose == "reactor":
        chain.row(f"{name}_rl1", "shunt_reactor")
