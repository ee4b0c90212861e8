"""The frozen suite: complete files, and sources that can be found."""

import hashlib
import tomllib
from collections import Counter

import numpy as np
import pytest
from numpy.typing import NDArray

from pdpatrol.envs.scenario import ScenarioError, load_scenario
from pdpatrol.envs.scenario.suite import SUITE, choose_yards, load_suite

FloatArray = NDArray[np.float64]

NOT_FROZEN = {
    "estimator": True,
    "locating": True,
    "map": {"accuracy_m": True},
    "pose_sensor": {"frame_offset_std_m": True, "frame_rotation_std_deg": True},
}
"""Tables and keys of beliefs that the files omit, so that the defaults of the code apply."""


def test_yards_of_version_1_keep_their_geometry() -> None:
    """Shape and sites of catalogue equipment, which the files do not contain, must not change."""
    digest = hashlib.sha256()
    for each in load_suite().yards:
        yard = load_scenario(each.name).yard
        sites_m = [yard.site_position(name) for name in yard.site_names()]
        for numbers in (*vars(yard.solids).values(), np.array(sites_m)):
            digest.update((np.round(np.asarray(numbers, dtype=np.float64), 6) + 0.0).tobytes())  # turns -0 into 0
    assert load_suite().version == 1
    assert digest.hexdigest() == "818337d1d344d41bd1b4e97cbdda1e75e5a57e6ab0fa219dc3e68f5375f7865a"


def test_file_sets_every_key() -> None:
    """Keys of `[nature]` may be left out, because they then have the values that the file states as believed."""
    for each in load_suite().yards:
        written = tomllib.loads(each.path.read_text(encoding="utf-8"))
        differing = {table: set(keys) for table, keys in written.get("nature", {}).items()}
        scenario = load_scenario(each.name)
        meant = scenario.model_dump(mode="json", exclude={"name": True, "nature": True} | NOT_FROZEN, exclude_none=True)
        if differing:
            meant |= {"nature": scenario.nature.model_dump(mode="json", include=differing, exclude_none=True)}
        assert written == meant, each.path.name


def test_each_part_has_a_thousand_missions() -> None:
    suite = load_suite()
    n_missions = Counter[str]()
    for each in load_suite().yards:
        n_missions[each.part] += len(suite.seeds[each.part])
    assert n_missions == {"public": 1000, "test": 1000}
    assert len(choose_yards("suite")) == 100
    assert not set(suite.seeds["public"]) & set(suite.seeds["test"])
    assert {each.level for each in load_suite().yards} == set(suite.levels)
    assert len(list(SUITE.rglob("*.toml"))) == 1 + len(load_suite().yards)


def test_a_fifth_of_the_sources_are_off_the_catalogue_sites() -> None:
    sources = [source for each in load_suite().yards for source in load_scenario(each.name).sources]
    assert 0.18 <= np.mean([not source.sites for source in sources]) <= 0.25


def test_levels_differ_as_described() -> None:
    scenarios = {each.name: (each.level, load_scenario(each.name)) for each in load_suite().yards}
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


def test_unknown_part_of_the_suite_is_refused() -> None:
    for name in ("suite/", "suite/nonsense", "suite/test/nonsense", "suite/open_99", "suite/open/01"):
        with pytest.raises(ScenarioError) as error:
            choose_yards(name)
        assert len(error.value.faults) == 1
    with pytest.raises(ScenarioError, match="must be one yard, such as suite/open_01, got 9"):
        load_scenario("suite/open")
