"""What a change is worth: variants, and scores with their intervals."""

import json
import subprocess
import sys
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from envs import load_scenario, shipped_scenarios
from missions.comparison.scores import MissionScore, as_json, from_json, score_mission, summarise
from missions.comparison.table import markdown
from missions.comparison.variants import VARIANTS, Variant
from missions.comparison.worth import compare
from missions.runner import run_mission

ROOT = Path(__file__).parents[2]
PDPATROL = Path(sys.executable).parent / "pdpatrol"


def mission(error_m: float | None, rmse_deg: float = 2.0) -> MissionScore:
    found = () if error_m is None else (error_m,)
    return MissionScore(np.radians(rmse_deg), 1, len(found), found, tuple(100.0 for _ in found), 0)


@pytest.mark.parametrize("name", [name for name in shipped_scenarios() if name not in ("paper_field", "bench")])
def test_every_variant_of_a_shipped_scenario_is_a_scenario(name: str) -> None:
    scenario = load_scenario(name)
    assert len({variant.of(scenario).model_dump_json() for variant in VARIANTS}) == len(VARIANTS) - 2  # three are alike


def test_an_interval_holds_its_figure_and_shrinks_with_the_number_of_missions() -> None:
    errors = np.random.default_rng(0).rayleigh(0.05, 400)
    few, many = (summarise([mission(error) for error in errors[:n]]) for n in (20, 400))
    for score in (few, many):
        assert score.error_m.low <= score.error_m.value <= score.error_m.high
        assert score.found.low < score.found.value == 1.0
    assert many.error_m.high - many.error_m.low < 0.5 * (few.error_m.high - few.error_m.low)
    assert many.found.low > few.found.low


def test_what_was_not_found_counts_in_the_share_and_not_in_the_errors() -> None:
    score = summarise([mission(0.1), mission(None), mission(0.3), mission(None)])
    assert score.found.value == 0.5
    assert score.error_m.value == pytest.approx(0.2)
    nothing = summarise([mission(None), mission(None)])
    assert nothing.found.value == 0.0
    assert np.isnan(nothing.error_m.value)
    assert from_json(json.loads(json.dumps(as_json(score)))) == score


def test_a_mission_is_scored_against_the_truth() -> None:
    scenario = load_scenario("one_source")
    score = score_mission(run_mission(scenario, "seek", 3), scenario)
    assert (score.n_sources, score.n_found, score.false_findings) == (1, 1, 0)
    assert score.errors_m[0] < 0.3
    assert 0.5 < np.degrees(score.bearing_rmse_rad) < 6.0
    assert 0.0 < score.confirmed_s[0] < 600.0


def test_variants_that_are_alike_share_missions_and_workers_change_nothing() -> None:
    scenario = load_scenario("one_source")
    short = scenario.model_copy(update={"task": scenario.task.model_copy(update={"time_limit_s": 20.0})})
    variants = [Variant("a", "six", {"array": {"n_elements": 6}}), Variant("b", "default", {}), VARIANTS[0]]
    told: list[tuple[int, int]] = []
    by_two = compare(short, variants, range(2), 2, lambda done, total: told.append((done, total)))
    assert told == [(1, 4), (2, 4), (3, 4), (4, 4)]
    assert by_two["a: six"] == by_two["b: default"]
    np.testing.assert_equal(compare(short, variants, range(2), 1), by_two)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["--missions", "0"], "--missions: got 0"),
        (["--seed", "-1"], "--seed: got -1"),
        (["no_yard"], "no such scenario"),
    ],
)
def test_what_cannot_be_compared_is_refused_in_one_line(arguments: list[str], named: str, tmp_path: Path) -> None:
    done = subprocess.run([PDPATROL, "worth", *arguments], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert named in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


DOCUMENTED = json.loads((ROOT / "docs" / "worth.json").read_text(encoding="utf-8"))
SCORES = {f"{row['group']}: {row['name']}": from_json(row) for row in DOCUMENTED["variants"]}


def test_the_table_of_the_readme_is_that_of_the_stored_result() -> None:
    assert DOCUMENTED["missions"] == 20
    assert markdown(VARIANTS, SCORES) in (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("group", sorted({variant.group for variant in VARIANTS} - {"robot"}))
def test_more_elements_and_better_methods_are_not_worse_beyond_the_intervals(group: str) -> None:
    scores = [SCORES[variant.key] for variant in VARIANTS if variant.group == group]
    for worse, better in combinations(scores, 2):
        assert better.bearing_rmse_deg.low <= worse.bearing_rmse_deg.high
        assert better.error_m.low <= worse.error_m.high
        assert better.confirmed_s.low <= worse.confirmed_s.high
        assert better.found.high >= worse.found.low
