"""The frozen suite: complete files of one version, and the yards that they make."""

import hashlib
import tomllib
from collections import Counter
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from pdpatrol.envs.scenario import ScenarioError, load_scenario
from pdpatrol.envs.scenario.radio import BELIEVED, surroundings_of
from pdpatrol.envs.scenario.suite import SUITE, choose_yards, load_suite

FloatArray = NDArray[np.float64]

NOT_FROZEN = {
    "battery": {"drive_j_per_m": True, "charge_w": True, "reserve": True},
    "estimator": True,
    "inspection": True,
    "locating": True,
    "map": {"accuracy_m": True},
    "pose_sensor": {"frame_offset_std_m": True, "frame_rotation_std_deg": True},
    "survey": True,
    "zones": True,
}
"""Tables and keys that the files omit, so that the defaults of the code apply: beliefs, and keys of the battery, which
lasts longer than any mission of the suite."""

NEW_IN_2 = {"mismatch", "frame", "close", "slow", "wet"}
"""Levels of version 2, whose yards are those of version 1 with one table changed."""

SITES = {"site_110", "site_220", "site_400"}
"""Levels of version 3, which are substations."""

YARDS = load_suite().yards
loaded = cache(load_scenario)


def test_yards_of_version_1_keep_their_geometry() -> None:
    """Shape and sites of catalogue equipment, which the files do not contain, must not change."""
    digest = hashlib.sha256()
    for yard in (loaded(each.name).yard for each in YARDS if each.level not in NEW_IN_2 | SITES):
        sites_m = [yard.site_position(name) for name in yard.site_names()]
        for numbers in (*vars(yard.solids).values(), np.array(sites_m)):
            digest.update((np.round(np.asarray(numbers, dtype=np.float64), 6) + 0.0).tobytes())  # turns -0 into 0
    assert digest.hexdigest() == "818337d1d344d41bd1b4e97cbdda1e75e5a57e6ab0fa219dc3e68f5375f7865a"


def test_files_are_those_of_their_version() -> None:
    """The version changes whenever a yard, source, error or seed does."""
    assert load_suite().label == "3:3942ffeecebb"


@pytest.mark.whole
def test_file_sets_every_key() -> None:
    """Keys of `[nature]` may be left out, because they then have the values that the file states as believed."""
    for each in YARDS:
        written = tomllib.loads(each.path.read_text(encoding="utf-8"))
        nature = written.get("nature", {})
        differing = {table: set(keys) if isinstance(keys, dict) else True for table, keys in nature.items()}
        scenario = loaded(each.name)
        meant = scenario.model_dump(mode="json", exclude={"name": True, "nature": True} | NOT_FROZEN, exclude_none=True)
        if each.level not in {"slow"} | SITES:
            assert meant["route"].pop("dwell_s") == 0.0
        if differing:
            meant |= {"nature": scenario.nature.model_dump(mode="json", include=differing, exclude_none=True)}
        assert written == meant, each.path.name


def test_parts_have_as_many_missions_and_other_seeds() -> None:
    suite = load_suite()
    n_missions = Counter[str]()
    for each in YARDS:
        n_missions[each.part] += len(each.seeds)
    n_yards, n_sites = 100 + 9 * len(NEW_IN_2), 10 * len(SITES)
    assert n_missions == dict.fromkeys(("public", "test"), 10 * n_yards + 3 * n_sites)
    assert len(choose_yards("suite")) == len(choose_yards("suite/test")) == n_yards
    assert len(choose_yards("suite/test/site_400")) == 10
    assert not set(suite.seeds["public"]) & set(suite.seeds["test"])
    assert {each.level for each in YARDS} == set(suite.levels)
    assert len(list(SUITE.rglob("*.toml"))) == 1 + len(YARDS)


def test_only_the_ground_of_wet_reflects_more_than_the_robot_assumes() -> None:
    for level in load_suite().levels:
        scenario = loaded(f"suite/{level}_01")
        true, believed = (surroundings_of(scenario.yard, radio).ground for radio in (scenario.radio, BELIEVED))
        assert (true.largest_reflection > 1.5 * believed.largest_reflection) == (level == "wet"), level


def test_unknown_part_of_the_suite_is_refused() -> None:
    for name in ("suite/", "suite/nonsense", "suite/test/nonsense", "suite/open_99", "suite/open/01"):
        with pytest.raises(ScenarioError) as error:
            choose_yards(name)
        assert len(error.value.faults) == 1
    with pytest.raises(ScenarioError, match="must be one yard, such as suite/open_01, got 9"):
        load_scenario("suite/open")
