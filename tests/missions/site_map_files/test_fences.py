"""Polygonal fences in maps: written and read back, in drawings, as a closed fence, and broken ones."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ezdxf.filemanagement import new

from dirmusic import InputFileError
from dirmusic.arrays import FloatArray
from pdpatrol.envs.scenario import load_scenario
from pdpatrol.envs.scenario.map import GeoreferenceConfig
from pdpatrol.missions.site_map_files.geodesy import longitude_latitude
from pdpatrol.missions.site_map_files.site_scenario import import_site
from pdpatrol.missions.site_map_files.write_site_map import site_map

Corners = tuple[tuple[float, float], ...]

FENCE_M = ((0.0, 0.0), (60.0, 0.0), (60.0, 25.0), (35.0, 25.0), (30.0, 40.0), (0.0, 36.5))
TRIANGLE_M = ((0.0, 3.0), (70.0, 0.0), (30.0, 45.0))


def corner_distance(fence_m: FloatArray, expected_m: FloatArray) -> float:
    """Return the largest distance of corners from the expected ones, in the best cyclic order."""
    assert fence_m.shape == expected_m.shape
    return min(float(np.abs(np.roll(fence_m, k, axis=0) - expected_m).max()) for k in range(len(fence_m)))


def written(folder: Path, *features: dict[str, Any]) -> Path:
    path = folder / "site.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}), encoding="utf-8")
    return path


def feature(kind: str, points_m: Any, **tags: object) -> dict[str, Any]:  # noqa: ANN401 - one point or a ring
    here = GeoreferenceConfig(latitude_deg=51.0, longitude_deg=7.0)
    places = longitude_latitude(np.array(points_m), here).tolist()
    coordinates = [places] if kind == "Polygon" else places
    return {"type": "Feature", "properties": tags, "geometry": {"type": kind, "coordinates": coordinates}}


def ring(corners_m: Corners, **tags: object) -> dict[str, Any]:
    return feature("Polygon", (*corners_m, corners_m[0]), **tags)


INSULATOR = feature("Point", (20.0, 20.0), power="insulator")
HV_INSULATOR = feature("Point", (20.0, 20.0), power="insulator", voltage="110000")


@pytest.mark.parametrize("heading_deg", [0.0, -63.0])
@pytest.mark.parametrize("fence_m", [FENCE_M, FENCE_M[::-1], TRIANGLE_M])
def test_written_fence_is_read_back(fence_m: Corners, heading_deg: float, tmp_path: Path) -> None:
    """Fence and equipment come back within a centimetre, and the scenario loads."""
    yard = tmp_path / "yard.toml"
    yard.write_text(
        f"[yard]\nfence_m = {list(map(list, fence_m))}\n[[yard.equipment]]\nname = 'breaker'\nkv = 110\n"
        "kind = 'circuit_breaker'\nposition_m = [30.0, 14.0]\nyaw_deg = 20.0\n"
        "[route]\ndock_m = [25.0, 6.0]\n[array]\n"
        f"[georeference]\nlatitude_deg = 51.0\nlongitude_deg = 7.0\nheading_deg = {heading_deg}\n",
        encoding="utf-8",
    )
    scenario = load_scenario(yard)
    assert scenario.georeference is not None
    path = tmp_path / "site.geojson"
    path.write_text(json.dumps(site_map(scenario, scenario.georeference)), encoding="utf-8")
    text, again, notes = import_site(path)
    assert notes == []
    assert again.fence_m is not None
    assert corner_distance(again.fence.corners_m, scenario.yard.fence.corners_m) < 0.01
    np.testing.assert_allclose(again.equipment[0].position_m, scenario.yard.equipment[0].position_m, atol=0.01)
    imported = tmp_path / "imported.toml"
    imported.write_text(text, encoding="utf-8")
    assert load_scenario(imported).yard == again


def test_closed_fence_around_the_features_is_the_outline(tmp_path: Path) -> None:
    """A smaller closed fence around a bay is equipment."""
    bay = ((10.0, 10.0), (20.0, 10.0), (20.0, 16.0), (10.0, 16.0))
    hut = ((40.0, 5.0), (46.0, 5.0), (46.0, 9.0), (40.0, 9.0))
    path = written(tmp_path, ring(bay, barrier="fence"), ring(FENCE_M, barrier="fence"), ring(hut, building="yes"))
    _, yard, _ = import_site(path)
    assert len(yard.fence.corners_m) == len(FENCE_M)
    assert sorted(piece.kind for piece in yard.equipment) == ["building", *["fence"] * 4]


@pytest.mark.parametrize("tags", [{"power": "substation"}, {"barrier": "fence"}])
def test_closed_line_around_the_features_is_the_outline(tags: dict[str, str], tmp_path: Path) -> None:
    """Overpass Turbo writes closed ways of fences as lines."""
    line = feature("LineString", (*FENCE_M, FENCE_M[0]), voltage="110000", **tags)
    _, yard, notes = import_site(written(tmp_path, line, HV_INSULATOR))
    assert notes == []
    assert len(yard.fence.corners_m) == len(FENCE_M)
    assert [piece.kind for piece in yard.equipment] == ["post_insulator"]


@pytest.mark.parametrize(("kind", "points_m"), [("Point", (30.0, 20.0)), ("LineString", FENCE_M)])
def test_substation_without_an_area_is_listed(kind: str, points_m: Any, tmp_path: Path) -> None:  # noqa: ANN401
    """Its voltage still is that of equipment without one."""
    path = written(tmp_path, feature(kind, points_m, power="substation", voltage="220000"), INSULATOR)
    _, yard, notes = import_site(path)
    assert "features.0: no equipment is known for power=substation, voltage=220000; left out" in notes
    assert yard.equipment[0].model_dump()["kv"] == 220


def test_rectangular_outline_has_no_corners_in_the_file(tmp_path: Path) -> None:
    box = ((0.0, 0.0), (30.0, 0.0), (60.0, 0.0), (60.0, 40.0), (0.0, 40.0))
    path = written(tmp_path, ring(box, power="substation", voltage="110000"), INSULATOR)
    text, yard, _ = import_site(path)
    assert yard.fence_m is None
    assert yard.size_m == (60.0, 40.0)
    assert "fence_m" not in text


def test_fence_of_a_drawing_keeps_its_corners(tmp_path: Path) -> None:
    drawing = new("R2018", units=4)
    space, corner = drawing.modelspace(), (5e6, 2e6)
    for layer, corners_m in (("fence", FENCE_M), ("building", ((5.0, 5.0), (11.0, 5.0), (11.0, 9.0), (5.0, 9.0)))):
        points = [(1000.0 * x + corner[0], 1000.0 * y + corner[1]) for x, y in corners_m]
        space.add_lwpolyline(points, close=True).dxf.layer = layer
    drawing.saveas(tmp_path / "site.dxf")
    _, yard, _ = import_site(tmp_path / "site.dxf")
    assert corner_distance(yard.fence.corners_m, np.array(FENCE_M)) < 0.01
    np.testing.assert_allclose(yard.equipment[0].position_m, (8.0, 7.0), atol=0.01)


def test_fence_of_a_drawing_around_most_features_is_the_outline(tmp_path: Path) -> None:
    """Read a closed fence within one of open lines as equipment; ends that differ by rounding close a line."""
    drawing = new("R2018", units=6)
    space = drawing.modelspace()
    for start, end in zip(FENCE_M, FENCE_M[1:] + FENCE_M[:1], strict=True):
        space.add_line(start, end, {"layer": "fence"})
    inner = [(5.0, 5.0), (13.0, 5.0), (13.0, 11.0), (5.0, 11.0)]
    space.add_lwpolyline(inner, close=True, dxfattribs={"layer": "fence"})
    for x in (20.0, 30.0):
        space.add_lwpolyline(
            [(x, 15.0), (x + 4.0, 15.0), (x + 4.0, 18.0), (x, 18.0)], close=True, dxfattribs={"layer": "building"}
        )
    drawing.saveas(tmp_path / "open.dxf")
    _, yard, (note,) = import_site(tmp_path / "open.dxf")
    assert "has no outline" in note
    assert sorted(piece.kind for piece in yard.equipment) == ["building", "building", *["fence"] * 10]
    space.add_lwpolyline([*FENCE_M, (0.0, 1e-9)], dxfattribs={"layer": "fence"})
    drawing.saveas(tmp_path / "closed.dxf")
    _, yard, _ = import_site(tmp_path / "closed.dxf")
    assert corner_distance(yard.fence.corners_m, np.array(FENCE_M)) < 0.01


def test_crossing_outline_is_one_error(tmp_path: Path) -> None:
    crossed = (FENCE_M[0], FENCE_M[2], FENCE_M[1], *FENCE_M[3:])
    path = written(tmp_path, ring(crossed, power="substation"), INSULATOR)
    with pytest.raises(InputFileError) as caught:
        import_site(path)
    assert "features.0: outline: sides must not touch or cross" in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1
