"""Insert the table of equipment kinds into docs/how-to/equipment.md, between its marks.

uv run python docs/make_equipment.py
"""

import re
from pathlib import Path

import numpy as np

from pdpatrol.missions.sweep.tables import markdown
from pdpatrol.robot_models.equipment.catalogue import CATALOGUE, assemble
from pdpatrol.robot_models.equipment.voltages import VOLTAGES, Kv
from pdpatrol.robot_models.yard.pieces import CatalogueEquipment

PAGE = Path(__file__).parent / "how-to" / "equipment.md"
MARKS = re.compile(r"(<!-- kinds -->\n).*(<!-- end -->\n)", re.DOTALL)


def kinds_table() -> str:
    """Return a table of all kinds: what they are, their pictures, sizes and sites, and the source of the sizes."""
    headings = ("kind", "picture", "length x width x height (m)", "sites", "source of the size")
    return markdown(headings, [_row(kind) for kind in sorted(CATALOGUE)])


def _row(kind: str) -> list[str]:
    shape = CATALOGUE[kind]
    levels: list[Kv | None] = [None] if shape.build else []
    levels += VOLTAGES if shape.build_for else ()
    names = ["" if len(levels) == 1 else "without `kv`: " if kv is None else f"{kv} kV: " for kv in levels]
    sizes = [f"{name}{_size(kind, kv)}" for name, kv in zip(names, levels, strict=True)]
    sites = dict.fromkeys(re.sub(r"[_0-9]*$", "", site) for kv in levels for site in assemble(kind, None, kv).sites)
    stretches = ", any length" if shape.stretches else ""
    picture = f"![{kind} next to a robot](../pictures/equipment/{kind}.jpg)"
    site_names = ", ".join(f"`{site}`" for site in sites) or "none"
    return [f"`{kind}`<br>{shape.title}{stretches}", picture, "<br>".join(sizes), site_names, shape.source]


def _size(kind: str, kv: Kv | None) -> str:
    """Return length x width x height, metres."""
    solids = CatalogueEquipment(name="it", kind=kind, kv=kv, position_m=(0.0, 0.0)).solids
    low_m, high_m = solids.extent_m
    return "\u00a0x\u00a0".join(
        f"{round(length_m, 1 if length_m > 1.0 else 2):g}" for length_m in np.append(high_m - low_m, solids.top_m.max())
    )


def with_table(page: str) -> str:
    """Return the text of the page with the table of today."""
    table = kinds_table()
    return MARKS.sub(lambda found: f"{found[1]}\n{table.strip()}\n\n{found[2]}", page)


if __name__ == "__main__":
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
