"""What the page shows of a scenario file."""

from pathlib import Path

import numpy as np
import pytest

from pdpatrol.envs.scenario import SHIPPED, load_scenario
from pdpatrol.missions.editor.document import NEW_YARD, Edit, edited
from pdpatrol.missions.editor.view import EditorView, forms, view_of
from pdpatrol.robot_models.equipment.catalogue import CATALOGUE

HERE = Path("yard.toml")


def shown(name: str, *edits: Edit) -> EditorView:
    text = (SHIPPED / f"{name}.toml").read_text(encoding="utf-8")
    return view_of(edited(text, edits), HERE)


@pytest.mark.parametrize("name", ["switchyard", "bench"])
def test_outlines_sites_and_sources_are_those_of_the_scenario(name: str) -> None:
    view, scenario = shown(name), load_scenario(name)
    assert view.errors == []
    assert [piece.name for piece in view.pieces] == [piece.name for piece in scenario.yard.equipment]
    for piece, item in zip(view.pieces, scenario.yard.equipment, strict=True):
        corners_m = np.array([outline.corners_m for outline in piece.outlines])
        radius_m = np.array([outline.radius_m for outline in piece.outlines])
        low_m, high_m = item.solids.extent_m
        np.testing.assert_allclose((corners_m.min(axis=1) - radius_m[:, np.newaxis]).min(axis=0), low_m, atol=1e-3)
        np.testing.assert_allclose((corners_m.max(axis=1) + radius_m[:, np.newaxis]).max(axis=0), high_m, atol=1e-3)
        assert set(piece.sites_m) == set(item.assembly.sites)
    for source, config in zip(view.sources, scenario.sources, strict=True):
        assert len(source.places_m) == max(1, len(scenario.candidate_sites(config)))


def test_file_with_errors_is_shown_as_far_as_it_can_be() -> None:
    path = ("yard", "equipment", 2)
    view = shown(
        "switchyard",
        Edit(operation="set", path=(*path, "kind"), value="teapot"),
        Edit(operation="set", path=("yard", "equipment", 3, "position_m"), value="here"),
    )
    assert [k for k, piece in enumerate(view.pieces) if not piece.outlines] == [2, 3]
    assert view.pieces[2].place_m == (8.0, 17.0)
    assert view.pieces[3].place_m is None
    assert len(view.errors) == 2
    assert all("\n" not in line for line in view.errors)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "yard = 3\nroute = []\nsources = 1\n",
        "nature = 2\nzones = [1, { polygon_m = 3 }]\ninterferers = [{ position_m = 3 }]\n",
        '[yard]\nsize_m = "x"\nequipment = [1]\n[[sources]]\nsites = 2\n',
    ],
)
def test_any_toml_is_shown_with_its_errors(text: str) -> None:
    view = view_of(text, HERE)
    assert view.errors
    assert len(view.fence_m) == 4


def test_every_kind_can_be_placed_in_a_new_yard() -> None:
    kinds = forms()["CatalogueEquipment"]["kind"]["enum"]
    assert set(kinds) == set(CATALOGUE)
    for kind in kinds:
        piece = f'{{ name = "a", kind = "{kind}", position_m = [20.0, 15.0] }}'
        view = view_of(edited(NEW_YARD, [Edit(operation="insert", path=("yard", "equipment", 0), value=piece)]), HERE)
        assert (view.errors, bool(view.pieces[0].outlines)) == ([], True)


LINES = """
[[zones]]
name = "gravel"
polygon_m = [[9.0, 1.0], [14.0, 1.0], [14.0, 4.0], [9.0, 4.0]]
limit_mps = 0.3

[[nature.moving]]
name = "gardener"
kind = "person"
path_m = [[4.0, 15.0], [12.0, 15.0], [12.0, 21.0]]
speed_mps = 1.0
"""
"""Tables that are added to a yard with an interferer."""


def test_zones_paths_and_interferers_have_their_points() -> None:
    text = (SHIPPED / "quiet_yard.toml").read_text(encoding="utf-8") + LINES
    view = view_of(text, HERE)
    assert view.errors == []
    assert {line.name: line.points_m for line in view.lines} == {
        "gravel": {"polygon_m": [(9.0, 1.0), (14.0, 1.0), (14.0, 4.0), (9.0, 4.0)]},
        "gardener": {"path_m": [(4.0, 15.0), (12.0, 15.0), (12.0, 21.0)]},
        "tram_line": {"position_m": [(62.0, 12.0, 6.0)]},
    }
    for line in view.lines:
        moved = edited(text, [Edit(operation="set", path=(*line.path, "name"), value="other")])
        assert "other" in [other.name for other in view_of(moved, HERE).lines]
        assert len(view_of(edited(text, [Edit(operation="remove", path=line.path)]), HERE).lines) == 2
