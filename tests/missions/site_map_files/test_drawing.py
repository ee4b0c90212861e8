"""Drawings of substations as two CAD programs write them: pieces, planted errors, and notes on unknown entities."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from ezdxf.document import Drawing
from ezdxf.filemanagement import new
from ezdxf.layouts.layout import Modelspace
from pyproj import Transformer

from dirmusic.angles import unit_vector
from pdpatrol.envs.scenario import load_scenario
from pdpatrol.missions.site_map_files.geodesy import longitude_latitude
from pdpatrol.missions.site_map_files.site_scenario import import_site
from tests.missions.conftest import Refused, call


def square(x: float, y: float, width: float, depth: float) -> list[tuple[float, float]]:
    """Return the corners of a rectangle around a place."""
    x_half, y_half = 0.5 * width, 0.5 * depth
    return [(x - x_half, y - y_half), (x + x_half, y - y_half), (x + x_half, y + y_half), (x - x_half, y + y_half)]


def autocad() -> Drawing:
    """Return a drawing as AutoCAD 2018 saves it: millimetres, blocks with attributes, layers of light polylines."""
    drawing = new("R2018", units=4)
    for name, width, depth in (("CB_SF6_220", 9000.0, 1000.0), ("Power Transformer", 8000.0, 5000.0)):
        block = drawing.blocks.new(name, base_point=(100.0, 0.0))
        block.add_lwpolyline(square(100.0, 0.0, width, depth), close=True)
        block.add_attdef("NAME", (0.0, 0.0))
    drawing.blocks.new("GANTRY_A").add_line((0.0, 0.0), (10_000.0, 0.0))
    drawing.blocks.new("NORTH_ARROW").add_circle((0.0, 0.0), 500.0)
    bay = drawing.blocks.new("BAY_3")
    bay.add_blockref("CB_SF6_220", (0.0, 5000.0), dxfattribs={"rotation": 90.0})
    space = drawing.modelspace()
    space.add_lwpolyline(
        [(1000.0 * x + 1e6, 1000.0 * y) for x, y in square(40.0, 30.0, 80.0, 60.0)], close=True
    ).dxf.layer = "S-FENCE"
    breaker = space.add_blockref("CB_SF6_220", (1e6 + 20e3, 30e3), dxfattribs={"rotation": 180.0})
    breaker.add_auto_attribs({"NAME": "=E01-QA1"})
    space.add_blockref("Power Transformer", (1e6 + 60e3, 15e3), dxfattribs={"rotation": -90.0})
    space.add_blockref("GANTRY_A", (1e6 + 10e3, 45e3), dxfattribs={"xscale": 1.5, "rotation": 90.0})
    space.add_blockref("BAY_3", (1e6 + 40e3, 30e3))
    space.add_blockref("NORTH_ARROW", (1e6, 0.0))
    space.add_blockref("NORTH_ARROW", (1e6, 10.0))
    space.add_text("220 kV", dxfattribs={"layer": "S-TEXT"})
    space.add_line((1e6, 3e3), (1e6 + 80e3, 3e3), dxfattribs={"layer": "C-ROAD"})
    return drawing


def librecad() -> Drawing:
    """Return a drawing as LibreCAD saves it as R12: no unit, no blocks, old polylines and lines on layers."""
    drawing = new("R12")
    space = drawing.modelspace()
    corner = np.array([500.0, 200.0])
    space.add_polyline2d(np.array(square(20.0, 15.0, 40.0, 30.0)) + corner, close=True, dxfattribs={"layer": "fence"})
    space.add_polyline2d(np.array(square(10.0, 8.0, 6.0, 4.0)) + corner, close=True, dxfattribs={"layer": "building"})
    space.add_line(np.add(corner, (5.0, 22.0)), np.add(corner, (35.0, 22.0)), dxfattribs={"layer": "busbar"})
    for k in range(3):
        space.add_circle(np.add(corner, (20.0 + 2.0 * k, 15.0)), 0.3, dxfattribs={"layer": "post insulator"})
    space.add_polyline2d(np.array([(28.0, 6.0), (34.0, 6.0), (34.0, 10.0)]) + corner, dxfattribs={"layer": "wall"})
    space.add_point(np.add(corner, (30.0, 17.0)), dxfattribs={"layer": "disconnector"})
    space.add_line(corner, np.add(corner, (1.0, 1.0)), dxfattribs={"layer": "0"})
    return drawing


def saved(drawing: Drawing, folder: Path) -> Path:
    path = folder / "site.dxf"
    drawing.saveas(path)
    return path


def mapping(folder: Path, text: str = "kv = 220") -> Path:
    path = folder / "mapping.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_blocks_become_pieces_at_their_places(tmp_path: Path) -> None:
    """Millimetres, rotation, scale, nested blocks, names by attributes; unknown entities are counted."""
    text, yard, notes = import_site(saved(autocad(), tmp_path), mapping(tmp_path))
    assert notes == [
        "block NORTH_ARROW: 2 INSERT not understood; left out",
        "layer S-TEXT: 1 TEXT not understood; left out",
    ]
    assert yard.size_m == pytest.approx((80.0, 60.0), abs=0.01)
    got = {each.name: each for each in yard.equipment}
    for name, kind, place_m, yaw_deg in (
        ("e01_qa1", "circuit_breaker", (20.0, 30.0), 180.0),
        ("power_transformer_1", "power_transformer", (60.0, 15.0), -90.0),
        ("gantry_1", "gantry", (10.0, 52.5), 90.0),
        ("circuit_breaker_1", "circuit_breaker", (40.0, 35.0), 90.0),
    ):
        assert got[name].kind == kind
        assert got[name].position_m == pytest.approx(place_m, abs=0.01)
        assert (got[name].yaw_deg - yaw_deg + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=0.1)
    assert got["gantry_1"].model_dump()["length_m"] == pytest.approx(15.0, abs=0.01)
    assert len(got) == 4
    (tmp_path / "site.toml").write_text(text, encoding="utf-8")
    assert load_scenario(tmp_path / "site.toml").georeference is None


def test_lines_on_layers_become_pieces(tmp_path: Path) -> None:
    """Metres are assumed and stated; polylines, lines, circles and points by the names of their layers."""
    _, yard, notes = import_site(saved(librecad(), tmp_path), mapping(tmp_path))
    assert notes == [
        f"{tmp_path / 'site.dxf'}: has no unit ($INSUNITS); metres are assumed",
        "layer 0: 1 LINE not understood; left out",
    ]
    assert yard.size_m == pytest.approx((40.0, 30.0), abs=0.01)
    got = {each.name: each.position_m for each in yard.equipment}
    want = {
        "building_1": (10.0, 8.0),
        "busbar_1": (20.0, 22.0),
        "post_insulator_1": (20.0, 15.0),
        "post_insulator_2": (22.0, 15.0),
        "post_insulator_3": (24.0, 15.0),
        "wall_1": (31.0, 6.0),
        "wall_2": (34.0, 8.0),
        "disconnector_centre_break_1": (30.0, 17.0),
    }
    assert got.keys() == want.keys()
    for name, place_m in want.items():
        assert got[name] == pytest.approx(place_m, abs=0.01)


def test_entities_of_other_planes_and_types_are_listed(tmp_path: Path) -> None:
    """Labels of a front view, faces and arcs do not keep the plan from being read; arcs are lines."""
    drawing = autocad()
    space = drawing.modelspace()
    before = len(import_site(saved(drawing, tmp_path), mapping(tmp_path))[1].equipment)
    space.add_text("A-A", dxfattribs={"layer": "S-TEXT", "extrusion": (1.0, 0.0, 0.0)})
    space.add_3dface([(*place, 0.0) for place in square(1e6 + 30e3, 50e3, 4e3, 3e3)], dxfattribs={"layer": "building"})
    space.add_mline([(1e6, 0.0), (1e6 + 9e3, 0.0)], dxfattribs={"layer": "wall"})
    start, end = (1e6 + 50e3, 50e3), (1e6 + 60e3, 50e3)
    space.add_line(start, end, {"layer": "busbar", "extrusion": (1.0, 0.0, 0.0)})
    space.add_arc((1e6 + 70e3, 50e3), 5e3, 0.0, 90.0, dxfattribs={"layer": "building"})
    _, yard, notes = import_site(saved(drawing, tmp_path), mapping(tmp_path))
    assert notes == [
        "block NORTH_ARROW: 2 INSERT not understood; left out",
        "layer S-TEXT: 2 TEXT not understood; left out",
        "layer wall: 1 MLINE not understood; left out",
    ]
    added = {each.name: each for each in yard.equipment[before:]}
    assert added.keys() == {"building_1", "busbar_1", "building_2"}
    assert added["building_1"].position_m == pytest.approx((30.0, 50.0), abs=0.01)
    assert added["busbar_1"].position_m == pytest.approx((55.0, 50.0), abs=0.01)
    # The smallest rectangle around an arc of 90 degrees lies along its chord.
    out_m = 2.5 * (1.0 + np.sqrt(0.5)) * np.sqrt(0.5)
    assert added["building_2"].position_m == pytest.approx((70.0 + out_m, 50.0 + out_m), abs=0.05)


def test_block_stands_in_the_middle_of_its_visible_lines(tmp_path: Path) -> None:
    """Auxiliary and invisible lines, points, and labels within a block do not move it; a line has a direction."""
    drawing = autocad()
    drawing.blocks.new("LABEL").add_text("a label of several metres", dxfattribs={"height": 2500.0})
    block = drawing.blocks.new("VT_1")
    block.add_circle((0.0, 0.0), 400.0)
    block.add_line((0.0, 0.0), (30e3, 0.0), {"layer": "Defpoints"})
    block.add_line((0.0, 0.0), (0.0, 50e3), {"invisible": 1})
    block.add_line((0.0, 0.0), (0.0, -50e3), {"layer": "AXES"})
    block.add_point((9e3, 0.0))
    block.add_blockref("LABEL", (0.0, 0.0))
    drawing.layers.add("AXES").freeze()
    drawing.blocks.new("ISOLATOR_1").add_line((0.0, -4e3), (0.0, 4e3))
    drawing.modelspace().add_blockref("VT_1", (1e6 + 30e3, 50e3))
    drawing.modelspace().add_blockref("ISOLATOR_1", (1e6 + 60e3, 40e3), {"rotation": 30.0})
    _, yard, _ = import_site(saved(drawing, tmp_path), mapping(tmp_path))
    got = {each.name: each for each in yard.equipment}
    assert got["voltage_transformer_1"].position_m == pytest.approx((30.0, 50.0), abs=0.01)
    assert got["disconnector_centre_break_1"].yaw_deg == pytest.approx(30.0, abs=0.1)


def test_mirrored_block_keeps_its_y_axis(tmp_path: Path) -> None:
    """Poles stand symmetrically along x, but bushings of high voltage on one side, at y > 0."""
    drawing = autocad()
    space = drawing.modelspace()
    space.delete_all_entities()
    space.add_lwpolyline([(1e3 * x, 1e3 * y) for x, y in square(40, 30, 80, 60)], close=True).dxf.layer = "FENCE"
    mirrored = ({"xscale": -1.0}, {"yscale": -1.0}, {"xscale": -1.0, "yscale": -1.0}, {"extrusion": (0, 0, -1)})
    for k, scale in enumerate(mirrored):
        x = -1e3 * (10 + 15 * k) if "extrusion" in scale else 1e3 * (10 + 15 * k)  # in the axes of the extrusion
        space.add_blockref("Power Transformer", (x, 30e3), scale | {"rotation": 0.0 if k == 3 else 30.0})
    for yaw_deg, expected in ((0.0, (30.0, -150.0, -150.0, 0.0)), (90.0, (-60.0, 120.0, -60.0, -90.0))):
        rows = f'kv = 110\n[names]\n"power*" = {{ kind = "power_transformer", yaw_deg = {yaw_deg} }}'
        _, yard, _ = import_site(saved(drawing, tmp_path), mapping(tmp_path, rows))
        got = [each.yaw_deg for each in sorted(yard.equipment, key=lambda each: each.position_m[0])]
        assert np.allclose((np.subtract(got, expected) + 180.0) % 360.0, 180.0, atol=0.1), got


def test_rounded_corners_leave_no_gap(tmp_path: Path) -> None:
    """Chords of an arc that are too short for a piece are joined."""
    drawing = new("R2018", units=6)
    space, quarter = drawing.modelspace(), np.tan(np.pi / 8)
    space.add_lwpolyline(square(30.0, 25.0, 60.0, 50.0), close=True, dxfattribs={"layer": "fence"})
    for radius, x in ((0.3, 15.0), (1.0, 40.0)):
        ends = [(x - 8.0, 18.0), (x + 8.0 - radius, 18.0, quarter), (x + 8.0, 18.0 + radius), (x + 8.0, 30.0)]
        space.add_lwpolyline(ends, format="xyb", dxfattribs={"layer": "kerb"})
    drawing.saveas(tmp_path / "site.dxf")
    _, yard, notes = import_site(tmp_path / "site.dxf")
    assert notes == []
    ends_m = []
    for piece in yard.equipment:
        half_m = 0.5 * piece.model_dump()["length_m"] * unit_vector(np.radians(piece.yaw_deg))
        ends_m += [np.array(piece.position_m) - half_m, np.array(piece.position_m) + half_m]
    off_m = np.sort(np.linalg.norm(np.array(ends_m)[:, np.newaxis] - ends_m, axis=-1), axis=1)[:, 1]
    assert np.count_nonzero(off_m > 0.01) == 4  # the ends of both lines


def test_entities_on_paper_are_listed(tmp_path: Path) -> None:
    drawing = new("R2018", units=6)
    drawing.modelspace().add_lwpolyline(square(30.0, 25.0, 60.0, 50.0), close=True, dxfattribs={"layer": "fence"})
    for layout in (drawing.modelspace(), drawing.layout("Layout1")):
        layout.add_lwpolyline(square(20.0, 20.0, 6.0, 4.0), close=True, dxfattribs={"layer": "building"})
    drawing.layout("Layout1").add_text("Title")
    drawing.saveas(tmp_path / "site.dxf")
    _, yard, notes = import_site(tmp_path / "site.dxf")
    assert len(yard.equipment) == 1
    assert notes == ["layout Layout1: 1 of known names on paper, not in the model; left out"]


def test_hidden_entities_are_listed(tmp_path: Path) -> None:
    """Leave out layers that are off or frozen, and invisible entities."""
    drawing = autocad()
    drawing.layers.add("OLD").off()
    drawing.layers.add("FENCE_PLANNED").freeze()
    drawing.layers.add("LOCKED").lock()
    space = drawing.modelspace()
    for k, look in enumerate(({"layer": "OLD"}, {"invisible": 1}, {"layer": "LOCKED"})):
        space.add_blockref("CB_SF6_220", (1e6 + 30e3 + 12e3 * k, 50e3), look)
    space.add_lwpolyline([(0.0, 0.0), (2e6, 0.0), (2e6, 1e5)], close=True).dxf.layer = "FENCE_PLANNED"
    _, yard, notes = import_site(saved(drawing, tmp_path), mapping(tmp_path))
    assert yard.size_m == pytest.approx((80.0, 60.0), abs=0.01)
    assert [each.position_m for each in yard.equipment if each.position_m[1] > 49.0] == [
        pytest.approx((10.0, 52.5), abs=0.01),
        pytest.approx((54.0, 50.0), abs=0.01),
    ]
    reason = "invisible, or on a layer that is off or frozen; left out"
    assert notes[-2:] == [f"block CB_SF6_220: 2 INSERT {reason}", f"layer FENCE_PLANNED: 1 LWPOLYLINE {reason}"]


AUTOCAD_ERRORS: tuple[tuple[Callable[[Modelspace], object], str], ...] = (
    (lambda space: space.add_blockref("CB_MISSING", (0, 0)), "block CB_MISSING: the block must be defined in the file"),
    (lambda space: space.add_blockref("CB_SF6_220", (0, 0), {"xscale": np.inf}), "the coordinates must be finite"),
    (lambda space: space.add_blockref("CB_SF6_220", (np.nan, 0)), "the coordinates must be finite, got nan"),
    (lambda space: space.add_blockref("CB_SF6_220", (0, 0), {"extrusion": (1, 0, 0)}), "must lie in the plane"),
    (lambda space: space.add_blockref("LOOP", (0, 0)), "block LOOP: a block must not contain itself"),
    (lambda space: space.add_blockref("GANTRY_EMPTY", (0, 0)), "must have lines that show the size of a gantry"),
    (lambda space: space.add_lwpolyline([(0, 0)], dxfattribs={"layer": "WALL"}), "at least 0.05 m long, got 0 m"),
    (lambda space: space.add_line((0, 0), (9, 9), {"layer": "S-FENCE"}), "at least 0.05 m long, got 0.0127 m"),
    (
        lambda space: space.add_lwpolyline([(0, 0), (1e4, 0), (2e4, 0)], close=True, dxfattribs={"layer": "BUILDING"}),
        "of layer BUILDING: a closed line must enclose an area of at least 0.0025 m2, got 0 m2",
    ),
    (lambda space: space.add_circle((0, 0), -3.0, {"layer": "ARRESTER"}), "the radius must be positive, got -3"),
)

LIBRECAD_ERRORS: tuple[tuple[Callable[[Modelspace], object], str], ...] = (
    (lambda space: space.add_line((5, 5), (5, 5), {"layer": "busbar"}), "LINE 4C of layer busbar: a line must be"),
    (lambda space: space.add_line((5, np.inf), (5, 5), {"layer": "busbar"}), "the coordinates must be finite, got inf"),
    (lambda space: space.add_circle((5, 5), 0.0, {"layer": "post insulator"}), "radius must be positive, got 0"),
    (lambda space: space.add_circle((5, np.nan), 1.0, {"layer": "post insulator"}), "must be finite, got nan"),
    (lambda space: space.add_circle((5, 5), 1.0, {"layer": "ct", "extrusion": (0, 1, 1)}), "must lie in the plane"),
    (lambda space: space.add_point((np.inf, 5), {"layer": "disconnector"}), "the coordinates must be finite, got inf"),
    (lambda space: space.add_polyline2d([(5, 5)], dxfattribs={"layer": "wall"}), "at least 0.05 m long, got 0 m"),
    (lambda space: space.add_polyline2d([(5, 5)] * 3, dxfattribs={"layer": "wall"}), "must enclose an area"),
    (
        lambda space: space.add_polyline2d([(5, 5), (9, 9), (5, 5)], close=True, dxfattribs={"layer": "building"}),
        "must enclose an area",
    ),
    (lambda space: space.add_blockref("symbol", (5, 5)), "block symbol: the block must be defined in the file"),
)


@pytest.mark.parametrize(("drawn", "planted"), [(autocad, AUTOCAD_ERRORS), (librecad, LIBRECAD_ERRORS)])
def test_each_planted_error_is_one_line(
    drawn: Callable[[], Drawing],
    planted: tuple[tuple[Callable[[Modelspace], object], str], ...],
    tmp_path: Path,
    refused: Refused,
) -> None:
    """Ten errors are ten lines in the order of the file, and nothing is written."""
    drawing = drawn()
    loop = drawing.blocks.new("LOOP")
    loop.add_blockref("LOOP", (0.0, 0.0))
    drawing.blocks.new("GANTRY_EMPTY")
    for plant, _ in planted:
        plant(drawing.modelspace())
    saved(drawing, tmp_path)
    mapping(tmp_path)
    lines = refused("import", "site.dxf", "--mapping", "mapping.toml", "--picture", cwd=tmp_path)
    assert len(lines) == len(planted) == 10, "\n".join(lines)
    for line, (_, expected) in zip(lines, planted, strict=True):
        assert line.startswith("site.dxf: ")
        assert expected in line
    assert sorted(each.name for each in tmp_path.iterdir()) == ["mapping.toml", "site.dxf"]


def test_georeference_of_a_drawing_is_kept(tmp_path: Path) -> None:
    """A piece has the longitude and latitude that the grid of the drawing gives it, and the yard is true to scale."""
    drawing = autocad()
    data = drawing.modelspace().new_geodata()
    data.setup_local_grid(
        design_point=(1e6, 0.0), reference_point=(9.0e5, 1.0e5), north_direction=(np.sin(0.3), np.cos(0.3))
    )
    text, yard, _ = import_site(saved(drawing, tmp_path), mapping(tmp_path))
    (tmp_path / "site.toml").write_text(text, encoding="utf-8")
    where = load_scenario(tmp_path / "site.toml").georeference
    assert where is not None
    # The true place of the breaker: 20 m and 30 m along the axes, turned so that `north_direction` points north.
    east_m, north_m = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]]) @ (20.0, 30.0)
    true = Transformer.from_crs(3395, 4326, always_xy=True).transform(9.0e5 + east_m, 1.0e5 + north_m)
    breaker = next(each for each in yard.equipment if each.name == "e01_qa1")
    got = longitude_latitude(np.array([breaker.position_m]), where)[0]
    assert got == pytest.approx(true, abs=1e-7)
    assert yard.size_m == pytest.approx((80.0, 60.0), rel=1e-3)


@pytest.mark.parametrize(("north_m", "reason"), [(9e9, "must be between 85 degrees"), (0.0, "is not understood")])
def test_georeference_that_is_not_understood_is_listed(north_m: float, reason: str, tmp_path: Path) -> None:
    drawing = autocad()
    data = drawing.modelspace().new_geodata()
    data.setup_local_grid(design_point=(0.0, 0.0), reference_point=(0.0, north_m))
    if not north_m:
        data.coordinate_system_definition = "a local grid"
    text, _, notes = import_site(saved(drawing, tmp_path), mapping(tmp_path))
    (note,) = (each for each in notes if each.startswith("GEODATA"))
    assert reason in note
    assert "[georeference]" not in text


def test_dynamic_block_and_array_of_blocks_are_understood(tmp_path: Path) -> None:
    """The name of an anonymous block is that of its dynamic block; an array has a piece for each row and column."""
    drawing = autocad()
    dynamic = drawing.blocks.new("ARRESTER_DYN")
    drawing.blocks.new("*U1").add_circle((0.0, 0.0), 200.0)
    drawing.appids.new("AcDbBlockRepBTag")
    drawing.blocks.get("*U1").block_record.set_xdata(
        "AcDbBlockRepBTag", [(1070, 1), (1005, dynamic.block_record_handle)]
    )
    array = {"row_count": 2, "column_count": 3, "row_spacing": 20_000.0, "column_spacing": 10_000.0}
    drawing.modelspace().add_blockref("*U1", (1e6 + 10e3, 10e3), array)
    _, yard, _ = import_site(saved(drawing, tmp_path), mapping(tmp_path))
    got = sorted(each.position_m for each in yard.equipment if each.kind == "surge_arrester")
    assert np.allclose(got, [(10, 10), (10, 30), (20, 10), (20, 30), (30, 10), (30, 30)], atol=0.01)


def test_mapping_states_kinds_heights_and_directions(tmp_path: Path) -> None:
    """Rows of a table come before known names; `ground` is left out without a note."""
    rows = """
    kv = 110
    [names]
    "cb*" = { kind = "disconnector_centre_break", kv = 400, yaw_deg = 45.0 }
    "NORTH*" = { kind = "kiosk", height_m = 2.0 }
    "S-TEXT" = { kind = "ground" }
    """
    _, yard, notes = import_site(saved(autocad(), tmp_path), mapping(tmp_path, rows))
    got = {each.name: each for each in yard.equipment}
    assert (got["e01_qa1"].kind, got["e01_qa1"].model_dump()["kv"]) == ("disconnector_centre_break", 400)
    assert (got["e01_qa1"].yaw_deg - 225.0) % 360.0 == pytest.approx(0.0, abs=0.1)
    assert got["power_transformer_1"].model_dump()["kv"] == 110
    assert [note for note in notes if "kiosk" not in note] == []


def test_picture_is_drawn_next_to_the_scenario(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    saved(autocad(), tmp_path)
    mapping(tmp_path)
    monkeypatch.chdir(tmp_path)
    call("import", "site.dxf", "--mapping", "mapping.toml", "--picture")
    assert (tmp_path / "site.png").read_bytes().startswith(b"\x89PNG")
    assert load_scenario("site.toml").yard.equipment


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        ("kv = 220\nnames = 3", ["names: must be a table"]),
        ('[names]\na = { kind = "pump" }\nb = { kind = "fence", kv = 20 }\nc = { height_m = 2.0 }', ["b.kv", "c.kind"]),
        ('[names]\na = { kind = "pump" }\nb = { kind = "valve" }', ["names.a.kind: must be one of", "names.b.kind"]),
        (
            "",
            [
                "block CB_SF6_220: circuit_breaker needs a voltage: kv = 110, 220 or 400",
                "block Power Transformer: power_transformer needs a voltage",
                "block GANTRY_A: gantry needs a voltage",
            ],
        ),
    ],
)
def test_each_error_of_a_mapping_is_one_line(text: str, lines: list[str], tmp_path: Path, refused: Refused) -> None:
    saved(autocad(), tmp_path)
    mapping(tmp_path, text)
    got = refused("import", "site.dxf", "--mapping", "mapping.toml", cwd=tmp_path)
    assert len(got) == len(lines), "\n".join(got)
    for line, expected in zip(got, lines, strict=True):
        assert expected in line
    assert not (tmp_path / "site.toml").exists()


@pytest.mark.parametrize(
    ("unit", "line"), [(4, "0.08 x 0.06 m; $INSUNITS is Millimeters"), (1, "2.03 x 1.52 m; $INSUNITS is Inches")]
)
def test_drawing_in_another_unit_is_one_error(unit: int, line: str, tmp_path: Path, refused: Refused) -> None:
    """Metres in a drawing whose unit is that of a template, millimetres or inches."""
    drawing = new("R2000", units=unit)
    space = drawing.modelspace()
    space.add_lwpolyline(square(40.0, 30.0, 80.0, 60.0), close=True).dxf.layer = "fence"
    space.add_lwpolyline(square(20.0, 15.0, 4.0, 3.0), close=True).dxf.layer = "building"
    space.add_point((30.0, 15.0), {"layer": "disconnector"})
    saved(drawing, tmp_path)
    (error,) = refused("import", "site.dxf", cwd=tmp_path)
    assert error == f"site.dxf: must be at least 5 m long, got {line}"


def test_unusable_drawing_is_refused_in_one_line(tmp_path: Path, refused: Refused) -> None:
    (tmp_path / "site.dxf").write_text("no drawing", encoding="utf-8")
    (line,) = refused("import", "site.dxf", cwd=tmp_path)
    assert line.startswith("site.dxf: must be a DXF file")
    drawing = autocad()
    drawing.header["$INSUNITS"] = 99
    saved(drawing, tmp_path)
    (line,) = refused("import", "site.dxf", cwd=tmp_path)
    assert line == "site.dxf: $INSUNITS must be a unit of length such as 4 (mm) or 6 (m), got 99"
    saved(new(), tmp_path)
    (line,) = refused("import", "site.dxf", cwd=tmp_path)
    assert line == "site.dxf: must contain equipment, got none that is known"


def test_entities_of_unknown_programs_are_listed(tmp_path: Path) -> None:
    """AutoCAD Architecture and Civil 3D write entities of their own, and proxies for other programs."""
    path = saved(librecad(), tmp_path)
    drawing = path.read_text()
    wall = "0\nAEC_WALL\n5\nFFA0\n100\nAcDbEntity\n8\nA-WALL\n100\nAecDbGeo\n"
    path.write_text(drawing.replace("2\nENTITIES\n", f"2\nENTITIES\n{wall}"))
    _, yard, notes = import_site(path, mapping(tmp_path))
    assert "layer A-WALL: 1 AEC_WALL not understood; left out" in notes
    assert yard.equipment


def test_hatch_is_not_a_second_piece(tmp_path: Path) -> None:
    """Programs draw an area as its outline and a hatch on the same layer, which may fill several areas."""
    drawing = autocad()
    hatch = drawing.modelspace().add_hatch(dxfattribs={"layer": "BUILDING"})
    for x in (1.02e6, 1.05e6):
        corners = [(x + 1e3 * a, 5e4 + 1e3 * b) for a, b in square(0.0, 0.0, 6.0, 4.0)]
        drawing.modelspace().add_lwpolyline(corners, close=True, dxfattribs={"layer": "BUILDING"})
        hatch.paths.add_polyline_path(corners, is_closed=True)
    _, yard, notes = import_site(saved(drawing, tmp_path), mapping(tmp_path))
    assert sum(each.kind == "building" for each in yard.equipment) == 2
    assert "layer BUILDING: 1 HATCH not understood; left out" in notes


def test_fence_within_a_block_has_its_sides(tmp_path: Path) -> None:
    """An outline that is the only content of a block is the fence, whatever its shape."""
    drawing = autocad()
    (outline,) = drawing.modelspace().query("LWPOLYLINE[layer=='S-FENCE']")
    block = drawing.blocks.new("FENCE_MAIN")
    corners = [(0, 0), (80, 0), (80, 60), (45, 60), (45, 58), (0, 58)]
    block.add_lwpolyline([(1e3 * x, 1e3 * y) for x, y in corners], close=True)
    drawing.modelspace().delete_entity(outline)  # pyright: ignore[reportArgumentType]
    drawing.modelspace().add_blockref("FENCE_MAIN", (1e6, 0.0))
    _, yard, _ = import_site(saved(drawing, tmp_path), mapping(tmp_path))
    assert yard.fence_m is not None
    assert len(yard.fence_m) == 6


def test_survey_feet_are_a_unit(tmp_path: Path) -> None:
    drawing = autocad()
    drawing.header["$INSUNITS"] = 21
    for block in drawing.modelspace():
        block.scale(1 / 304.8006096, 1 / 304.8006096, 1 / 304.8006096)  # pyright: ignore[reportAttributeAccessIssue]
    _, yard, _ = import_site(saved(drawing, tmp_path), mapping(tmp_path))
    assert yard.size_m == pytest.approx((80.0, 60.0), abs=0.01)


def test_damaged_drawings_are_refused_in_one_line(tmp_path: Path, refused: Refused) -> None:
    drawing = autocad()
    drawing.modelspace().add_ellipse((1.02e6, 5e4), (3e3, 0.0), 1e-6, dxfattribs={"layer": "BUILDING"})
    drawing.saveas(tmp_path / "site.dxf", fmt="bin")
    content = (tmp_path / "site.dxf").read_bytes()
    (tmp_path / "site.dxf").write_bytes(content[: len(content) // 2 + 1])
    mapping(tmp_path)
    (line,) = refused("import", "site.dxf", "--mapping", "mapping.toml", cwd=tmp_path)
    assert line.startswith("site.dxf: must be a DXF file: ")
    path = saved(autocad(), tmp_path)
    path.write_text(path.read_text().replace("$INSUNITS\n 70\n4", "$INSUNITS\n 70\n1e400"))
    (line,) = refused("import", "site.dxf", "--mapping", "mapping.toml", cwd=tmp_path)
    assert line.startswith("site.dxf: ")


def test_nested_blocks_of_unknown_names_are_listed_quickly(tmp_path: Path) -> None:
    """Each of thirty blocks holds the next one twice: a billion lines if all were opened."""
    drawing = autocad()
    drawing.blocks.new("LEVEL_30").add_line((0.0, 0.0), (1.0, 0.0))
    for k in range(29, -1, -1):
        block = drawing.blocks.new(f"LEVEL_{k}")
        for x in (0.0, 10.0):
            block.add_blockref(f"LEVEL_{k + 1}", (x, 0.0))
    drawing.modelspace().add_blockref("LEVEL_0", (1e6, 0.0))
    _, _, notes = import_site(saved(drawing, tmp_path), mapping(tmp_path))
    assert "block LEVEL_0: 1 INSERT not understood; left out" in notes


@pytest.mark.parametrize("rotation_deg", [0.0, 90.0, 180.0])
@pytest.mark.parametrize("kind", ["gis_outdoor", "gis_bay"])
def test_long_block_keeps_its_direction(kind: str, rotation_deg: float, tmp_path: Path) -> None:
    """Blocks that are drawn as their kind stands give the same length and yaw, also where both ends differ."""
    drawing = autocad()
    width, depth = (4e3, 9e3) if kind == "gis_outdoor" else (9e3, 4e3)
    drawing.blocks.new(kind.upper()).add_lwpolyline(square(0.0, 0.0, width, depth), close=True)
    drawing.modelspace().add_blockref(kind.upper(), (1e6 + 35e3, 45e3), dxfattribs={"rotation": rotation_deg})
    rows = f'kv = 220\n[names]\n"{kind}" = {{ kind = "{kind}" }}'
    _, yard, _ = import_site(saved(drawing, tmp_path), mapping(tmp_path, rows))
    (piece,) = (each.model_dump() for each in yard.equipment if each.kind == kind)
    assert piece["length_m"] == pytest.approx(9.0, abs=0.002)
    assert (piece["yaw_deg"] - rotation_deg) % 360.0 == pytest.approx(0.0, abs=0.01)
