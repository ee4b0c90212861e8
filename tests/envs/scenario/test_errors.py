"""Error messages for scenario files, one line each with file, key, the condition and the given value; and notes."""

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.envs.plausibility import plausibility
from pdpatrol.envs.scenario import ScenarioError, load_scenario, shipped_scenarios
from pdpatrol.envs.scenario.base import MAX_ERRORS_SHOWN
from pdpatrol.envs.scenario.suite import load_suite
from tests.envs.scenario.drawn_scenarios import SMALL, as_toml

SHORT = {
    "GUN": 'name = "gun", position_m = [16.0, 12.0, 2.0]',
    "ONE": 'name = "one", sites = ["tank/south"]',
    "BOX": 'shape = "box", footprint_m = [1.0, 1.0], height_m = 3.0, position_m = [15.0, 3.0]',
    "CARRIER": 'name = "c", amplitude_v = 0.05, bearing_deg = 10.0',
    "TRAM": 'name = "tram", position_m = [-5.0, 5.0, 1.0], amplitude_v = 1.0',
}


def merged(table: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """Return a table with the values of some keys, also of nested tables, replaced."""
    changed = {k: merged(table.get(k, {}), value) if isinstance(value, dict) else value for k, value in changes.items()}
    return {**table, **changed}


def small(toml: str) -> dict[str, Any]:
    """Return the small scenario with the keys of a text, in which names of `SHORT` stand for several keys."""
    for name, keys in SHORT.items():
        toml = toml.replace(name, keys)
    return merged(SMALL, tomllib.loads(toml))


def written(folder: Path, table: dict[str, Any] | str | bytes, name: str = "yard") -> Path:
    file = folder / f"{name}.toml"
    text = as_toml(table) if isinstance(table, dict) else table
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return file


def errors_of(file: Path) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        load_scenario(file)
    assert all(line.startswith(f"{file}: ") and line.isprintable() for line in caught.value.faults)
    return [line.removeprefix(f"{file}: ") for line in caught.value.faults]


CASES = [
    # single values
    ("receiver.noise_v = -0.001", "receiver.noise_v: must be greater than or equal to 0.000000001, got -0.001"),
    ("receiver.noise_v = true", "receiver.noise_v: must be a valid number, got True"),
    ("receiver.noise_v = nan", "receiver.noise_v: must be a finite number, got nan"),
    ("receiver.band_hz = 3", "receiver.band_hz: must be an array, got 3"),
    ('robot.model = "a\\nb.xml"', "robot.model: must match pattern '^[^\\x00-\\x1f\\x7f]*$', got '"),
    ("yard.size_m = [20.0]", "yard.size_m.1: is required"),
    (
        f"battery.idle_w = -1{'0' * 400}",
        "battery.idle_w: must be a valid number, got -10000000000000000000000000000000000000000000000000",
    ),
    (
        'sources = [{GUN, kind = "sparks"}]',
        "sources \"gun\".kind: must be 'corona', 'void', 'surface' or 'floating', got 'sparks'",
    ),
    (
        f"sources = [{'{GUN}, ' * 65}]",
        "sources: must have at most 64 items, got ({'name': 'gun', 'position_m': (16.0, 12.0, 2.0)}, {'n",
    ),
    ("yard.equipment = [3]", "yard.equipment.0: must be a table, got 3"),
    (
        'yard.equipment = [{name = "wall", kind = "wall", shape = "cone", height_m = 3.0}]',
        "yard.equipment \"wall\": must have the shape 'box', 'cylinder', 'catalogue', got 'cone'",
    ),
    ("receiver.nois_v = 0.001", "receiver.nois_v: unknown key; did you mean `noise_v`?"),
    ('"a\\nb" = 1', "a\\nb: unknown key"),
    ('name = "../../../evil"', "name: must match pattern '^[A-Za-z0-9][A-Za-z0-9_.-]*$', got '../../../evil'"),
    (
        'estimator.method = "mine"',
        "estimator.method: no estimator `mine`; available: maximum_likelihood, sub_bands, music, stronges",
    ),
    ('campaign.date = "2026-02-30"', "campaign.date: day "),
    # tables
    ('campaign.date = "2026-01-04"', "campaign.date: must not be before begins, 2026-01-05, got 2026-01-04"),
    ('sources = [{name = "pd"}]', 'sources "pd".sites, position_m, anywhere_at_m: exactly one must be given, got none'),
    ("sources = [{GUN, active_s = [9.0, 3.0]}]", 'sources "gun".active_s: must start before it ends, got (9.0, 3.0)'),
    (
        'sources = [{GUN, kind = "void", n_shots = 5}]',
        'sources "gun".kind, n_shots: must not be given together; a gun ignores the phase of the mains',
    ),
    (
        "sources = [{GUN, n_shots = 5, pulse_rate_hz = 0.0}]",
        'sources "gun".pulse_rate_hz: must be at least 0.0001 for a gun, got 0',
    ),
    (
        "sources = [{GUN, polarisation = [0.0, 0.0, 0.0]}]",
        'sources "gun".polarisation: must not be the zero vector, got (0.0, 0.0, 0.0)',
    ),
    (
        "receiver.band_hz = [1500000000.0, 1500000100.0]",
        "receiver.band_hz: must be a rising band between 0 and half of sample_rate_hz (1e+10), at least 2e+07",
    ),
    ("receiver.gate_samples = 10", "receiver.pretrigger_samples: must be less than gate_samples 10, got 20"),
    (
        'nature.receiver.faults = [{channel = 1, kind = "gain_drift"}]',
        "nature.receiver.faults.0.gain_db: must be given for kind gain_drift",
    ),
    (
        "interferers = [{TRAM, path_m = [[-5.0, 25.0, 1.0]]}]",
        'interferers "tram".path_m, speed_mps: must be given together',
    ),
    (
        "interferers = [{TRAM, path_m = [[-5.0, 9.0, 1.0], [-5.0, 9.0, 1.0]], speed_mps = 9.0}]",
        'interferers "tram".path_m: each point must differ from the one before, got (-5.0, 9.0, 1.0) twice',
    ),
    (
        "sources = [{GUN, changes = [{at_s = 9.0}, {at_s = 9.0}]}]",
        'sources "gun".changes: at_s must increase, 9 is followed by 9',
    ),
    (
        "sources = [{GUN, n_shots = 5, changes = [{at_s = 9.0}]}]",
        'sources "gun".changes, n_shots: must not be given together; a gun does not change',
    ),
    # places
    (
        "route.dock_m = [4.9, 11.0]",
        "route.dock_m: must lie in the yard, 0.25 m or more from any obstacle, so that the robot fits, got",
    ),
    (
        "route.waypoints_m = [[25.0, 8.5]]",
        "route.waypoints_m.0: must lie in the yard, 0.25 m or more from any obstacle, so that the robot",
    ),
    (
        'map.moved = [{name = "tank", by_m = [-6.0, -6.0]}]',
        "route.dock_m: must lie in the yard, 0.25 m or more from any obstacle, so that the robot fits, got",
    ),
    ('map.missing = ["tnk"]', "map.missing.0: no equipment `tnk` in this yard; available: tank"),
    (
        'map.moved = [{name = "tank", by_m = [9.0, 0.0]}]',
        "map: equipment.0.position_m: all of `tank` must lie in (0, 0) to (20.0, 16.0); at (19.0, 9.0) i",
    ),
    (
        'map.extra = [{name = "tank", kind = "wall", BOX}]',
        "map: equipment.2.name: must be unique, got `tank` again",
    ),
    (
        'map.extra = [{name = "hut", kind = "kiosk", BOX}]',
        'map.extra "hut".kind: no kind `kiosk`; available: building, busbar, bushing, cabinet, cable_sealing_end',
    ),
    (
        'sources = [{name = "one", sites = ["tank/sout"]}]',
        'sources "one".sites: no site `tank/sout`; available: tank/south',
    ),
    (
        'sources = [{name = "gun", position_m = [10.0, 9.0, 1.0]}]',
        'sources "gun".position_m: must lie in the yard, above the ground and outside equipment, got [10.0, 9',
    ),
    (
        'sources = [{name = "gun", position_m = [30.0, 9.0, 1.0]}]',
        'sources "gun".position_m: must lie in the yard, above the ground and outside equipment, got [30.0, 9',
    ),
    (
        'sources = [{name = "gun", position_m = [3.0, 9.0, -1.0]}]',
        'sources "gun".position_m: must lie in the yard, above the ground and outside equipment, got [3.0, 9.',
    ),
    ("sources = [{GUN}, {GUN}]", "sources.1.name: must be used once, got `gun` again"),
    (
        'interferers = [{name = "gun", position_m = [-5.0, 5.0, 1.0], amplitude_v = 1.0}]',
        'interferers "gun".name: must be used once, got `gun` again',
    ),
    (
        'interferers = [{name = "tram", position_m = [10.0, 9.0, 1.0], amplitude_v = 1.0}]',
        'interferers "tram".position_m: must lie outside equipment, got (10.0, 9.0, 1.0) inside `tank`',
    ),
    (
        "interferers = [{TRAM, path_m = [[-5.0, 9.0, 1.0], [15.0, 9.0, 1.0]], speed_mps = 9.0}]",
        'interferers "tram".path_m: must not cross equipment, got (15.0, 9.0, 1.0), reached through `tank`',
    ),
    # combinations
    (
        'nature.receiver.faults = [{channel = 7, kind = "dead"}]',
        "nature.receiver.faults.0.channel: must be a channel from 1 to 6, got 7",
    ),
    (
        'nature.receiver.faults = [{channel = 2, kind = "intermittent", gain_db = -20.0, bad_s = 1.0}]',
        "nature.receiver.faults.0.good_s: must be given for kind intermittent",
    ),
    (
        "nature.receiver.temperature_drift_db_per_min = 15.0\ntask.time_limit_s = 600.0",
        "nature.receiver.temperature_drift_db_per_min: must be at most 40 dB within task.time_limit_s, got 150",
    ),
    (
        "nature.pose_sensor.jumps_per_min = 1.0",
        "nature.pose_sensor.jumps_per_min, jump_std_m or jump_std_deg: must be given together",
    ),
    (
        "nature.array.mount_tilt_deg = 30.0\narray.ring_radius_m = 1.5",
        "nature.array.mount_tilt_deg: must keep all elements above the ground, got 30, lowest element at",
    ),
    ('estimator.method = "sub_bands"', "estimator.method: sub_bands needs receiver.n_bands from 1 to 8, got 0"),
    ("robot.max_speed_mps = 3.0", "robot.max_speed_mps: must be at most the limit of the robot, 0.8, got 3"),
    (
        "carriers = [{CARRIER, frequency_hz = 1e10}]",
        'carriers "c".frequency_hz: must be below half of receiver.sample_rate_hz, 1e+10, got 1e+10',
    ),
    (
        'carriers = [{name = "c", amplitude_v = 5.0, bearing_deg = 10.0}]',
        "carriers: must be at most 2.83 V together, 10000 times the noise behind the band-pass, got 5",
    ),
    (
        "sources = [{GUN, drift_db_per_min = 60.0}]\ntask.time_limit_s = 600.0",
        'sources "gun".drift_db_per_min: must be at most 120 dB within task.time_limit_s, got 600',
    ),
    (
        "sources = [{GUN, amplitude_v = 1e4}]\nreceiver.noise_v = 1e-09\ninterferers = []\ncarriers = []",
        'sources "gun".amplitude_v: must be at most 1 V with its range, 1e+09 times the noise, got 1.41e+04',
    ),
    (
        'sources = [{ONE}, {name = "two", sites = ["tank/south"]}]',
        'sources "two".sites: must be more than the earlier sources on these sites, got 1',
    ),
    (
        "sources = [{GUN, pulse_rate_hz = 1e4}]\ntask.time_limit_s = 86400.0",
        "sources, interferers, receiver.false_alarm_rate_hz: must be at most 5e+06 pulses within task.",
    ),
    (
        "sources = [{GUN, pulse_rate_hz = 1e4}]\nreceiver.longest_echo_s = 2e-06",
        "sources, interferers, receiver.false_alarm_rate_hz: must be at most 3e+08 computed samples",
    ),
    (
        'sources = [{GUN, growth_db_per_week = 3.0}]\ncampaign.date = "2027-01-04"',
        'sources "gun".growth_db_per_week: must be at most 120 dB on 2027-01-04, got 156',
    ),
    (
        'sources = [{GUN, rate_growth_per_week = 9.0}]\ncampaign.date = "2026-01-26"',
        'sources "gun".rate_growth_per_week: must be at most 1e+04 pulses per second on',
    ),
]


@pytest.mark.parametrize(("settings", "line"), CASES)
def test_error_is_one_clear_line(settings: str, line: str, tmp_path: Path) -> None:
    (error,) = errors_of(written(tmp_path, small(settings)))
    assert error.replace(str(tmp_path), "").startswith(line)
    assert len(error) < 500


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("yard = [", "is not valid TOML: Invalid value"),
        (f"x = {'7' * 5000}", "is not valid TOML: Exceeds the limit"),
        ("x = " + "[" * 100_000, "is not valid TOML: "),
        ('x = "a\x01"', "is not valid TOML: Illegal character"),
        ("# " + "x" * 4_100_000, "must have at most 4 MB, has 4.1 MB"),
        (b"\xff\xfe\x00yard", "is not valid TOML: 'utf-8' codec can't decode byte"),
    ],
)
def test_invalid_toml_is_one_clear_line(text: str | bytes, line: str, tmp_path: Path) -> None:
    (error,) = errors_of(written(tmp_path, text))
    assert error.startswith(line)


def test_all_errors_are_listed_up_to_a_limit(tmp_path: Path) -> None:
    assert {"yard: is required", "route: is required", "array: is required"} == set(errors_of(written(tmp_path, "")))
    *errors, last = errors_of(written(tmp_path, small(f"route.waypoints_m = [{'[true, true], ' * 500}]")))
    assert len(errors) == MAX_ERRORS_SHOWN
    assert last == "950 more errors"


def test_missing_file_folder_and_unknown_name_are_refused(tmp_path: Path) -> None:
    for path in (tmp_path / "none.toml", tmp_path):
        with pytest.raises(ScenarioError, match="cannot be read"):
            load_scenario(path)
    with pytest.raises(ScenarioError, match=r"available: .*one_source"):
        load_scenario("nowhere")


@pytest.mark.parametrize(
    ("wrong", "name"),
    [
        *((name[:-3] + name[-2:], name) for name in shipped_scenarios()),
        *((f"suite/{level[1:]}", f"suite/{level}") for level in load_suite().levels),
        ("suite/weakk_03", "suite/weak_03"),
    ],
)
def test_mistyped_scenario_gets_the_name_that_was_meant(wrong: str, name: str) -> None:
    with pytest.raises(ScenarioError, match=f"^{wrong}: no such .*; did you mean {name}[?]$"):
        load_scenario(wrong)


@pytest.mark.parametrize(
    ("settings", "key"),
    [
        ("yard.equipment = [3]", "yard.equipment.0"),
        ('yard.equipment = [{name = "T 1", kind = "fence", shape = "box"}]', "yard.equipment.0.name"),
        ('yard.equipment = [{name = "one"}, {name = "t1"}]', 'yard.equipment "t1".kind'),
        ('yard.equipment = [{name = "t1"}, {name = "t1"}]', "yard.equipment.1.kind"),
        ("route.waypoints_m = [[1.0, true]]", "route.waypoints_m.0.1"),
    ],
)
def test_errors_call_items_by_unique_names(settings: str, key: str, tmp_path: Path) -> None:
    assert key in {error.partition(":")[0] for error in errors_of(written(tmp_path, small(settings)))}


@pytest.mark.parametrize("stem", ["my yard", "-yard", "[red]yard", "y" * 65, "Anlage_Süd"])
def test_file_name_unfit_for_a_scenario_needs_a_name(stem: str, tmp_path: Path) -> None:
    (error,) = errors_of(written(tmp_path, SMALL, stem))
    assert error.startswith("name: must ")
    assert load_scenario(written(tmp_path, small('name = "other"'), stem)).name == "other"


def test_byte_order_mark_is_skipped(tmp_path: Path) -> None:
    assert load_scenario(written(tmp_path, "\ufeff" + as_toml(SMALL))).sources


def test_minus_zero_is_zero(tmp_path: Path) -> None:
    scenario = load_scenario(written(tmp_path, small("array.gain_error = -0.0\npose_sensor.position_std_m = -0.0")))
    for value in (scenario.array.gain_error, scenario.pose_sensor.position_std_m):
        assert np.copysign(1.0, value) == 1.0
    PatrolEnv(scenario).reset(seed=0)


@pytest.mark.parametrize(
    ("settings", "line"),
    [
        ("sources = [{GUN, amplitude_v = 1e-4}]", 'sources "gun": cannot be detected: below it'),
        ("sources = [{GUN, pulse_rate_hz = 0.0}]", 'sources "gun": does not discharge within the mission'),
        ("sources = [{GUN, active_s = [30.0, 60.0]}]", 'sources "gun": does not discharge within the mission'),
        ("sources = [{GUN, n_shots = 3, first_shot_s = 30.0}]", 'sources "gun": does not discharge within'),
        ("receiver.full_scale_v = 1e-3", "receiver.full_scale_v: 0.001 V is below the trigger level"),
    ],
)
def test_implausible_setting_is_one_note(settings: str, line: str, tmp_path: Path) -> None:
    (note,) = plausibility(load_scenario(written(tmp_path, small(settings))))
    assert note.startswith(line)
    assert note.isprintable()


def test_shipped_scenarios_are_plausible() -> None:
    """Every ninth yard of the suite, to save time."""
    names = [*shipped_scenarios(), *(each.name for each in load_suite().yards[::9])]
    assert {name: notes for name in names if (notes := list(plausibility(load_scenario(name))))} == {}
