"""The frozen suite: complete files, and sources that can be found."""

import hashlib
import tomllib
from collections import Counter

import numpy as np
import pytest
from numpy.typing import NDArray

from pdpatrol.envs.scenario import Scenario, ScenarioError, load_scenario
from pdpatrol.envs.scenario.suite import SUITE, SuiteYard, choose_yards, load_suite, suite_yards
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.sensing import Faces, HelicalArray, Scene, Surroundings
from pdpatrol.sensing.nature.sources import DischargeSource
from pdpatrol.sensing.radio.surroundings import level_transform
from pdpatrol.sensing.receiver.bank import listen_once
from tests.sensing.radio.crossing import cross, solids_of

FloatArray = NDArray[np.float64]

NOT_FROZEN = {"estimator", "locating"}
"""Tables that the files leave to the code."""


def test_yards_of_version_1_keep_their_geometry() -> None:
    """Equipment of the catalogue keeps its shape and sites, which the files leave to the code."""
    digest = hashlib.sha256()
    for each in suite_yards():
        yard = load_scenario(each.name).yard
        sites_m = [yard.site_position(name) for name in yard.site_names()]
        for numbers in (*yard.solid_columns().values(), np.array(sites_m)):
            digest.update((np.round(np.asarray(numbers, dtype=np.float64), 6) + 0.0).tobytes())  # no -0
    assert load_suite().version == 1
    assert digest.hexdigest() == "818337d1d344d41bd1b4e97cbdda1e75e5a57e6ab0fa219dc3e68f5375f7865a"


def test_file_sets_every_key() -> None:
    for each in suite_yards():
        written = tomllib.loads(each.path.read_text(encoding="utf-8"))
        meant = load_scenario(each.name).model_dump(mode="json", exclude={"name"} | NOT_FROZEN, exclude_none=True)
        assert written == meant, each.path.name


def test_each_part_has_a_thousand_missions() -> None:
    suite = load_suite()
    n_missions = Counter[str]()
    for each in suite_yards():
        n_missions[each.part] += len(suite.seeds[each.part])
    assert n_missions == {"public": 1000, "test": 1000}
    assert len(choose_yards("suite")) == 100
    assert not set(suite.seeds["public"]) & set(suite.seeds["test"])
    assert {each.level for each in suite_yards()} == set(suite.levels)
    assert len(list(SUITE.rglob("*.toml"))) == 1 + len(suite_yards())


def test_a_fifth_of_the_sources_are_off_the_catalogue_sites() -> None:
    sources = [source for each in suite_yards() for source in load_scenario(each.name).sources]
    assert 0.18 <= np.mean([not source.sites for source in sources]) <= 0.25


def test_levels_differ_as_described() -> None:
    scenarios = {each.name: (each.level, load_scenario(each.name)) for each in suite_yards()}
    for name, (level, scenario) in scenarios.items():
        n_sources = len(scenario.sources)
        assert (2 <= n_sources <= 5) if level == "several" else n_sources == (level != "quiet"), name
        assert bool(scenario.receiver.faults) == (level == "faulty"), name
        assert (scenario.known_yard is not scenario.yard) == (level == "wrong_map"), name
        assert (scenario.pose_sensor.position_std_m, scenario.pose_sensor.heading_std_deg) == (
            (0.2, 2.0) if level == "poor_pose" else (0.05, 0.5)
        ), name
    clutter = [len(scenario.yard.equipment) for level, scenario in scenarios.values() if level == "cluttered"]
    assert Counter(clutter) == {n: 2 for n in range(1, 13)}


@pytest.mark.parametrize("each", suite_yards()[::7], ids=lambda each: each.path.stem)
def test_waypoints_are_reachable_and_sources_detectable(
    each: SuiteYard,
) -> None:
    scenario = load_scenario(each.name)
    site_map = SiteMap(scenario)
    reach = site_map.reach(scenario.route.dock_m)
    for waypoint in scenario.route.waypoints_m:
        assert np.isfinite(reach.length_m[site_map.cell(waypoint)])
    reachable_m = site_map.centres_m[np.isfinite(reach.length_m)]
    for source in scenario.sources:
        places = [scenario.yard.site_position(site) for site in scenario.candidate_sites(source)]
        for position_m in places or [np.array(source.position_m)]:
            weakest_v = source.amplitude_v * 10 ** (-source.amplitude_range_db / 40)
            assert n_directions_with_detection(scenario, reachable_m, position_m, weakest_v) >= 2


def n_directions_with_detection(
    scenario: Scenario, reachable_m: FloatArray, position_m: FloatArray, amplitude_v: float
) -> int:
    """Count reachable places in sight, 2 to 8 m away and 40 degrees apart, that detect half the pulses, up to two."""
    yard = scenario.yard
    surroundings = Surroundings.of_kinds(
        [item.kind for item in yard.equipment],
        Faces.of(solids_of(yard)),
        solids_of(yard),
    )
    apart_m = np.linalg.norm(reachable_m - position_m[:2], axis=-1)
    near_m = reachable_m[(apart_m > 2.0) & (apart_m < 8.0)]
    antennas_m = np.column_stack([near_m, np.full(len(near_m), scenario.array.height_m)])
    lines = np.broadcast_to(position_m, antennas_m.shape).copy()
    in_sight = ~cross(lines, antennas_m, solids_of(yard), len(yard.equipment)).any(axis=-1)
    rng, detected_rad = np.random.default_rng(0), []
    source = DischargeSource(name="s", position_m=position_m, amplitude_v=amplitude_v, pulse_rate_hz=20.0)
    receiver = scenario.receiver.model_copy(update={"faults": ()})
    array, scene = HelicalArray.nominal(scenario.array), Scene([source], surroundings)
    for place_m in rng.permutation(near_m[in_sight]):
        bearing_rad = np.arctan2(*(position_m[:2] - place_m)[::-1])
        if any(np.cos(bearing_rad - other) > np.cos(np.radians(40.0)) for other in detected_rad):
            continue
        detected = listen_once(
            receiver, array, scene, rng, world_from_array=level_transform(np.array([*place_m, 0.0])), duration_s=2.0
        )
        if len(detected.pulses.strengths_v) >= 20:
            detected_rad.append(bearing_rad)
        if len(detected_rad) == 2:
            break
    return len(detected_rad)


def test_unknown_part_of_the_suite_is_refused() -> None:
    for name in ("suite/", "suite/nonsense", "suite/test/nonsense", "suite/open_99", "suite/open/01"):
        with pytest.raises(ScenarioError) as error:
            choose_yards(name)
        assert len(error.value.faults) == 1
    with pytest.raises(ScenarioError, match="must be one yard, such as suite/open_01, got 9"):
        load_scenario("suite/open")
