"""The page on equipment lists the kinds of the catalogue with the sizes and clearances that they have."""

import re
import runpy
import tomllib
from pathlib import Path

from pdpatrol.envs.scenario.base import as_tuples
from pdpatrol.robot_models.equipment.catalogue import CATALOGUE
from pdpatrol.robot_models.equipment.voltages import VOLTAGES
from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing.radio.materials import KIND_MATERIALS

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


def test_every_kind_has_a_small_picture() -> None:
    pictures = {file.stem: file.stat().st_size for file in (DOCS / "pictures" / "equipment").glob("*.jpg")}
    assert set(pictures) == set(CATALOGUE)
    assert sum(pictures.values()) < 1_500_000


def test_pieces_on_the_page_are_valid() -> None:
    blocks = re.findall(r"```toml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    pieces = as_tuples([piece for block in blocks for piece in tomllib.loads(block)["yard"]["equipment"]])
    shown = Yard.model_validate({"size_m": (40.0, 40.0), "equipment": pieces}).equipment
    assert [(piece.name, piece.kind in KIND_MATERIALS) for piece in shown] == [("e03_qa1", True), ("cabinet_1", True)]
