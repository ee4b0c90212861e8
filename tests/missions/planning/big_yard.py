"""Large yards of the equipment of the catalogue: rows of bays between busbars, with transformers, walls and kerbs."""

from pdpatrol.envs import Scenario, load_scenario

BAY_M, ROW_M = (18.0, 36.0)
"""Smallest distances between bays and between rows of bays."""

Piece = dict[str, object]


def bay(number: int, x: float, y: float) -> list[Piece]:
    """Return a breaker, current and voltage transformers, from north to south.

    Every third bay has a power transformer between fire walls instead of the voltage transformers.
    """
    pieces: list[Piece] = [{"name": f"breaker_{number}", "kind": "circuit_breaker", "position_m": (x, y + 6.0)}]
    for phase, dx in (("a", -2.0), ("b", 0.0), ("c", 2.0)):
        pieces.append({"name": f"ct_{number}_{phase}", "kind": "current_transformer", "position_m": (x + dx, y + 1.5)})
        if number % 3:
            vt = {"name": f"vt_{number}_{phase}", "kind": "voltage_transformer", "position_m": (x + dx, y - 3.0)}
            pieces.append(vt)
    if number % 3 == 0:
        wall = {"kind": "fire_wall", "shape": "box", "footprint_m": (0.3, 7.0), "height_m": 5.0}
        pieces.append({"name": f"transformer_{number}", "kind": "power_transformer", "position_m": (x, y - 5.0)})
        pieces.append({**wall, "name": f"wall_{number}_west", "position_m": (x - 5.0, y - 5.0)})
        pieces.append({**wall, "name": f"wall_{number}_east", "position_m": (x + 5.0, y - 5.0)})
    return pieces


def big_yard(size_m: float, n_pieces: int) -> Scenario:
    """Return a square yard with rows of bays, evenly spread, of which the last bay may be incomplete."""
    n_columns, n_rows = int((size_m - 20.0) / BAY_M), int((size_m - 20.0) / ROW_M)
    pieces: list[Piece] = []
    for number in range(n_columns * n_rows):
        row, column = divmod(number, n_columns)
        x, y = 10.0 + (size_m - 20.0) * (column + 0.5) / n_columns, 12.0 + (size_m - 16.0) * (row + 0.4) / n_rows
        if column % 3 == 1 and column + 1 < n_columns:
            bar = {"kind": "busbar", "length_m": 2.6 * BAY_M}
            pieces += [{**bar, "name": f"busbar_{number}_{k}", "position_m": (x, y + 11.0 + 5.0 * k)} for k in (0, 1)]
        pieces += bay(number, x, y)
    if len(pieces) < n_pieces:
        raise ValueError(f"{n_pieces} pieces do not fit, only {len(pieces)}")
    return load_scenario(
        "one_source",
        {
            "yard.size_m": (size_m, size_m),
            "yard.equipment": tuple(pieces[:n_pieces]),
            "route": {"dock_m": (3.0, 3.0)},
            "sources": (),
            "interferers": (),
        },
    )
