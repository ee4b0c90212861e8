"""The page on equipment lists the kinds of the catalogue with the sizes and clearances that they have."""

import re
import runpy
from pathlib import Path

from pdpatrol.robot_models.equipment.voltages import VOLTAGES

DOCS = Path(__file__).parents[2] / "docs"
PAGE = DOCS / "how-to" / "equipment.md"


def test_table_of_kinds_is_that_of_the_catalogue() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert runpy.run_path(str(DOCS / "make_equipment.py"))["with_table"](text) == text, "run docs/make_equipment.py"


def test_table_of_clearances_is_that_of_the_check() -> None:
    text = PAGE.read_text(encoding="utf-8")
    for kv, level in VOLTAGES.items():
        (row,) = re.findall(rf"^\| {kv} kV \|(.*)\|$", text, re.MULTILINE)
        figures = [float(cell.split()[0]) for cell in row.split("|")]
        lengths_m = (level.to_earth_m, level.to_phase_m, level.live_height_m, level.to_fence_m, level.fire_m)
        assert figures == [level.impulse_kv, *(round(length_m, 2) for length_m in lengths_m)]
