"""GeoJSON as QGIS and JOSM write it: pieces, planted errors, and notes on unknown features."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pdpatrol.envs.scenario.map import GeoreferenceConfig
from pdpatrol.missions.site_map_files.geodesy import longitude_latitude
from pdpatrol.missions.site_map_files.site_scenario import import_site
from tests.missions.conftest import Refused

HERE = GeoreferenceConfig(latitude_deg=48.1, longitude_deg=11.6)


def ring(x: float, y: float, width: float, depth: float) -> list[list[float]]:
    """Return the closed ring of a rectangle around a place in the yard, longitude and latitude."""
    sides = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5)])
    return longitude_latitude(np.array([x, y]) + sides * (width, depth), HERE).tolist()


def point(x: float, y: float) -> list[float]:
    return longitude_latitude(np.array([x, y]), HERE).tolist()


def feature(kind: str, coordinates: object, **properties: object) -> dict[str, Any]:
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def qgis(*more: dict[str, Any], crs: str = "urn:ogc:def:crs:OGC:1.3:CRS84") -> dict[str, Any]:
    """Return a layer as QGIS exports it: fields in upper case, NULL, heights, parts, and a member `crs`."""
    with_height = [[*each, 520.0] for each in ring(15.0, 12.0, 8.0, 6.0)]
    empty = {"type": "Feature", "properties": {"POWER": "insulator", "FID": 9}, "geometry": None}
    return {
        "type": "FeatureCollection",
        "name": "site",
        "crs": {"type": "name", "properties": {"name": crs}},
        "features": [
            feature("MultiPolygon", [[ring(30.0, 20.0, 60.0, 40.0)]], POWER="substation", VOLTAGE=110000),
            feature("Polygon", [with_height], Power="transformer", NAME=None, FID=2),
            feature(
                "MultiPolygon", [[ring(50.0, 10.0, 6.0, 4.0)], [ring(50.0, 20.0, 6.0, 4.0)]], BUILDING="yes", NAME="Hut"
            ),
            feature("MultiPoint", [[*point(30.0, 30.0), 521.0]], POWER="insulator", REF="Z7"),
            feature("MultiLineString", [[point(10.0, 30.0), point(20.0, 30.0)]], power="busbar"),
            empty,
            *more,
        ],
    }


def josm(*more: dict[str, Any]) -> dict[str, Any]:
    """Return a layer as JOSM exports it: tags as properties, and the ids of nodes, ways and relations."""
    features = [
        feature("Polygon", [ring(30.0, 20.0, 60.0, 40.0)], **{"@id": "way/11", "power": "substation"}),
        feature("Polygon", [ring(15.0, 12.0, 8.0, 6.0)], **{"@id": "way/12", "power": "transformer"}),
        feature("MultiPolygon", [[ring(50.0, 10.0, 6.0, 4.0)]], **{"@id": "relation/13", "building": "yes"}),
        feature("Point", point(30.0, 30.0), **{"@id": "node/14", "power": "insulator", "source": "survey"}),
    ]
    features[0]["properties"]["voltage"] = "110000;20000"
    return {"type": "FeatureCollection", "generator": "JOSM", "features": [*features, *more]}


def written(folder: Path, layer: dict[str, Any]) -> Path:
    path = folder / "site.geojson"
    path.write_text(json.dumps(layer), encoding="utf-8")
    return path


def test_layer_of_qgis_becomes_pieces(tmp_path: Path) -> None:
    """Each part of a geometry is a piece; a feature without a geometry is listed."""
    _, yard, notes = import_site(written(tmp_path, qgis()))
    assert notes == ["features.5: has no geometry; left out"]
    assert yard.size_m == pytest.approx((60.0, 40.0), abs=0.01)
    want = {
        "power_transformer_1": (15.0, 12.0),
        "hut": (50.0, 10.0),
        "hut_2": (50.0, 20.0),
        "z7": (30.0, 30.0),
        "busbar_1": (15.0, 30.0),
    }
    got = {each.name: each.position_m for each in yard.equipment}
    assert got.keys() == want.keys()
    for name, place_m in want.items():
        assert got[name] == pytest.approx(place_m, abs=0.01)


def test_layer_of_josm_becomes_pieces(tmp_path: Path) -> None:
    _, yard, notes = import_site(written(tmp_path, josm()))
    assert notes == []
    got = {each.name: each.position_m for each in yard.equipment}
    assert got["power_transformer_1"] == pytest.approx((15.0, 12.0), abs=0.01)
    assert got["building_1"] == pytest.approx((50.0, 10.0), abs=0.01)
    assert got["post_insulator_1"] == pytest.approx((30.0, 30.0), abs=0.01)
    assert len(got) == 3


GRID = [691_000.0, 5_330_000.0]
"""Coordinates of a national grid where longitude and latitude must stand."""

QGIS_ERRORS = (
    (feature("Point", [GRID[0], 48.1], FID=10), "geometry.Point.coordinates.0: must be less than or equal to 180"),
    (feature("Point", [11.6, -95.0], FID=11), "geometry.Point.coordinates.1: must be greater than or equal to -85"),
    (feature("Point", ["11,6", 48.1]), "geometry.Point.coordinates.0: must be a valid number"),
    (feature("Point", []), "geometry.Point.coordinates: must be longitude and latitude, got []"),
    (feature("MultiPoint", [[11.6, float("inf")]]), "geometry.MultiPoint.coordinates.0.1: must be"),
    (feature("MultiPolygon", [[ring(9.0, 9.0, 1.0, 1.0)[:3]]]), "MultiPolygon.coordinates.0.0: must have at least 4"),
    (feature("MultiPolygon", [[]]), "geometry.MultiPolygon.coordinates.0: must have at least 1 item"),
    (feature("MultiLineString", [[point(9.0, 9.0)]]), "geometry.MultiLineString.coordinates.0: must have at least 2"),
    (feature("CurvePolygon", [ring(9.0, 9.0, 1.0, 1.0)]), "geometry: must have the shape"),
    ({"type": "Feature", "properties": None, "geometry": "POINT (11.6 48.1)"}, "geometry: must be a table"),
)

JOSM_ERRORS = (
    (feature("Polygon", [], **{"@id": "way/20"}), "geometry.Polygon.coordinates: must have at least 1 item"),
    (feature("Polygon", [[point(1.0, 1.0)] * 2], **{"@id": "way/21"}), "Polygon.coordinates.0: must have at least 4"),
    (feature("LineString", [], **{"@id": "way/22"}), "geometry.LineString.coordinates: must have at least 2 items"),
    (feature("LineString", [point(1.0, 1.0), None], **{"@id": "way/23"}), "geometry.LineString.coordinates.1: "),
    (feature("Point", None, **{"@id": "node/24"}), "geometry.Point.coordinates: "),
    (feature("Point", [11.6], **{"@id": "node/25"}), "Point.coordinates: must be longitude and latitude"),
    (feature("Point", {"lon": 11.6, "lat": 48.1}, **{"@id": "node/26"}), "geometry.Point.coordinates"),
    (feature("GeometryCollection", [], **{"@id": "relation/27"}), "geometry: must have the shape"),
    ({"type": "Feature", "properties": {}, "geometry": {"type": "Point"}}, "geometry.Point.coordinates: is required"),
    ({"type": "Feature", "properties": {"@id": "node/29"}}, "geometry: is required"),
)


@pytest.mark.parametrize(("layer", "planted"), [(qgis, QGIS_ERRORS), (josm, JOSM_ERRORS)])
def test_each_planted_error_is_one_line(layer: Any, planted: Any, tmp_path: Path, refused: Refused) -> None:  # noqa: ANN401
    """Ten errors are ten lines in the order of the file, and nothing is written."""
    content = layer(*(broken for broken, _ in planted))
    first = len(content["features"]) - len(planted)
    written(tmp_path, content)
    lines = refused("import", "site.geojson", "--picture", cwd=tmp_path)
    assert len(lines) == len(planted) == 10, "\n".join(lines)
    for number, (line, (_, expected)) in enumerate(zip(lines, planted, strict=True), start=first):
        assert line.startswith(f"site.geojson: features.{number}.")
        assert expected in line
    assert [each.name for each in tmp_path.iterdir()] == ["site.geojson"]


def test_other_reference_systems_are_refused_in_one_line(tmp_path: Path, refused: Refused) -> None:
    written(tmp_path, qgis(crs="urn:ogc:def:crs:EPSG::25832"))
    (line,) = refused("import", "site.geojson", cwd=tmp_path)
    assert line.startswith("site.geojson: crs: must be WGS 84")
    assert line.endswith("got urn:ogc:def:crs:EPSG::25832")


def test_map_on_a_grid_without_a_crs_is_refused_in_one_line(tmp_path: Path, refused: Refused) -> None:
    points = [feature("Point", [GRID[0] + k, GRID[1]], power="insulator") for k in range(50)]
    written(tmp_path, {"type": "FeatureCollection", "features": points})
    (line,) = refused("import", "site.geojson", cwd=tmp_path)
    assert line.startswith(
        "site.geojson: must have longitude and latitude on WGS 84, as RFC 7946 requires: features.0."
    )
    assert line.endswith("got 691000.0")


def test_mapping_of_a_map_is_refused(tmp_path: Path, refused: Refused) -> None:
    written(tmp_path, josm())
    (line,) = refused("import", "site.geojson", "--mapping", "mapping.toml", cwd=tmp_path)
    assert line == "--mapping: is for .dxf files, got site.geojson"


def test_closed_fence_within_the_yard_has_four_sides(tmp_path: Path) -> None:
    fence = feature("Polygon", [ring(30.0, 20.0, 10.0, 6.0)], **{"@id": "way/15", "barrier": "fence"})
    _, yard, _ = import_site(written(tmp_path, josm(fence)))
    sides = sorted(each.position_m for each in yard.equipment if each.kind == "fence")
    assert np.allclose(sides, [(25.0, 20.0), (30.0, 17.0), (30.0, 23.0), (35.0, 20.0)], atol=0.01)
