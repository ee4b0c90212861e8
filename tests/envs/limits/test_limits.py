"""What a scenario may say: limits with reasons, names that are no paths, faults in plain words, and notes."""

from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.envs.plausibility import plausibility
from pdpatrol.envs.scenario import ScenarioError, load_scenario, shipped_scenarios
from pdpatrol.envs.scenario.faults import MOST_FAULTS
from pdpatrol.envs.scenario.suite import suite_yards
from tests.envs.limits.drawn_scenarios import SCHEMA, SMALL, as_toml

GUN = {"name": "gun", "position_m": [16.0, 12.0, 2.0]}
ONE = {"name": "one", "sites": ["tank/south"]}
WALL = {"name": "wall", "kind": "wall", "shape": "box", "footprint_m": [6.0, 0.3], "height_m": 3.0}


def small(**tables: Any) -> dict[str, Any]:  # noqa: ANN401 - as TOML
    """The small scenario with keys of its tables, or whole ones, set."""
    scenario: dict[str, Any] = deepcopy(SMALL)
    for name, value in tables.items():
        is_changed = isinstance(value, dict) and isinstance(scenario.get(name), dict)
        scenario[name] = {**scenario[name], **value} if is_changed else value
    return scenario


def written(folder: Path, table: dict[str, Any] | str, name: str = "yard") -> Path:
    file = folder / f"{name}.toml"
    file.write_text(table if isinstance(table, str) else as_toml(table), encoding="utf-8")
    return file


def faults_of(file: Path) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        load_scenario(file)
    assert all(fault.startswith(f"{file}: ") and fault.isprintable() for fault in caught.value.faults)
    return [fault.removeprefix(f"{file}: ") for fault in caught.value.faults]


@pytest.mark.parametrize(
    ("tables", "told"),
    [
        ({"sources": [{**GUN, "amplitude_range_db": 1e9}]}, "sources.0.amplitude_range_db: got 1000000000.0; input"),
        ({"receiver": {"band_hz": [1.5e9, 1.5000001e9]}}, "receiver.band_hz: got (1.5e+09, 1.5e+09); allowed is a ban"),
        ({"receiver": {"band_hz": [1e-320, 2.2e9]}}, "receiver.band_hz.0: got 1e-320; input should be greater than"),
        ({"receiver": {"band_hz": [1e6, 2.2e9]}}, "receiver.band_hz: got (1e+06, 2.2e+09); allowed is a band at least"),
        ({"receiver": {"band_hz": [1e9, 9.999e9]}}, "receiver.band_hz: got (1e+09, 9.999e+09); allowed is a band at l"),
        ({"yard": {"equipment": [{"name": "b", "kind": "busbar", "length_m": 1e9, "position_m": [10.0, 10.0]}]}},
         "yard.equipment.0.length_m: got 1000000000.0; input should be less than or equal to 200"),
        ({"carriers": [{"name": "c", "frequency_hz": 1e10, "amplitude_v": 0.05, "bearing_deg": 10.0}]},
         "carriers.0.frequency_hz: got 1e+10; allowed is below half of receiver.sample_rate_hz, 1e+10"),
        ({"receiver": {"false_alarm_rate_hz": 1e-300}}, "receiver.false_alarm_rate_hz: got 1e-300; input should be"),
        ({"sources": [{**GUN, "n_shots": 5, "first_shot_s": 1e300}]}, "sources.0.first_shot_s: got 1e+300; input"),
        ({"sources": [{**GUN, "n_shots": 5, "pulse_rate_hz": 1e-300}]}, "sources.0.pulse_rate_hz: got 1e-300; allowed"),
        ({"receiver": {"sample_rate_hz": 1e8, "band_hz": "all"}}, "receiver.sample_rate_hz: got 100000000.0; input"),
        ({"receiver": {"sample_rate_hz": 3e11}}, "receiver.gate_samples: got 90, which ends 2.3e-10 s after the trigg"),
        ({"receiver": {"gate_samples": 4000, "n_bands": 4}}, "receiver.gate_samples: got 4000 with n_bands 4; allowed"),
        ({"receiver": {"full_scale_v": 1e300}}, "receiver.full_scale_v: got 1e+300; input should be less than"),
        ({"array": {"gain_offset": 1e300}}, "array.gain_offset: got 1e+300; input should be less than or equal to 1"),
        ({"array": {"gain_error": 1e3}}, "array.gain_error: got 1000.0; input should be less than or equal to 1"),
        ({"array": {"pointing_error_deg": 1e300}}, "array.pointing_error_deg: got 1e+300; input should be less than"),
        ({"array": {"position_error_m": 1e9}}, "array.position_error_m: got 1000000000.0; input should be less"),
        ({"array": {"ring_radius_m": 1e9}}, "array.ring_radius_m: got 1000000000.0; input should be less than"),
        ({"receiver": {"mains_hz": 1e-12}}, "receiver.mains_hz: got 1e-12; input should be greater than or equal to 1"),
        ({"receiver": {"noise_v": 1e308}}, "receiver.noise_v: got 1e+308; input should be less than or equal to 1000"),
        ({"task": {"waypoint_radius_m": 1e6}}, "task.waypoint_radius_m: got 1000000.0; input should be less than"),
        ({"task": {"waypoint_radius_m": 16.0}}, "task.waypoint_radius_m: got 16; allowed is less than the shorter sid"),
        ({"task": {"standoff_m": 17.0}}, "task.standoff_m: got 17; allowed is less than the shorter side"),
        ({"name": "../../../evil"}, "name: got '../../../evil'; allowed is a letter or digit, and then letters"),
        ({"name": "/tmp/evil"}, "name: got '/tmp/evil'; allowed is a letter or digit"),
        ({"name": "a\x00b"}, "name: got 'a\\x00b'; allowed is a letter or digit"),
        ({"name": "a\nb"}, "name: got 'a\\nb'; allowed is a letter or digit"),
        ({"name": "[bold]x[/nope]"}, "name: got '[bold]x[/nope]'; allowed is a letter or digit"),
        ({"name": "x" * 300}, f"name: got '{'x' * 56}..., 300 letters; allowed are at most 64"),
        ({"sources": [{**GUN, "name": "x" * 65}]}, f"sources.0.name: got '{'x' * 56}..., 65 letters; allowed are at m"),
        ({"sources": [{**GUN, "name": "../gun"}]}, "sources.0.name: got '../gun'; allowed is a small letter, and then"),
        ({"sources": [{**GUN, "drift_db_per_min": 60.0}], "task": {"time_limit_s": 600.0}},
         "sources.0.drift_db_per_min: got 60, 600 dB within task.time_limit_s; allowed are 120 dB"),
        ({"sources": [{**GUN, "amplitude_v": 1e4}], "receiver": {"noise_v": 1e-9}, "interferers": [], "carriers": []},
         "sources.0.amplitude_v: up to 1.41e+04 with its range; allowed is 1 at most, 1e+09 times receiver.noise_v"),
        ({"sources": [ONE, {**ONE, "name": "two"}]}, "sources.1.sites: all of its 1 may be taken by sources before it"),
        ({"carriers": [{"name": "c", "amplitude_v": 5.0, "bearing_deg": 10.0}]}, "carriers: 5 V together; allowed are"),
        ({"sources": [{**GUN, "pulse_rate_hz": 1e4}], "task": {"time_limit_s": 86400.0}},
         "sources, interferers, receiver.false_alarm_rate_hz: 8.66e+08 pulses within task.time_limit_s, 86400; allowe"),
        ({"sources": [{**GUN, "pulse_rate_hz": 1e4}], "receiver": {"gate_samples": 10_000}},
         "sources, interferers, receiver.false_alarm_rate_hz: 10020.1 pulses a second of 10000 samples in 6 channels"),
        ({"sources": [{**GUN, "pulse_rate_hz": 1e4}], "receiver": {"longest_echo_s": 2e-6}},
         "sources, interferers, receiver.false_alarm_rate_hz: 10020.1 pulses a second at this sampling rate, band and"),
        ({"yard": {"equipment": [{**WALL, "position_m": [2.9, 8.0]}]}},
         "yard.equipment.0.position_m: `wall` at (2.9, 8.0) reaches 0.10 m beyond the fence; allowed is all of it in"),
        ({"map": {"extra": [{**WALL, "position_m": [17.5, 8.0]}]}}, "map.extra.0.position_m: `wall` at (17.5, 8.0) re"),
        ({"map": {"moved": [{"name": "tank", "by_m": [9.0, 0.0]}]}}, "map.moved.0.by_m: (9.0, 0.0) puts `tank` at (19"),
        ({"yard": {"equipment": [{**WALL, "position_m": [8000.0, 8.0]}]}},
         "yard.equipment.0.position_m.0: got 8000.0; input should be less than or equal to 200"),
        ({"yard": {"equipment": [{**WALL, "position_m": [10.0, 8.0], "sites": {"top": [0.0, 0.0, 18.0]}}]}},
         "yard.equipment.0.sites.top: (0, 0, 18) is 15.00 m above the top at height 18 m of 3 m; allowed is the surfa"),
        ({"yard": {"equipment": [3]}}, "yard.equipment.0: got 3; allowed is a table"),
        ({"yard": {"equipment": [{**WALL, "shape": "cone"}]}}, "yard.equipment.0: got shape 'cone'; allowed are box, "),
        ({"yard": {"equipment": [{**WALL, "position_m": [10.0, 8.0], "sites": {"box": [9.0, 9.0]}}]}},
         "yard.equipment.0.sites.box.2: missing; it is required"),
        ({"receiver": {"band_hz": "some"}}, "receiver.band_hz: got 'some'; input should be 'all'"),
        ({"receiver": {"band_hz": 3}}, "receiver.band_hz: got 3; allowed is an array in [ ]"),
        ({"receiver": {"bits": 12.5}}, "receiver.bits: got 12.5; allowed is a whole number"),
        ({"array": {"pattern": "a\x00b"}}, "array.pattern: got '"),
        ({"robot": {"model": "a\nb.xml"}}, "robot.model: got 'a\\nb.xml'; allowed is a name or path on one line"),
        ({"sources": [{**GUN, "position_m": [[1] * 900, 2.0, 2.0]}]}, "sources.0.position_m.0: got (1, 1, 1, 1, 1, 1,"),
        ({"battery": {"idle_w": -(10**400)}}, "battery.idle_w: got -1000000000000000000000000000000000000000000000000"),
        ({"sources": [GUN] * 65}, "sources: got too many; allowed are at most 64"),
        ({"a\nb": 1}, "a\\nb: unknown key; allowed are yard, map, route"),
    ],
    ids=lambda value: value.partition(":")[0] if isinstance(value, str) else "",
)  # fmt: skip
def test_what_cannot_be_is_one_clear_line(tables: dict[str, Any], told: str, tmp_path: Path) -> None:
    (fault,) = faults_of(written(tmp_path, small(**tables)))
    assert fault.startswith(told)
    assert len(fault) < 300


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (f"x = {'7' * 5000}", "not TOML: a whole number has thousands of digits"),
        ("x = " + "[" * 100_000, "not TOML: tables or arrays are nested too deeply"),
        ("# " + "x" * 4_100_000, "has 4.1 MB; allowed are up to 4 MB; give a scenario, which is a TOML text file"),
        ('x = "a\x01"', "not TOML: Illegal character"),
    ],
)
def test_what_is_no_toml_is_one_clear_line(text: str, told: str, tmp_path: Path) -> None:
    (fault,) = faults_of(written(tmp_path, text))
    assert fault.startswith(told)


def test_a_byte_order_mark_is_no_fault(tmp_path: Path) -> None:
    assert load_scenario(written(tmp_path, "\ufeff" + as_toml(SMALL))).sources


@pytest.mark.parametrize("stem", ["my yard", "-yard", "[red]yard", "y" * 65, "Anlage_Süd"])
def test_a_file_whose_name_names_no_scenario_says_so_and_runs_with_a_name(stem: str, tmp_path: Path) -> None:
    (fault,) = faults_of(written(tmp_path, SMALL, stem))
    assert fault.startswith("name: none given, and the name of the file, '")
    assert load_scenario(written(tmp_path, small(name="other"), stem)).name == "other"


def test_a_file_with_a_thousand_faults_tells_the_first_and_how_many_more(tmp_path: Path) -> None:
    table = small(route={"waypoints_m": [["x", "y"]] * 500})
    *faults, last = faults_of(written(tmp_path, table))
    assert len(faults) == MOST_FAULTS
    assert last == "950 more faults"


def test_minus_zero_is_zero(tmp_path: Path) -> None:
    tables = small(array={"gain_error": -0.0, "position_error_m": -0.0}, pose_sensor={"position_std_m": -0.0})
    scenario = load_scenario(written(tmp_path, tables))
    for value in (scenario.array.gain_error, scenario.array.position_error_m, scenario.pose_sensor.position_std_m):
        assert np.copysign(1.0, value) == 1.0
    PatrolEnv(scenario).reset(seed=0)


def test_a_yard_of_two_hundred_transformers_has_the_same_distances_tile_by_tile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = [(10.0 + 9.0 * (k % 15), 20.0 + 9.0 * (k // 15)) for k in range(200)]
    pieces = [{"name": f"e{k}", "kind": "power_transformer", "position_m": [*place]} for k, place in enumerate(rows)]
    tables = {**small(yard={"size_m": [150.0, 150.0], "equipment": pieces}, sources=[]), "map": {}, "interferers": []}
    yard = load_scenario(written(tmp_path, tables)).yard
    points_m = np.random.default_rng(0).uniform(-5.0, 155.0, (2000, 2))
    monkeypatch.setattr("pdpatrol.robot_models.yard.yard.FEW_DISTANCES", 10**9)
    at_once_m = yard.clearance(points_m)
    monkeypatch.setattr("pdpatrol.robot_models.yard.yard.FEW_DISTANCES", 0)
    assert (yard.clearance(points_m) == at_once_m).all()
    assert (yard.clearance(points_m.reshape(20, 100, 2)) == at_once_m.reshape(20, 100)).all()


def unbounded(schema: dict[str, Any], path: str = "") -> list[str]:
    """Places of a schema with numbers without both bounds, or texts, arrays or tables of any length."""
    kind, found = schema.get("type"), list[str]()
    is_word = "const" in schema or "enum" in schema
    wanted = {
        "number": ("minimum", "maximum"), "integer": ("minimum", "maximum"), "array": ("maxItems",),
        "string": () if is_word else ("maxLength", "pattern"),
        "object": ("maxProperties",) if isinstance(schema.get("additionalProperties"), dict) else (),
    }.get(str(kind), ())  # fmt: skip
    found += [f"{path}: no {key}" for key in wanted if key not in schema]
    for key, inner in schema.items():
        inners = inner if isinstance(inner, list) else [inner]
        for number, each in enumerate(inners):
            if isinstance(each, dict):
                found += unbounded(each, f"{path}/{key}{number or ''}")
    return found


def test_every_number_has_two_bounds_and_everything_else_a_greatest_length() -> None:
    assert unbounded(SCHEMA) == []
    assert unbounded({"type": "number", "minimum": 0.0}) == [": no maximum"]


@pytest.mark.parametrize(
    ("tables", "told"),
    [
        ({"route": {"dock_yaw_deg": 1.5708}}, "route.dock_yaw_deg: 1.5708 degrees look like radians, which would be 9"),
        ({"array": {"gain_error": 0.8}}, "array: with gain_error 0.8, pointing_error_deg 2 and gain_offset 0 bearings"),
        ({"array": {"pointing_error_deg": 40.0}}, "array: with gain_error 0.05, pointing_error_deg 40 and gain_offset"),
        ({"sources": [{**GUN, "amplitude_v": 1e-4}]}, "sources.0: `gun` is heard from nowhere: at "),
        ({"sources": [{**GUN, "pulse_rate_hz": 0.0}]}, "sources.0: `gun` does not discharge within the mission"),
        ({"sources": [{**GUN, "active_s": [30.0, 60.0]}]}, "sources.0: `gun` does not discharge within the mission"),
        ({"sources": [{**GUN, "n_shots": 3, "first_shot_s": 30.0}]}, "sources.0: `gun` does not discharge within"),
        ({"receiver": {"full_scale_v": 1e-3}}, "receiver.full_scale_v: 0.001 V are below the trigger level"),
    ],
)  # fmt: skip
def test_what_is_hardly_meant_is_one_note(tables: dict[str, Any], told: str, tmp_path: Path) -> None:
    (note,) = plausibility(load_scenario(written(tmp_path, small(**tables))))
    assert note.startswith(told)
    assert note.isprintable()


def test_what_is_shipped_is_meant() -> None:
    """Of the suite every ninth yard, so that it takes seconds."""
    names = [*shipped_scenarios(), *(each.name for each in suite_yards()[::9])]
    assert {name: notes for name in names if (notes := plausibility(load_scenario(name)))} == {}
