"""Schemes of substations: single and double busbar, breaker and a half, and ring.

In all of them the busbars run along x, and bays leave them to the north or south.
"""

from collections.abc import Callable
from itertools import groupby
from typing import Literal

import numpy as np

from pdpatrol.envs.substation.bays import (
    BUSBAR_DISCONNECTORS,
    LINE_DISCONNECTORS,
    TITLES,
    Purpose,
    add_feeder,
    draw_purposes,
)
from pdpatrol.envs.substation.drawing import EAST, NORTH, PHASES, SOUTH, Chain, Drawing
from pdpatrol.robot_models.equipment.structures import SIZES

Scheme = Literal["single_busbar", "double_busbar", "breaker_and_a_half", "ring"]

LEAST_BAYS: dict[Scheme, int] = {"single_busbar": 2, "double_busbar": 2, "breaker_and_a_half": 2, "ring": 3}
MOST_BAYS: dict[Scheme, int] = {"single_busbar": 14, "double_busbar": 14, "breaker_and_a_half": 24, "ring": 12}
"""Fewest and most bays. Rings of more bays are not built; the others reach the largest yard at 400 kV."""

Ends = list[tuple[str, Purpose, float, float]]
"""Feeders on one side: name, purpose, and x and y of their outer ends."""


def _busbars(drawing: Drawing, middles_y_m: dict[str, float], n_spans: int) -> None:
    """Draw busbars over bays at multiples of the bay width from x = 0, with posts between the bays."""
    width_m = drawing.level.bay_width_m
    drawing.add_bay("busbars")
    for name, y in middles_y_m.items():
        drawing.place(name, "busbar", (0.5 * (n_spans - 1) * width_m, y), length_m=n_spans * width_m + 1.0)


def _gantries(drawing: Drawing, ends: Ends, yaw_deg: float) -> None:
    """Draw gantries beyond the lines of one side, one for each group of neighbouring lines."""
    width_m, leg_m, sign = drawing.level.bay_width_m, SIZES[drawing.kv].leg_m, 1.0 if yaw_deg == NORTH else -1.0
    lines = sorted((x, name) for name, purpose, x, _ in ends if purpose == "line")
    if lines:
        outer_m = max(sign * y for _, purpose, _, y in ends if purpose == "line") + drawing.gap_m + leg_m
        drawing.add_bay(f"gantries on the {'northern' if yaw_deg == NORTH else 'southern'} side")
        for _, members in groupby(enumerate(lines), lambda item: round(item[1][0] / width_m - item[0], 3)):
            group = [line for _, line in members]
            (first_x, first), (last_x, last) = group[0], group[-1]
            name = f"{first}_ua1" if len(group) == 1 else f"{first}_{last}_ua1"
            place_m = (0.5 * (first_x + last_x), sign * outer_m)
            drawing.place(name, "gantry", place_m, yaw_deg, len(group) * width_m + leg_m)


def _trench(drawing: Drawing, name: str, x: float, start_y_m: float, end_y_m: float) -> None:
    """Draw a cable trench between two bays, along y."""
    if abs(end_y_m - start_y_m) > 3.0:
        middle_y_m = 0.5 * (start_y_m + end_y_m)
        drawing.place(f"{name}_trench", "cable_trench_cover", (x, middle_y_m), 90.0, abs(end_y_m - start_y_m) - 1.0)


def draw_busbar_scheme(drawing: Drawing, n_bays: int, rng: np.random.Generator, n_busbars: int) -> None:
    """Draw a single or double busbar, with all bays on the northern side, or transformers on the southern side."""
    width_m, kv = drawing.level.bay_width_m, drawing.kv
    busbar_kind, line_kind = (str(rng.choice(kinds[kv])) for kinds in (BUSBAR_DISCONNECTORS, LINE_DISCONNECTORS))
    is_two_sided = rng.uniform() < 0.5
    purposes = draw_purposes(kv, n_bays, 1, n_busbars == 2 and n_bays >= 3, rng)
    ends: dict[float, Ends] = {NORTH: [], SOUTH: []}
    middles_y_m = dict[str, float]()
    for number, purpose in enumerate(purposes):
        name, x = f"e{number + 1:02}", number * width_m
        drawing.add_bay(f"={name.upper()} {TITLES[purpose]}")
        under, yaw_deg = Chain(drawing, (x, 0.0), NORTH), NORTH
        for busbar in range(n_busbars):
            middles_y_m[f"wb{busbar + 1}"] = under.crossing(f"{name}_qb{busbar + 1}", busbar_kind)
        chain = Chain(drawing, (x, under.edge_m), NORTH)
        if is_two_sided and purpose in ("transformer", "reactor"):
            yaw_deg, chain = SOUTH, Chain(drawing, (x, drawing.gap_m), SOUTH)
        chain.road()
        start_m = chain.edge_m
        chain.row(f"{name}_qa1", "circuit_breaker")
        chain.row(f"{name}_bc1", "current_transformer")
        sign = 1.0 if yaw_deg == NORTH else -1.0
        _trench(drawing, name, x - 0.5 * width_m, sign * (start_m + drawing.gap_m), sign * chain.edge_m)
        add_feeder(chain, name, purpose, line_kind, rng)
        ends[yaw_deg].append((name, purpose, x, sign * chain.edge_m))
    _busbars(drawing, middles_y_m, n_bays)
    for yaw_deg, own in ends.items():
        _gantries(drawing, own, yaw_deg)


def draw_breaker_and_a_half(drawing: Drawing, n_bays: int, rng: np.random.Generator) -> None:
    """Draw diameters of three breakers between two busbars; each has a feeder to the south and one to the north."""
    width_m, kv = drawing.level.bay_width_m, drawing.kv
    busbar_kind, line_kind = (str(rng.choice(kinds[kv])) for kinds in (BUSBAR_DISCONNECTORS, LINE_DISCONNECTORS))
    n_diameters = (n_bays + 1) // 2
    purposes = draw_purposes(kv, n_bays, 2, False, rng)
    ends: dict[float, Ends] = {NORTH: [], SOUTH: []}
    middles_y_m = dict[str, float]()
    for number in range(n_diameters):
        name, x = f"d{number + 1:02}", number * width_m
        drawing.add_bay(f"={name.upper()} diameter of three breakers")
        chain = Chain(drawing, (x, 0.0), NORTH)
        middles_y_m["wb1"] = chain.crossing(f"{name}_qb1", busbar_kind)
        chain.road()
        for breaker in (1, 2, 3):
            if breaker > 1:
                chain.skip(drawing.gap_m)  # room for the connection of a feeder
                chain.row(f"{name}_qb{2 * breaker - 1}", line_kind)
            chain.row(f"{name}_qa{breaker}", "circuit_breaker")
            chain.row(f"{name}_bc{breaker}", "current_transformer")
            if breaker < 3:
                chain.row(f"{name}_qb{2 * breaker}", line_kind)
        chain.road()
        middles_y_m["wb2"] = chain.crossing(f"{name}_qb6", busbar_kind)
        sides = ((SOUTH, (x, drawing.gap_m)), (NORTH, (x, chain.edge_m)))
        for side, (yaw_deg, start_m) in enumerate(sides):
            feeder = 2 * number + side
            if feeder < n_bays:
                purpose, own = purposes[feeder], f"e{feeder + 1:02}"
                drawing.add_bay(f"={own.upper()} {TITLES[purpose]}")
                outwards = Chain(drawing, start_m, yaw_deg)
                outwards.road()
                add_feeder(outwards, own, purpose, line_kind, rng)
                sign = 1.0 if yaw_deg == NORTH else -1.0
                ends[yaw_deg].append((own, purpose, x, sign * outwards.edge_m))
    _busbars(drawing, middles_y_m, n_diameters)
    for yaw_deg, own in ends.items():
        _gantries(drawing, own, yaw_deg)


def draw_ring(drawing: Drawing, n_bays: int, rng: np.random.Generator) -> None:
    """Draw a ring of breakers with a feeder at each corner: as many on the southern side as on the northern side."""
    kind = str(rng.choice(LINE_DISCONNECTORS[drawing.kv]))
    n_columns = (n_bays + 1) // 2
    inner_m = drawing.level.spacing_m + 0.5
    trial = Chain(Drawing(drawing.kv, drawing.gap_m, [*drawing.bays]), (0.0, 0.0), NORTH)
    trial.drawing.add_bay("trial")
    _ring_rows(trial, "r00", kind)
    pitch_m = trial.edge_m + drawing.gap_m + 2.0 * inner_m
    purposes = draw_purposes(drawing.kv, n_bays, 1, False, rng)
    if n_bays > n_columns and purposes[n_columns] in ("transformer", "reactor"):
        purposes[n_columns] = "line"  # next to the building
    ends: dict[float, Ends] = {NORTH: [], SOUTH: []}
    for number in range(2 * n_columns):
        yaw_deg, sign = (SOUTH, -1.0) if number < n_columns else (NORTH, 1.0)
        column, y = number % n_columns, 0.0 if yaw_deg == SOUTH else pitch_m
        x, name = column * pitch_m, f"e{number + 1:02}"
        purpose: Purpose | None = purposes[number] if number < n_bays else None
        drawing.add_bay(f"={name.upper()} {TITLES[purpose] if purpose else 'corner without a feeder'}")
        for phase, share in enumerate(PHASES, start=1):
            off_m = share * drawing.level.spacing_m
            drawing.place(f"{name}_ub1_l{phase}", "post_insulator", (x + off_m, y + sign * off_m))
        if purpose:
            chain = Chain(drawing, (x, y + sign * inner_m), yaw_deg)
            chain.road()
            add_feeder(chain, name, purpose, kind, rng)
            ends[yaw_deg].append((name, purpose, x, sign * chain.edge_m))
    number = 0
    for y in (0.0, pitch_m):
        for column in range(n_columns - 1):
            number += 1
            drawing.add_bay(f"=R{number:02} breaker of the ring")
            _ring_rows(Chain(drawing, (column * pitch_m + inner_m, y), EAST), f"r{number:02}", kind)
    for column in (0, n_columns - 1):
        number += 1
        drawing.add_bay(f"=R{number:02} breaker of the ring")
        _ring_rows(Chain(drawing, (column * pitch_m, inner_m), NORTH), f"r{number:02}", kind)
    for yaw_deg, own in ends.items():
        _gantries(drawing, own, yaw_deg)


def _ring_rows(chain: Chain, name: str, kind: str) -> None:
    """Place a breaker of a ring with its disconnectors."""
    chain.row(f"{name}_qb1", kind)
    chain.row(f"{name}_qa1", "circuit_breaker")
    chain.row(f"{name}_bc1", "current_transformer")
    chain.row(f"{name}_qb2", kind)


SCHEMES: dict[Scheme, Callable[[Drawing, int, np.random.Generator], None]] = {
    "single_busbar": lambda drawing, n_bays, rng: draw_busbar_scheme(drawing, n_bays, rng, 1),
    "double_busbar": lambda drawing, n_bays, rng: draw_busbar_scheme(drawing, n_bays, rng, 2),
    "breaker_and_a_half": draw_breaker_and_a_half,
    "ring": draw_ring,
}
"""Functions that draw each scheme."""
