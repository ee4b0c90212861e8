"""Plans of sweeps."""

from collections import Counter
from pathlib import Path

import pytest

from dirmusic import InputFileError
from pdpatrol.envs.scenario.suite import load_suite
from pdpatrol.missions.sweep.plan import make_plan, parse_grid


def test_every_combination_is_one_mission() -> None:
    grid = {"receiver.noise_v": [1e-3, 2e-3], "array.n_elements": [6, 8]}
    plan = make_plan(["one_source", "two_sources"], ["seek", "patrol"], grid, range(3))
    assert len(plan.jobs) == 2 * 4 * 2 * 3
    assert len({job.key for job in plan.jobs}) == len(plan.jobs)
    assert [job.order for job in plan.jobs] == list(range(len(plan.jobs)))
    for job in plan.jobs:
        assert job.scenario.receiver.noise_v == job.settings["receiver.noise_v"]
        assert job.scenario.array.n_channels == job.settings["array.n_elements"]


def test_keys_depend_only_on_the_mission(tmp_path: Path) -> None:
    policy = tmp_path / "own.py"
    policy.write_text("class Own: pass\n", encoding="utf-8")

    own = f"{policy}:Own"

    def only(scenario: str = "one_source", policy: str = own, noise_v: float = 1e-3, seed: int = 0) -> str:
        return make_plan([scenario], [policy], {"receiver.noise_v": [noise_v]}, [seed]).jobs[0].key

    first = only()
    more = make_plan(["two_sources", "one_source"], ["seek", own], {"receiver.noise_v": [1e-3]}, range(2))
    assert first in {job.key for job in more.jobs}
    policy.write_text("class Own:\n    pass\n", encoding="utf-8")
    others = [only(), only(noise_v=2e-3), only(seed=1), only(policy="seek"), only("two_sources", "seek")]
    assert len({first, *others}) == 1 + len(others)


def test_values_are_toml_or_strings() -> None:
    texts = ["a.b=5e-4,1e-3,2", "b=joint,bearings", "yard.size_m=[30.0, 24.0],[40.0, 30.0]", 'name="a,b"']
    assert parse_grid(texts) == {
        "a.b": [5e-4, 1e-3, 2],
        "b": ["joint", "bearings"],
        "yard.size_m": [[30.0, 24.0], [40.0, 30.0]],
        "name": ["a,b"],
    }


@pytest.mark.parametrize("text", ["noise", "=3", "a..b=1", "a="])
def test_invalid_setting_is_refused(text: str) -> None:
    with pytest.raises(InputFileError, match="--set: must be"):
        parse_grid([text])


def test_errors_of_all_settings_are_one_line_each() -> None:
    """The same error in many yards is one line."""
    with pytest.raises(InputFileError) as caught:
        make_plan(["suite/open"], ["seek"], {"receiver.noise_v": [1e-3, -1.0], "reciever.bits": [8]}, [0])
    unknown, negative = caught.value.faults
    assert "open_01.toml: reciever: unknown key" in unknown
    assert "receiver.noise_v: must be greater than or equal to 0.000000001, got -1.0" in negative


def test_suite_yards_have_their_seeds_level_and_checksum() -> None:
    suite, plan = load_suite(), make_plan(["suite/weak", "suite/test/quiet", "one_source"], ["seek"], {})
    by_level = Counter((job.level, job.suite) for job in plan.jobs)
    assert by_level == {("weak", suite.label): 90, ("quiet", suite.label): 70, ("", ""): 20}
    assert {job.seed for job in plan.jobs if job.level == "quiet"} == set(suite.seeds["test"])
