"""Maps of substations: reading, refused and listed features, and reading of written maps."""

import json
import re
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dirmusic import InputFileError
from pdpatrol.envs.scenario import load_scenario
from pdpatrol.envs.scenario.map import GeoreferenceConfig
from pdpatrol.envs.substation.substation import SubstationParameters, draw_substation
from pdpatrol.envs.substation.substation_file import substation_text
from pdpatrol.missions.site_map_files.geodesy import longitude_latitude, places_in_yard
from pdpatrol.missions.site_map_files.site_scenario import import_site
from pdpatrol.missions.site_map_files.write_site_map import site_map
from tests.missions.conftest import Refused, call

HERE = GeoreferenceConfig(latitude_deg=-33.9, longitude_deg=18.4, heading_deg=27.0)
SHARED = Path(__file__).parents[4] / "shared" / "findings" / "cases" / "site_from_osm" / "site.geojson"


def feature(points_m: list[tuple[float, float]], **tags: object) -> dict[str, Any]:
    """Return a feature of a made-up yard: a point, a line, or an area if the last point is the first."""
    points = longitude_latitude(np.array(points_m), HERE).tolist()
    shape, coordinates = ("Point", points[0]) if len(points) == 1 else ("LineString", points)
    if len(points) > 3 and points[0] == points[-1]:
        shape, coordinates = "Polygon", [points]
    return {"type": "Feature", "properties": tags, "geometry": {"type": shape, "coordinates": coordinates}}


def area(x: float, y: float, width_m: float, depth_m: float, **tags: object) -> dict[str, Any]:
    x_m, y_m = 0.5 * width_m, 0.5 * depth_m
    return feature(
        [(x - x_m, y - y_m), (x + x_m, y - y_m), (x + x_m, y + y_m), (x - x_m, y + y_m), (x - x_m, y - y_m)], **tags
    )


OUTLINE = area(40.0, 30.0, 80.0, 60.0, power="substation", voltage="220000;20000")
BREAKER = feature([(20.0, 30.0)], power="switch", switch="circuit_breaker", ref="E03-QA1")


def written_heading(heading_deg: float) -> str:
    outline = area(40.0, 30.0, 80.0, 60.0, power="substation", heading_deg=heading_deg)
    return json.dumps({"type": "FeatureCollection", "features": [outline]})


def written(folder: Path, *features: dict[str, Any]) -> Path:
    path = folder / "site.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}), encoding="utf-8")
    return path


def test_tags_become_kinds_at_their_places(tmp_path: Path) -> None:
    """Positions, turns, lengths, voltages and names of a made-up map, and its position on Earth."""
    path = written(
        tmp_path,
        OUTLINE,
        BREAKER,
        area(40.0, 15.0, 12.0, 6.0, power="transformer", voltage="400000"),
        feature([(10.0, 40.0), (60.0, 40.0)], power="line", line="busbar"),
        feature([(30.0, 50.0)], power="transformer", transformer="current", voltage="110000"),
        area(70.0, 50.0, 6.0, 10.0, building="yes", height="5 m"),
        feature([(5.0, 55.0), (5.0, 45.0), (15.0, 45.0)], barrier="fence"),
    )
    text, yard, notes = import_site(path)
    assert notes == []
    assert yard.size_m == pytest.approx((80.0, 60.0), abs=0.02)
    got = {item.name: item for item in yard.equipment}
    for name, kind, kv, place_m in (
        ("e03_qa1", "circuit_breaker", 220, (20.0, 30.0)),
        ("power_transformer_1", "power_transformer", 400, (40.0, 15.0)),
        ("busbar_1", "busbar", 220, (35.0, 40.0)),
        ("current_transformer_1", "current_transformer", 110, (30.0, 50.0)),
        ("building_1", "building", None, (70.0, 50.0)),
        ("fence_2", "fence", None, (10.0, 45.0)),
    ):
        assert (got[name].kind, got[name].model_dump().get("kv")) == (kind, kv)
        assert got[name].position_m == pytest.approx(place_m, abs=0.01)
    assert got["busbar_1"].model_dump()["length_m"] == pytest.approx(50.0, abs=0.01)
    assert abs(got["building_1"].yaw_deg) == pytest.approx(90.0, abs=0.1)
    low_m, high_m = got["building_1"].solids.extent_m
    assert high_m - low_m == pytest.approx([6.0, 10.0], abs=0.05)
    (tmp_path / "site.toml").write_text(text, encoding="utf-8")
    scenario = load_scenario(tmp_path / "site.toml")
    assert scenario.yard == yard
    assert scenario.georeference is not None
    assert scenario.georeference.heading_deg == pytest.approx(27.0, abs=0.01)
    assert scenario.georeference.latitude_deg == pytest.approx(-33.9, abs=1e-7)


def test_numbers_of_tags_are_in_their_units(tmp_path: Path) -> None:
    """Volts of the primary winding, kilovolts, metres and feet; other heights are listed, empty tags do not count."""
    _, yard, (note,) = import_site(
        written(
            tmp_path,
            area(40.0, 30.0, 80.0, 60.0, power="substation", voltage="380000;110000"),
            area(20.0, 15.0, 7.0, 5.0, power="transformer", **{"voltage:primary": "110000", "name": "T1"}),
            feature([(60.0, 15.0)], power="insulator", voltage="220 kV", name="Z1", building=""),
            area(20.0, 40.0, 8.0, 6.0, building="yes", height="10 ft", name="B1"),
            area(40.0, 40.0, 8.0, 6.0, building="yes", height="4.5m", name="B2"),
            area(60.0, 40.0, 8.0, 6.0, building="yes", height="16'3\"", name="B3"),
            area(20.0, 50.0, 8.0, 6.0, building="yes", height="5,5", name="B4"),
            area(40.0, 50.0, 8.0, 6.0, building="yes", height="two storeys", name="B5"),
        )
    )
    got = {each.name: each.model_dump() for each in yard.equipment}
    assert (got["t1"]["kv"], got["z1"]["kv"]) == (110, 220)
    heights_m = [got[name]["height_m"] for name in ("b1", "b2", "b3", "b4", "b5")]
    assert heights_m == pytest.approx([3.048, 4.5, 4.953, 5.5, 3.5])
    assert note == "features.7 (B5): height: must be a number of metres, got two storeys; a usual height is taken"


def test_three_poles_in_a_row_are_one_piece(tmp_path: Path) -> None:
    poles = [feature([(20.0, 25.0 + 4.0 * k)], power="switch", switch="disconnector") for k in (2, 0, 1)]
    alone = feature([(50.0, 30.0)], power="switch", switch="disconnector")
    _, yard, (note,) = import_site(written(tmp_path, OUTLINE, *poles, alone))
    assert note.endswith("are taken as the poles of one disconnector_centre_break")
    apart, joined = sorted(yard.equipment, key=lambda item: -item.position_m[0])
    assert apart.position_m == pytest.approx((50.0, 30.0), abs=0.01)
    assert joined.position_m == pytest.approx((20.0, 29.0), abs=0.01)
    assert abs(joined.yaw_deg) == pytest.approx(90.0, abs=0.1)


def test_equal_names_are_numbered(tmp_path: Path) -> None:
    """Three switches of one name are the poles of one; other pieces get another name, and none is lost."""
    poles = [feature([(40.0, 20.0 + 3.0 * k)], power="switch", switch="circuit_breaker", ref="QA2") for k in range(3)]
    phases = [feature([(60.0 + 3.0 * k, 20.0)], power="transformer", transformer="current", ref="T1") for k in range(2)]
    named = feature([(60.0, 40.0)], power="insulator", ref="t1_2")
    _, yard, notes = import_site(written(tmp_path, OUTLINE, *poles, *phases, named))
    got = {each.name: each.position_m for each in yard.equipment}
    want = {"qa2": (40.0, 23.0), "t1": (60.0, 20.0), "t1_3": (63.0, 20.0), "t1_2": (60.0, 40.0)}
    assert got == {name: pytest.approx(place_m, abs=0.01) for name, place_m in want.items()}
    assert notes[1:] == ["features.5 (T1): has the name `t1` of an earlier piece; named `t1_3`"]


def test_closed_walls_stand_on_their_sides(tmp_path: Path) -> None:
    """Divide a wall around the yard into four parts; a narrow area is a straight wall."""
    around = area(40.0, 30.0, 70.0, 50.0, barrier="wall")
    _, yard, notes = import_site(written(tmp_path, OUTLINE, around, area(30.0, 20.0, 10.0, 0.4, barrier="wall")))
    assert notes == []
    got = {each.name: (each.position_m, each.model_dump()["footprint_m"][0]) for each in yard.equipment}
    want = {
        "wall_1": ((40.0, 5.0), 70.0),
        "wall_2": ((75.0, 30.0), 50.0),
        "wall_3": ((40.0, 55.0), 70.0),
        "wall_4": ((5.0, 30.0), 50.0),
        "wall_5": ((30.0, 20.0), 10.0),
    }
    assert got.keys() == want.keys()
    for name, (place_m, length_m) in want.items():
        assert got[name] == (pytest.approx(place_m, abs=0.01), pytest.approx(length_m, abs=0.01))


def test_closed_way_of_a_portal_is_one_gantry(tmp_path: Path) -> None:
    """Read a closed way that a tool wrote as a line as an area."""
    portal = area(40.0, 30.0, 12.0, 1.0, power="portal")
    portal["geometry"] = {"type": "LineString", "coordinates": portal["geometry"]["coordinates"][0]}
    _, yard, _ = import_site(written(tmp_path, OUTLINE, portal))
    (gantry,) = yard.equipment
    assert gantry.kind == "gantry"
    assert gantry.position_m == pytest.approx((40.0, 30.0), abs=0.01)
    assert gantry.model_dump()["length_m"] == pytest.approx(12.0, abs=0.01)


def test_poles_of_a_large_yard_are_joined(tmp_path: Path) -> None:
    """Only poles near each other are compared: 288 of them have 4 million groups of three; the yard is of full size."""
    outline = area(200.0, 150.0, 400.0, 300.0, power="substation", voltage="110000")
    poles = [
        feature([(20.0 + 50.0 * column, 20.0 + 20.0 * row + 2.0 * pole)], power="switch", switch="disconnector")
        for column in range(8)
        for row in range(12)
        for pole in range(3)
    ]
    _, yard, notes = import_site(written(tmp_path, outline, *poles))
    assert (len(yard.equipment), len(notes)) == (96, 96)


KIOSK = {"name": "it", "shape": "box", "kind": "kiosk", "footprint_m": [1.0, 1.0], "height_m": 2.0}

NOT_UNDERSTOOD = (
    (feature([(30.0, 30.0)], power="catenary_mast"), "no equipment is known for power=catenary_mast; left out"),
    (feature([(30.0, 30.0)]), "no equipment is known for a feature without tags; left out"),
    (feature([(30.0, 30.0)], building="yes"), "building must be a line or an area, got a point; left out"),
    (feature([(30.0, 30.0)], power="portal"), "gantry must be a line or an area, got a point; left out"),
    (feature([(79.9, 30.0)], power="transformer"), r"a power_transformer there extends \d.\d\d m beyond the fence"),
    (feature([(30.0, 30.0)], power="transformer", voltage="20000"), "needs a voltage from 60 to 550 kV, got 20 kV"),
    (feature([(30.0, 30.0), (30.1, 30.0)], barrier="fence"), "length_m: must be greater than or equal to 0.5"),
    (feature([(30.0, 30.0)], pdpatrol={"name": "it", "kind": "pump"}), "kind: must be one of building"),
    (feature([(30.0, 30.0)], pdpatrol=KIOSK), "no kind `kiosk`; left out"),
    (feature([(30.0, 30.0)], pdpatrol={"position_m": [1, 2]}), "pdpatrol: kind must be text, got None; left out"),
    (feature([(30.0, 30.0)], pdpatrol={"kind": {"a": 1}}), "pdpatrol: kind must be text, got {'a': 1}; left out"),
    (feature([(30.0, 30.0)], power="pole", description="one\ntwo\x07"), r"description=one\\ntwo\\x07; left out"),
    (feature([(30.0, 30.0)], power="pole", name="a\ud800b"), r"a\\ud800b"),
    ({"type": "Feature", "properties": {}, "geometry": {"type": "MultiPoint", "coordinates": []}}, "has no geometry"),
)


@pytest.mark.parametrize(("item", "line"), NOT_UNDERSTOOD, ids=range(len(NOT_UNDERSTOOD)))
def test_what_is_not_understood_is_listed(item: dict[str, Any], line: str, tmp_path: Path) -> None:
    """One note names the feature; all others are still read, and the note stands in the file as well."""
    text, yard, (note,) = import_site(written(tmp_path, OUTLINE, BREAKER, item))
    assert note.startswith("features.2")
    assert re.search(line, note), note
    assert [piece.name for piece in yard.equipment] == ["e03_qa1"]
    assert f"# - {note}" in text


BAD_GEOMETRY = (
    (
        {"type": "Point", "coordinates": [1001875.4, 52.0]},
        "geometry.Point.coordinates.0: must be less than or equal",
    ),
    ({"type": "Point", "coordinates": [9.0]}, "geometry.Point.coordinates: must be longitude and latitude, got [9.0]"),
    ({"type": "Point", "coordinates": ["nine", 52.0]}, "geometry.Point.coordinates.0: must be a valid number"),
    ({"type": "Point", "coordinates": [float("nan"), 52.0]}, "geometry.Point.coordinates.0: must be a finite number"),
    ({"type": "LineString", "coordinates": [[9.0, 52.0]]}, "must have at least 2 items"),
    ({"type": "Polygon", "coordinates": [[[9.0, 52.0], [9.1, 52.0], [9.0, 52.0]]]}, "must have at least 4 items"),
    (
        {"type": "Polygon", "coordinates": [[[9.0, 52.0], [9.1, 52.0], [9.1, 52.1], [9.0, 52.1]]]},
        "geometry.Polygon.coordinates.0: must end where it begins, at (9.0, 52.0), got (9.0, 52.1)",
    ),
    ({"type": "Circle", "coordinates": [9.0, 52.0]}, "geometry"),
    ("nowhere", "geometry"),
)


def test_each_bad_geometry_is_one_error(tmp_path: Path) -> None:
    broken = [{"type": "Feature", "properties": {}, "geometry": geometry} for geometry, _ in BAD_GEOMETRY]
    with pytest.raises(InputFileError) as refused:
        import_site(written(tmp_path, OUTLINE, *broken))
    lines = refused.value.faults
    assert len(lines) == len(BAD_GEOMETRY)
    for number, (line, (_, expected)) in enumerate(zip(lines, BAD_GEOMETRY, strict=True), start=1):
        assert f"site.geojson: features.{number}." in line
        assert expected in line


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("{", "is not valid JSON"),
        ("[]", "must be a GeoJSON FeatureCollection with features"),
        ('{"type": "FeatureCollection", "features": []}', "must be a GeoJSON FeatureCollection with features"),
        (json.dumps({"type": "FeatureCollection", "features": [OUTLINE]}), "must contain equipment, got none"),
        (json.dumps({"type": "FeatureCollection", "features": [OUTLINE, OUTLINE]}), "must have one outline"),
        (
            json.dumps(
                {"type": "FeatureCollection", "features": [BREAKER, feature([(900.0, 9.0)], power="insulator")]}
            ),
            "the yard must be at most 400 m long",
        ),
        (written_heading(float("nan")), "features.0: heading_deg: must be from -360 to 360 degrees, got nan"),
        (written_heading(400.0), "features.0: heading_deg: must be from -360 to 360 degrees, got 400.0"),
    ],
)
def test_unusable_file_is_refused_in_one_line(text: str, line: str, tmp_path: Path, refused: Refused) -> None:
    (tmp_path / "site.geojson").write_text(text, encoding="utf-8")
    (error,) = refused("import", "site.geojson", cwd=tmp_path)
    assert line in error
    assert not (tmp_path / "site.toml").exists()


@pytest.mark.parametrize("heading_deg", [0.0, 27.0, 90.0, -135.0])
def test_written_map_is_read_back(heading_deg: float, tmp_path: Path) -> None:
    """Every piece keeps its keys, and its place within 1 cm, whatever the heading."""
    site = tmp_path / "drawn.toml"
    where = f"[georeference]\nlatitude_deg = 51.5\nlongitude_deg = 7.4\nheading_deg = {heading_deg}\n"
    site.write_text(
        substation_text(draw_substation(SubstationParameters(220, "ring", 4, 1)), 1) + "\n" + where, encoding="utf-8"
    )
    drawn = load_scenario(site)
    assert drawn.georeference is not None
    path = tmp_path / "site.geojson"
    path.write_text(json.dumps(site_map(drawn, drawn.georeference)), encoding="utf-8")
    _, yard, notes = import_site(path)
    assert notes == []
    assert np.abs(np.subtract(yard.size_m, drawn.yard.size_m)).max() < 0.01
    assert len(yard.equipment) == len(drawn.yard.equipment)
    for piece, old in zip(yard.equipment, drawn.yard.equipment, strict=True):
        assert piece.model_dump(exclude={"position_m"}) == old.model_dump(exclude={"position_m"})
        assert np.linalg.norm(np.subtract(piece.position_m, old.position_m)) < 0.01


def test_keys_that_were_saved_as_text_are_read(tmp_path: Path) -> None:
    """GDAL writes a table within the properties as text, and programs that use it do so too."""
    keys = {"name": "q1", "kind": "circuit_breaker", "kv": 400, "yaw_deg": 90.0}
    good = feature([(20.0, 30.0)], power="switch", switch="circuit_breaker", pdpatrol=json.dumps(keys))
    bad = feature([(40.0, 30.0)], power="switch", switch="circuit_breaker", pdpatrol="{'name'")
    _, yard, (note,) = import_site(written(tmp_path, OUTLINE, good, bad))
    assert [each.model_dump(include=set(keys)) for each in yard.equipment] == [keys]
    assert note.startswith("features.2: pdpatrol: is not valid JSON")


@settings(max_examples=50, deadline=None)
@given(
    latitude_deg=st.floats(-80.0, 80.0),
    longitude_deg=st.floats(-179.0, 179.0),
    heading_deg=st.floats(-360.0, 360.0),
    place_m=st.tuples(st.floats(0.0, 400.0), st.floats(0.0, 400.0)),
)
def test_geodesy_is_inverted_within_a_millimetre(
    latitude_deg: float, longitude_deg: float, heading_deg: float, place_m: tuple[float, float]
) -> None:
    where = GeoreferenceConfig(latitude_deg=latitude_deg, longitude_deg=longitude_deg, heading_deg=heading_deg)
    there = longitude_latitude(np.array([place_m]), where)
    assert np.abs(places_in_yard(there, where) - place_m).max() < 1.5e-3


def test_export_of_a_scenario_needs_a_georeference(tmp_path: Path, refused: Refused) -> None:
    path = tmp_path / "site.toml"
    path.write_text(
        substation_text(draw_substation(SubstationParameters(110, "single_busbar", 2, 0)), 1), encoding="utf-8"
    )
    (error,) = refused("export", "site.toml", cwd=tmp_path)
    assert error == "site.toml: must have a table [georeference] to be written as a map"


@pytest.mark.skipif(not SHARED.exists(), reason="needs ../shared")
def test_openstreetmap_extract_becomes_a_scenario(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    call("import", SHARED, "--out", "site.toml")
    scenario = load_scenario(tmp_path / "site.toml")
    kinds = [item.kind for item in scenario.yard.equipment]
    assert {kind: kinds.count(kind) for kind in set(kinds)} == {
        "power_transformer": 2,
        "building": 1,
        "circuit_breaker": 2,
        "current_transformer": 6,
        "busbar": 1,
    }


def test_values_that_cannot_be_read_are_listed(tmp_path: Path) -> None:
    outline = area(40.0, 30.0, 80.0, 60.0, power="substation", voltage="110000")
    breaker = feature([(20.0, 30.0)], power="switch", switch="circuit_breaker", voltage="medium")
    house = area(60.0, 40.0, 8.0, 6.0, building="yes", **{"building:levels": "2;3"})
    _, yard, notes = import_site(written(tmp_path, outline, breaker, house))
    assert [note.split(": ", 1)[1] for note in notes] == [
        "voltage: must be numbers of volts such as 110000;20000, got medium; ignored",
        "building:levels: must be a number, got 2;3; one is taken",
    ]
    assert len(yard.equipment) == 2


def test_parts_of_a_collection_and_tags_as_text_are_read(tmp_path: Path) -> None:
    """GDAL writes tags of OpenStreetMap as `other_tags`; other programs write them as JSON."""
    point = feature([(20.0, 30.0)])["geometry"]
    house = area(60.0, 40.0, 8.0, 6.0, building="yes")
    items = (
        {"type": "Feature", "properties": {"other_tags": '"power"=>"insulator","ref"=>"Z1"'}, "geometry": point},
        {"type": "Feature", "properties": {"tags": '{"building": "yes", "ref": "B1"}'}, "geometry": house["geometry"]},
        {
            "type": "Feature",
            "properties": {"building": "yes", "ref": "B2"},
            "geometry": {"type": "GeometryCollection", "geometries": [area(20.0, 45.0, 8.0, 6.0)["geometry"]]},
        },
    )
    outline = area(40.0, 30.0, 80.0, 60.0, power="substation", voltage="110000")
    _, yard, notes = import_site(written(tmp_path, outline, *items))
    assert ([each.name for each in yard.equipment], notes) == (["z1", "b1", "b2"], [])


def test_inner_rings_are_listed(tmp_path: Path) -> None:
    house, hole = area(60.0, 40.0, 8.0, 6.0, building="yes"), area(60.0, 40.0, 2.0, 2.0)
    house["geometry"]["coordinates"] += hole["geometry"]["coordinates"]
    _, _, notes = import_site(written(tmp_path, OUTLINE, BREAKER, house))
    assert notes == ["features.2: 1 inner ring left out"]


@pytest.mark.parametrize(
    ("crs", "is_refused"),
    [
        ({"type": "EPSG", "properties": {"code": 25832}}, True),
        ("EPSG:25832", True),
        ({"type": "link", "properties": {"href": "http://example.com/crs"}}, True),
        ({"type": "name", "properties": {"name": "http://www.opengis.net/def/crs/EPSG/0/4326"}}, False),
        ({"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC::CRS84h"}}, False),
        ({"type": "EPSG", "properties": {"code": 4326}}, False),
    ],
)
def test_reference_systems_are_checked(tmp_path: Path, crs: object, is_refused: bool) -> None:
    path = written(tmp_path, OUTLINE, BREAKER)
    path.write_text(json.dumps(json.loads(path.read_text()) | {"crs": crs}))
    with pytest.raises(InputFileError, match="crs: must be WGS 84") if is_refused else nullcontext():
        import_site(path)


FAR_RING = """
[yard]
fence_m = [[390, 380], [0, 380], [0, 0], [390, 0], [390, 100], [200, 100], [200, 200], [390, 200]]
equipment = [
  { name = "a", shape = "cylinder", kind = "bushing", position_m = [385, 375], radius_m = 0.15, height_m = 2 },
  { name = "b", shape = "cylinder", kind = "bushing", position_m = [5, 5], radius_m = 0.15, height_m = 2 },
]
[route]
dock_m = [20, 20]
[array]
"""


@pytest.mark.parametrize("latitude_deg", [50.0, 84.9])
def test_ring_that_starts_far_from_the_origin_comes_back(tmp_path: Path, latitude_deg: float) -> None:
    """Meridians converge, so the heading must be that at the corner of the yard, not at the first point of the ring."""
    reference = GeoreferenceConfig(latitude_deg=latitude_deg, longitude_deg=10.0, heading_deg=17.0)
    (tmp_path / "site.toml").write_text(FAR_RING)
    drawn = load_scenario(tmp_path / "site.toml")
    (tmp_path / "site.geojson").write_text(json.dumps(site_map(drawn, reference)))
    _, back, _ = import_site(tmp_path / "site.geojson")
    assert back.fence_m is not None
    assert drawn.yard.fence_m is not None
    assert np.abs(np.subtract(back.fence_m, drawn.yard.fence_m)).max() < 0.002
    for each, original in zip(back.equipment, drawn.yard.equipment, strict=True):
        assert np.abs(np.subtract(each.position_m, original.position_m)).max() < 0.002


def test_failed_import_leaves_no_file(tmp_path: Path, refused: Refused) -> None:
    assert refused("import", ".", cwd=tmp_path) == [".: must be a file, is a folder"]
    assert refused("import", "a.geojson", cwd=tmp_path) == ["a.geojson: cannot be read: No such file or directory"]
    assert list(tmp_path.iterdir()) == []
