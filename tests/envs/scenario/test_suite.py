"""The frozen suite: complete files, and sources that can be found."""

import hashlib
import tomllib
from collections import Counter

import numpy as np
import pytest
from numpy.typing import NDArray

from pdpatrol.envs.scenario import ScenarioError, load_scenario
from pdpatrol.envs.scenario.radio import BELIEVED, surroundings_of
from pdpatrol.envs.scenario.suite import SUITE, choose_yards, load_suite

FloatArray = NDArray[np.float64]

NOT_FROZEN = {
    "estimator": True,
    "locating": True,
    "map": {"accuracy_m": True},
    "pose_sensor": {"frame_offset_std_m": True, "frame_rotation_std_deg": True},
}
"""Tables and keys of beliefs that the files omit, so that the defaults of the code apply."""

CHANGED = {
    "mismatch": {"nature"},
    "frame": {"nature"},
    "close": {"sources"},
    "slow": {"sources", "route", "task"},
    "wet": {"radio"},
}
"""Tables in which the yards of the levels of version 2 differ from those of version 1 that they are made from."""

YARDS = load_suite().yards
FIRST = [each for each in YARDS if each.level not in CHANGED]
"""Yards of version 1."""


def test_yards_of_version_1_keep_their_geometry() -> None:
    """Shape and sites of catalogue equipment, which the files do not contain, must not change."""
    digest = hashlib.sha256()
    for each in FIRST:
        yard = load_scenario(each.name).yard
        sites_m = [yard.site_position(name) for name in yard.site_names()]
        for numbers in (*vars(yard.solids).values(), np.array(sites_m)):
            digest.update((np.round(np.asarray(numbers, dtype=np.float64), 6) + 0.0).tobytes())  # turns -0 into 0
    assert digest.hexdigest() == "818337d1d344d41bd1b4e97cbdda1e75e5a57e6ab0fa219dc3e68f5375f7865a"


def test_yards_of_version_2_differ_from_their_base_as_described() -> None:
    """Nothing else differs, and no yard of one part is made from one of the other."""
    by_name, made = {each.name: each for each in FIRST}, Counter[tuple[str, str]]()
    for each in YARDS:
        if each.level in CHANGED:
            text = each.path.read_text(encoding="utf-8")
            base = by_name[text.splitlines()[1].removeprefix("# made from ")]
            before, after = (tomllib.loads(file.read_text(encoding="utf-8")) for file in (base.path, each.path))
            assert {key for key in {**before, **after} if before.get(key) != after.get(key)} == CHANGED[each.level]
            assert base.part == each.part, each.name
            made[each.level, each.part] += 1
    assert set(made.values()) == {9}
    assert load_suite().version == 2


def test_file_sets_every_key() -> None:
    """Keys of `[nature]` may be left out, because they then have the values that the file states as believed."""
    for each in YARDS:
        written = tomllib.loads(each.path.read_text(encoding="utf-8"))
        differing = {table: set(keys) for table, keys in written.get("nature", {}).items()}
        scenario = load_scenario(each.name)
        meant = scenario.model_dump(mode="json", exclude={"name": True, "nature": True} | NOT_FROZEN, exclude_none=True)
        if differing:
            meant |= {"nature": scenario.nature.model_dump(mode="json", include=differing, exclude_none=True)}
        assert written == meant, each.path.name


def test_parts_have_as_many_missions_and_other_seeds() -> None:
    suite = load_suite()
    n_missions = Counter[str]()
    for each in YARDS:
        n_missions[each.part] += len(suite.seeds[each.part])
    n_yards = 100 + 9 * len(CHANGED)
    assert n_missions == {"public": 10 * n_yards, "test": 10 * n_yards}
    assert len(choose_yards("suite")) == n_yards
    assert not set(suite.seeds["public"]) & set(suite.seeds["test"])
    assert {each.level for each in YARDS} == set(suite.levels)
    assert len(list(SUITE.rglob("*.toml"))) == 1 + len(YARDS)


def test_a_fifth_of_the_sources_are_off_the_catalogue_sites() -> None:
    sources = [source for each in FIRST for source in load_scenario(each.name).sources]
    assert 0.18 <= np.mean([not source.sites for source in sources]) <= 0.25


def test_levels_differ_as_described() -> None:
    scenarios = {each.name: (each.level, load_scenario(each.name)) for each in FIRST}
    for name, (level, scenario) in scenarios.items():
        n_sources = len(scenario.sources)
        assert (2 <= n_sources <= 5) if level == "several" else n_sources == (level != "quiet"), name
        assert bool(scenario.nature.receiver.faults) == (level == "faulty"), name
        assert (scenario.known_yard is not scenario.yard) == (level == "wrong_map"), name
        assert (scenario.pose_sensor.position_std_m, scenario.pose_sensor.heading_std_deg) == (
            (0.2, 2.0) if level == "poor_pose" else (0.05, 0.5)
        ), name
    clutter = [len(scenario.yard.equipment) for level, scenario in scenarios.values() if level == "cluttered"]
    assert Counter(clutter) == {n: 2 for n in range(1, 13)}


def test_antennas_of_mismatch_are_evenly_spread() -> None:
    """Each differs from the data sheet, which the robot goes by, in pattern or beam width; every third mount is off."""
    scenarios = [load_scenario(each.name) for each in YARDS if each.level == "mismatch"]
    true = [scenario.nature.array for scenario in scenarios]
    assert {scenario.array for scenario in scenarios} == {load_scenario("suite/open_01").array}
    assert set(Counter((array.pattern, array.beam_width_scale) for array in true).values()) == {3}
    assert {array.pattern for array in true} == {None, "helix", "helix_in_ring"}
    assert sum(bool(array.mount_yaw_deg or array.mount_tilt_deg) for array in true) == 6


def test_localisation_of_frame_is_off_within_bounds() -> None:
    """One or two errors a yard, each in four or more; the robot believes in none of them."""
    n_yards = Counter[str]()
    for each in YARDS:
        if each.level != "frame":
            continue
        scenario = load_scenario(each.name)
        true, believed = scenario.nature.pose_sensor, scenario.pose_sensor
        ratio = true.applied_to(believed).position_std_m / believed.position_std_m
        offset_m, rotation_deg = np.hypot(*true.frame_offset_m), abs(true.frame_rotation_deg)
        assert offset_m == 0.0 or 0.2 <= offset_m <= 1.0, each.name
        assert rotation_deg == 0.0 or 0.3 <= rotation_deg <= 2.0, each.name
        assert ratio == 1.0 or 1.5 <= ratio <= 2.0, each.name
        assert true.applied_to(believed).heading_std_deg == pytest.approx(ratio * believed.heading_std_deg, rel=1e-3)
        assert abs(true.heading_bias_deg) in (0.0, 1.0), each.name
        errors = {
            "offset": offset_m > 0.0,
            "rotation": rotation_deg > 0.0,
            "worse": ratio > 1.0,
            "bias": true.heading_bias_deg != 0.0,
            "jumps": true.jumps_per_min > 0.0,
            "dropouts": true.dropouts_per_min > 0.0,
        }
        assert 1 <= sum(errors.values()) <= 2, each.name
        n_yards.update(name for name, given in errors.items() if given)
    assert min(n_yards.values()) >= 4
    assert len(n_yards) == 6


def test_discharges_of_close_are_near_and_mostly_alike() -> None:
    """Six pairs at 0.3 to 0.5 m, at 0.5 to 1 m and at 1 to 2 m; two of nine pairs differ in kind or in level."""
    apart_m, alike = list[float](), list[bool]()
    for each in YARDS:
        if each.level != "close":
            continue
        scenario = load_scenario(each.name)
        first, second = scenario.sources
        one_m, other_m = (
            np.array(source.position_m or scenario.yard.site_position(*scenario.candidate_sites(source)))
            for source in (first, second)
        )
        apart_m.append(float(np.linalg.norm(one_m - other_m)))
        assert first.conductor_deg == second.conductor_deg in (0.0, 120.0, 240.0), each.name
        assert first.pulse_rate_hz == second.pulse_rate_hz, each.name
        alike.append((first.kind, first.amplitude_v) == (second.kind, second.amplitude_v))
    assert np.histogram(apart_m, [0.3, 0.5, 1.0, 2.0])[0].tolist() == [6, 6, 6]
    assert (len(alike), sum(alike)) == (18, 14)


def test_discharges_of_slow_have_few_pulses() -> None:
    """One to three a yard, with rates evenly spread in their logarithm, a third with pauses."""
    scenarios = [load_scenario(each.name) for each in YARDS if each.level == "slow"]
    sources = [source for scenario in scenarios for source in scenario.sources]
    rates_hz = sorted(source.pulse_rate_hz for source in sources)
    assert Counter(len(scenario.sources) for scenario in scenarios) == {1: 6, 2: 6, 3: 6}
    assert {scenario.task.time_limit_s for scenario in scenarios} == {900.0}
    np.testing.assert_allclose(rates_hz, np.geomspace(0.05, 1.0, 2 * len(sources) + 1)[1::2], atol=6e-4)
    assert sum(source.duty_s is not None for source in sources) == len(sources) / 3


def test_ground_of_wet_reflects_more_than_the_robot_assumes() -> None:
    for each in YARDS:
        scenario = load_scenario(each.name)
        true, believed = (surroundings_of(scenario.yard, radio).ground for radio in (scenario.radio, BELIEVED))
        assert (true.largest_reflection > 1.5 * believed.largest_reflection) == (each.level == "wet"), each.name


def test_unknown_part_of_the_suite_is_refused() -> None:
    for name in ("suite/", "suite/nonsense", "suite/test/nonsense", "suite/open_99", "suite/open/01"):
        with pytest.raises(ScenarioError) as error:
            choose_yards(name)
        assert len(error.value.faults) == 1
    with pytest.raises(ScenarioError, match="must be one yard, such as suite/open_01, got 9"):
        load_scenario("suite/open")
