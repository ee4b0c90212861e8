"""Scenario files: shipped ones hold what they promise, wrong ones are named fault by fault."""

from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pdpatrol.envs import Scenario, ScenarioError, load_scenario, shipped_scenarios
from pdpatrol.envs.scenario import SHIPPED
from pdpatrol.missions.driving.site_map import CELL_M, SiteMap
from tests.sensing.radio.crossing import cross, solids_of

GOOD = """
[yard]
size_m = [20.0, 15.0]
[[yard.equipment]]
name = "tank"
kind = "power_transformer"
shape = "box"
position_m = [10.0, 8.0]
footprint_m = [4.0, 2.0]
height_m = 3.0
sites = { south = [0.0, -1.0, 1.5] }
[[yard.equipment]]
name = "post"
kind = "bushing"
shape = "cylinder"
position_m = [4.0, 11.0]
radius_m = 0.5
height_m = 2.0
[route]
dock_m = [2.0, 2.0]
waypoints_m = [[15.0, 3.0], [15.0, 12.0]]
[array]
gain_error = 0.05
[receiver]
noise_v = 1e-3
[[sources]]
name = "pd"
sites = ["tank/south"]
"""


def map_of(extra: tuple[str, str, float, float] | None = None, moved: tuple[str, float, float] | None = None) -> str:
    """The table [map] with one wrong piece, before the table [route]."""
    lines = list[str]()
    if extra is not None:
        name, kind, x, y = extra
        lines += [
            "[[map.extra]]", f'name = "{name}"', f'kind = "{kind}"', 'shape = "box"', f"position_m = [{x}, {y}]",
            "footprint_m = [1.0, 1.0]", "height_m = 2.0",
        ]  # fmt: skip
    if moved is not None:
        name, x, y = moved
        lines += ["[[map.moved]]", f'name = "{name}"', f"by_m = [{x}, {y}]"]
    return "\n".join([*lines, "[route]"])


def fault_of(tmp_path: Path, text: str | bytes) -> tuple[str, ...]:
    file = tmp_path / "yard.toml"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ScenarioError) as caught:
        load_scenario(file)
    assert all(line.startswith(f"{file}: ") and "\n" not in line for line in caught.value.faults)
    return caught.value.faults


@pytest.mark.parametrize("name", shipped_scenarios())
def test_every_shipped_scenario_loads_tells_its_story_first_and_has_an_imperfect_array(name: str) -> None:
    text = (SHIPPED / f"{name}.toml").read_text(encoding="utf-8")
    assert text.startswith("# ")
    scenario = load_scenario(name)
    assert scenario.name == name
    array = scenario.array
    errors = (array.gain_error, array.pointing_error_deg, array.gain_offset)
    assert errors == ((0.0, 0.0, 0.06) if name == "paper_field" else (0.05, 2.0, 0.0))
    assert scenario.array.position_error_m == 0.002
    assert all(key in text for key in ("gain_error", "pointing_error_deg"))


@pytest.mark.parametrize("name", shipped_scenarios())
def test_each_candidate_site_is_in_sight_over_sixty_degrees_of_reachable_ground_close_by(name: str) -> None:
    scenario = load_scenario(name)
    solids, n_pieces = solids_of(scenario.yard), len(scenario.yard.equipment)
    site_map = SiteMap(scenario)
    reach = site_map.reach(np.asarray(scenario.route.dock_m))
    for site in scenario.yard.site_names():
        source = scenario.yard.site_position(site)
        away = site_map.centres_m - source[:2]
        near = np.isfinite(reach.length_m) & (np.linalg.norm(away, axis=-1) < 3.5)
        antennas = np.column_stack([site_map.centres_m[near], np.full(near.sum(), 0.6)])
        seen = ~cross(np.tile(source, (len(antennas), 1)), antennas, solids, n_pieces).any(axis=-1)
        aspects = np.degrees(np.arctan2(away[near][seen][:, 1], away[near][seen][:, 0]))
        assert np.unique(aspects // 10).size >= 7, f"{site}: seen over {np.unique(aspects // 10).size * 10} degrees"


def test_the_default_scenario_is_hard_enough_to_mean_something() -> None:
    scenario = load_scenario("one_source")
    sites = scenario.candidate_sites(scenario.sources[0])
    positions = np.array([scenario.yard.site_position(site) for site in sites])
    waypoints = np.asarray(scenario.route.waypoints_m)
    apart = np.linalg.norm(positions[:, np.newaxis, :2] - waypoints, axis=-1).min(axis=-1)
    solids, n_pieces = solids_of(scenario.yard), len(scenario.yard.equipment)
    at_dock = np.array([[*scenario.route.dock_m, scenario.array.height_m]])
    hidden = [bool(cross(position[np.newaxis], at_dock, solids, n_pieces).any()) for position in positions]
    assert len(sites) >= 8
    assert (apart > 3.0).sum() >= 2
    assert sum(hidden) >= 2


@pytest.mark.parametrize("name", shipped_scenarios())
def test_dock_and_every_stop_of_a_shipped_route_are_where_the_robot_gets_to(name: str) -> None:
    scenario = load_scenario(name)
    site_map = SiteMap(scenario)
    reach = site_map.reach(np.asarray(scenario.route.dock_m))
    stops = np.array([scenario.route.dock_m, *scenario.route.waypoints_m])
    cells = [site_map.cell(stop) for stop in stops]
    assert np.isfinite(reach.length_m[cells]).all()
    assert (np.linalg.norm(site_map.centres_m[cells] - stops, axis=-1) < CELL_M).all()


def test_the_quiet_yard_has_its_interferer_thirty_metres_beyond_the_fence() -> None:
    scenario = load_scenario("quiet_yard")
    (interferer,) = scenario.interferers
    assert scenario.sources == ()
    assert interferer.position_m[0] - scenario.yard.size_m[0] == pytest.approx(30.0)


def test_a_good_file_loads(tmp_path: Path) -> None:
    (tmp_path / "yard.toml").write_text(GOOD, encoding="utf-8")
    assert isinstance(load_scenario(tmp_path / "yard.toml"), Scenario)


@pytest.mark.parametrize(
    ("old", "new", "key", "words"),
    [
        ("noise_v = 1e-3", "noise_v = -1e-3", "receiver.noise_v", "greater than 0"),
        ("noise_v = 1e-3", 'noise_v = "loud"', "receiver.noise_v", "'loud'"),
        ("noise_v = 1e-3", "noise_v = true", "receiver.noise_v", "True"),
        ("noise_v = 1e-3", "noise_v = nan", "receiver.noise_v", "finite"),
        ("noise_v = 1e-3", "nois_v = 1e-3", "receiver.nois_v", "unknown key; allowed are sample_rate_hz"),
        ("size_m = [20.0, 15.0]", "size_m = [inf, 15.0]", "yard.size_m.0", "finite"),
        ("noise_v = 1e-3", "gate_samples = 10", "receiver.pretrigger_samples", "less than gate_samples"),
        ("noise_v = 1e-3", "gate_samples = 1000000000", "receiver.gate_samples", "10000"),
        ("noise_v = 1e-3", "false_alarm_rate_hz = 0.0", "receiver.false_alarm_rate_hz", "greater than 0"),
        ("size_m = [20.0, 15.0]", "size_m = [1e9, 15.0]", "yard.size_m.0", "200"),
        ("size_m = [20.0, 15.0]", "size_m = [20.0]", "yard.size_m.1", "missing"),
        ("gain_error = 0.05", "gain_error = nan", "array.gain_error", "finite"),
        ("[[15.0, 3.0], ", "[[nan, 3.0], ", "route.waypoints_m.0.0", "finite"),
        ("[[15.0, 3.0], ", "[[10.0, 8.5], ", "route.waypoints_m.0", "inside equipment `tank`"),
        ("[[15.0, 3.0], ", "[[25.0, 8.5], ", "route.waypoints_m.0", "outside the yard"),
        ("[[15.0, 3.0], ", "[[12.1, 8.5], ", "route.waypoints_m.0", "does not fit"),
        ("dock_m = [2.0, 2.0]", "dock_m = [4.0, 11.2]", "route.dock_m", "inside equipment `post`"),
        ('["tank/south"]', '["tank/sout"]', "sources.0.sites", "allowed are tank/south"),
        ('["tank/south"]', '["pump/*"]', "sources.0.sites", "no site `pump/*`"),
        ('sites = ["tank/south"]', "position_m = [10.0, 8.0, 1.0]", "sources.0.position_m", "enclosed by equipment"),
        ('sites = ["tank/south"]', "position_m = [30.0, 8.0, 1.0]", "sources.0.position_m", "outside the yard"),
        ('sites = ["tank/south"]', "position_m = [3.0, 8.0, -1.0]", "sources.0.position_m", "below ground"),
        ('sites = ["tank/south"]', "pulse_rate_hz = 3.0", "sources.0.sites, position_m, anywhere_at_m", "none of them"),
        ('name = "pd"', 'name = "pd"\nkind = "sparks"', "sources.0.kind", "'corona'"),
        ('name = "pd"', 'name = "pd"\nactive_s = [9.0, 3.0]', "sources.0.active_s", "start before"),
        ('name = "pd"', 'name = "pd"\nkind = "void"\nn_shots = 5', "sources.0.kind, n_shots", "allowed is one"),
        ('name = "pd"', 'name = "pd"\nn_shots = 5\npulse_rate_hz = 0.0', "sources.0.pulse_rate_hz", "above 0"),
        ("noise_v = 1e-3", "bits = -3", "receiver.bits", "greater than"),
        ("noise_v = 1e-3", "band_hz = [1.4e9, 2.2e10]", "receiver.band_hz", "below half of sample_rate_hz, 1e+10"),
        ("noise_v = 1e-3", "n_bands = 4\nband_hz = \"all\"", "receiver.n_bands", "or a band that they divide"),
        ("noise_v = 1e-3", "n_bands = 9", "receiver.n_bands", "less than or equal to 8"),
        ("noise_v = 1e-3", "sample_rate_hz = 4e9", "receiver.band_hz", "below half of sample_rate_hz, 2e+09"),
        ("noise_v = 1e-3", "band_hz = [2.2e9, 1.4e9]", "receiver.band_hz", "rises"),
        ("noise_v = 1e-3", 'faults = [{ channel = 7, kind = "dead" }]', "receiver.faults.0.channel", "7"),
        ("noise_v = 1e-3", 'faults = [{ channel = 1, kind = "gain_drift" }]', "receiver.faults.0.gain_db", "needs it"),
        ("noise_v = 1e-3", 'faults = [{ channel = 1, kind = "tired" }]', "receiver.faults.0.kind", "dead"),
        ('kind = "bushing"', 'kind = "pump"', "yard.equipment.1.kind", "bushing, cabinet"),
        ("noise_v = 1e-3", "full_scale_v = 0.0", "receiver.full_scale_v", "greater than 0"),
        ("[route]", "[route]\ndock_yaw_deg = 999.0", "route.dock_yaw_deg", "360"),
        ("[0.0, -1.0, 1.5]", "[0.0, 0.0, 1.5]", "yard.equipment.0.sites.south", "1.00 m inside"),
        ("[4.0, 11.0]", "[10.0, 6.8]", "sources.0.sites (tank/south)", "enclosed by equipment `post`"),
        ('"post"', '"tank"', "yard.equipment.1.name", "taken"),
        ('"cylinder"', '"cone"', "yard.equipment.1", "cone"),
        ("radius_m = 0.5", "radius_m = 0.5\ncolour = 3", "yard.equipment.1.colour", "radius_m"),
        ("radius_m = 0.5", "", "yard.equipment.1.radius_m", "missing"),
        ('name = "pd"', "", "sources.0.name", "missing"),
        ('name = "pd"', 'name = "P D"', "sources.0.name", "P D"),
        ("[receiver]", "[reciever]", "reciever", "unknown key; allowed are yard, map, route"),
        ("[route]", '[map]\nmissing = ["tnk"]\n[route]', "map.missing.0", "no equipment `tnk` in this yard"),
        ("[route]", '[map]\nmising = ["tank"]\n[route]', "map.mising", "allowed are missing, extra, moved"),
        ("[route]", map_of(moved=("pump", 1, 0)), "map.moved.0.name", "no equipment `pump` in this yard; allowed are"),
        ("[route]", map_of(moved=("post", 0, 5)), "map.moved.0.by_m", "at (4.0, 16.0), outside the yard"),
        ("[route]", '[map]\nmissing = ["post"]\n' + map_of(moved=("post", 1, 0)), "map.moved.0.name", "missing too"),
        ("[route]", map_of(moved=("post", -2, -9)), "route.dock_m", "inside equipment `post` on the map"),
        ("[route]", map_of(moved=("post", 11, -7.3)), "route.waypoints_m.0", "from equipment or fence on the map"),
        ("[route]", map_of(extra=("tank", "cabinet", 8, 3)), "map.extra.0.name", "`tank` is taken"),
        ("[route]", map_of(extra=("kiosk", "kiosk", 8, 3)), "map.extra.0.kind", "allowed are building, busbar"),
        ("[route]", map_of(extra=("kiosk", "cabinet", 28, 3)), "map.extra.0.position_m", "outside the yard"),
        ("[route]", map_of(extra=("kiosk", "cabinet", 15, 3)), "route.waypoints_m.0", "equipment `kiosk` on the map"),
    ],
)  # fmt: skip
def test_a_fault_is_named_with_its_key_what_came_and_what_is_allowed(
    old: str, new: str, key: str, words: str, tmp_path: Path
) -> None:
    assert old in GOOD
    faults = fault_of(tmp_path, GOOD.replace(old, new, 1))
    matching = [fault for fault in faults if f": {key}: " in fault]
    assert matching, faults
    assert words in matching[0]


@pytest.mark.parametrize("section", ["yard", "route", "array"])
def test_a_missing_section_is_named(section: str, tmp_path: Path) -> None:
    start = GOOD.index(f"[{section}]")
    end = {"yard": GOOD.index("[route]"), "route": GOOD.index("[array]"), "array": GOOD.index("[receiver]")}[section]
    faults = fault_of(tmp_path, GOOD[:start] + GOOD[end:])
    assert any(f": {section}: missing" in fault for fault in faults)


def test_every_fault_is_told_at_once(tmp_path: Path) -> None:
    text = GOOD.replace("noise_v = 1e-3", "noise_v = -1").replace("gain_error = 0.05", "gain_eror = 1")
    assert len(fault_of(tmp_path, text)) == 2


def test_an_empty_file_bytes_that_are_no_text_and_text_that_is_no_toml_are_refused(tmp_path: Path) -> None:
    assert {"yard: missing; it is required", "route: missing; it is required"} <= {
        fault.split(": ", 1)[1] for fault in fault_of(tmp_path, "")
    }
    assert "not UTF-8 text" in fault_of(tmp_path, b"\xff\xfe\x00yard")[0]
    assert "not TOML" in fault_of(tmp_path, "yard = [")[0]


def test_a_file_that_is_not_there_and_a_folder_are_refused(tmp_path: Path) -> None:
    for path in (tmp_path / "none.toml", tmp_path):
        with pytest.raises(ScenarioError, match=r"cannot be read|no such"):
            load_scenario(path)
    with pytest.raises(ScenarioError, match=r"known are .*one_source"):
        load_scenario("one_sorce")


@pytest.mark.parametrize(
    ("place", "key", "words"),
    [
        ("[5, 5, 1]", "position_m", "inside the yard"),
        ("[-5, 5, 1]\nmoves_to_m = [5, 5, 1]\nspeed_mps = 9", "moves_to_m", "crosses the yard"),
        ("[-5, 5, 1]\nmoves_to_m = [25, 5, 1]\nspeed_mps = 9", "moves_to_m", "beyond the fence of (20.0, 15.0)"),
        ("[-5, 14, 1]\nmoves_to_m = [5, 18, 1]\nspeed_mps = 9", "moves_to_m", None),
        ("[-5, 12, 1]\nmoves_to_m = [5, 16, 1]\nspeed_mps = 9", "moves_to_m", "crosses the yard"),
        ("[-5, 5, 1]\nmoves_to_m = [0, 5, 1]\nspeed_mps = 9", "moves_to_m", "crosses the yard"),
        ("[-5, 5, 1]\nmoves_to_m = [-5, 5, 1]\nspeed_mps = 9", "moves_to_m", "another place"),
        ("[-5, 5, 1]\nmoves_to_m = [-5, 25, 1]", "moves_to_m, speed_mps", "only moves_to_m given"),
        ("[-5, 5, 1]\nspeed_mps = 9", "moves_to_m, speed_mps", "only speed_mps given"),
        ("[-5, 5, 1]\nmoves_to_m = [-5, 25, 1]\nspeed_mps = 0", "speed_mps", "greater than 0"),
    ],
)
def test_an_interferer_stays_beyond_the_fence(place: str, key: str, words: str | None, tmp_path: Path) -> None:
    text = GOOD + f'[[interferers]]\nname = "radio"\namplitude_v = 1.0\nposition_m = {place}\n'
    if words is None:
        (tmp_path / "yard.toml").write_text(text, encoding="utf-8")
        assert load_scenario(tmp_path / "yard.toml").interferers
        return
    (fault,) = fault_of(tmp_path, text)
    assert f": interferers.0.{key}: " in fault
    assert words in fault


@settings(max_examples=60, deadline=None)
@given(st.binary(max_size=60))
def test_no_bytes_whatever_cause_anything_but_named_faults(
    tmp_path_factory: pytest.TempPathFactory, noise: bytes
) -> None:
    file = tmp_path_factory.mktemp("noise") / "yard.toml"
    file.write_bytes(GOOD.encode()[:400] + noise + GOOD.encode()[400:])
    with suppress(ScenarioError):
        load_scenario(file)


def test_the_paper_field_scenario_is_the_table_as_printed() -> None:
    # Dir-MUSIC, Table 3: range and angle from the array, 20 shots at each position
    scenario = load_scenario("paper_field")
    table = [(7.5, a) for a in (-96, -66, -19, -10, 10, 17, 28, 93)] + [(14.0, -90.0), (18.9, 17.5)]
    assert [element.azimuth_deg for element in scenario.array.elements] == [90.0, 30.0, -30.0, -90.0]
    assert [source.n_shots for source in scenario.sources] == [20] * 10
    x, y = (np.array([s.position_m for s in scenario.sources])[:, :2] - scenario.route.dock_m).T
    np.testing.assert_allclose(np.hypot(x, y), [r for r, _ in table], atol=1e-3)
    np.testing.assert_allclose(np.degrees(np.arctan2(y, x)), [a for _, a in table], atol=0.01)
    assert {s.position_m[2] for s in scenario.sources if s.position_m} == {scenario.array.height_m}
