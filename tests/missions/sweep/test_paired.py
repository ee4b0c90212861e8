"""Two sides compared mission by mission: no difference where there is none, and one where there is one."""

from pathlib import Path

import numpy as np
import pytest

from dirmusic import InputFileError
from pdpatrol.missions.sweep.dataset import Dataset
from pdpatrol.missions.sweep.mission_row import MissionRow
from pdpatrol.missions.sweep.plan import make_plan
from pdpatrol.missions.sweep.results.paired import MEASURES, compare, difference, pair_up

OSPA = next(measure for measure in MEASURES if measure.name.startswith("OSPA"))
N_SEEDS = 40


def make_dataset(folder: Path, penalty_m: float) -> Dataset:
    """Missions whose errors depend on the seed alone, and by `penalty_m` on noise and policy each."""
    grid = {"receiver.noise_v": [1e-3, 2e-3]}
    plan = make_plan(["one_source"], ["seek", "patrol"], grid, range(N_SEEDS))
    dataset = Dataset.open_or_make(folder, plan)
    errors_m = np.random.default_rng(0).rayleigh(0.05, N_SEEDS)
    for job in plan.jobs:
        worse = (job.policy == "patrol") + (job.settings["receiver.noise_v"] > 1e-3)
        error_m = float(errors_m[job.seed] + worse * penalty_m)
        found = error_m < 0.2
        row = MissionRow.of_failure(job, "finished", "")
        dataset.write(
            row._replace(
                n_sources=1, n_found=int(found), errors_m=(error_m,) if found else (), ospa_m=error_m if found else 2.0
            )
        )
    return dataset


def test_a_side_does_not_differ_from_itself(tmp_path: Path) -> None:
    dataset = make_dataset(tmp_path / "out", 0.02)
    for each in compare(pair_up(dataset.read(), "seek", "seek")):
        assert (each.change.value, each.change.low, each.change.high) == (0.0, 0.0, 0.0)
        assert (each.permutation_p, each.sign_p) == (1.0, 1.0)
        assert each.first == each.second
        assert each.n_first_better == each.n_second_better == 0


@pytest.mark.parametrize("sides", [("seek", "patrol"), ("receiver.noise_v=0.001", "receiver.noise_v=2e-3")])
def test_a_difference_is_found_though_it_is_smaller_than_the_spread(sides: tuple[str, str], tmp_path: Path) -> None:
    pairs = pair_up(make_dataset(tmp_path / "out", 0.02).read(), *sides)
    assert len(pairs) == 2 * N_SEEDS
    assert all(pair.first["seed"] == pair.second["seed"] for pair in pairs)
    error = next(each for each in compare(pairs) if each.name == "error (m)")
    assert error.change.value == pytest.approx(0.02, abs=1e-9)
    assert error.permutation_p < 0.001
    assert error.sign_p < 0.001
    assert error.n_second_better == 0


def test_two_datasets_are_joined_by_mission(tmp_path: Path) -> None:
    first, second = make_dataset(tmp_path / "a", 0.02), make_dataset(tmp_path / "b", 0.05)
    pairs = pair_up(first.read(), str(tmp_path / "a"), str(tmp_path / "b"))
    assert len(pairs) == 4 * N_SEEDS
    flipped = [pair for pair in pairs if pair.has_flipped]
    assert flipped
    assert all(pair.first["ospa_m"] < 0.2 <= pair.second["ospa_m"] for pair in flipped)
    ospa = next(each for each in compare(pairs) if each.name == OSPA.name)
    assert ospa.change.low > 0.0
    assert second.is_complete


def test_the_permutation_test_is_significant_as_often_as_it_says_where_labels_are_swapped() -> None:
    rng = np.random.default_rng(1)
    values = np.stack([rng.rayleigh(0.05, 60), rng.rayleigh(0.08, 60)], axis=-1)
    assert difference(OSPA, values).permutation_p < 0.01
    hits = 0
    for _ in range(200):
        swapped = rng.permuted(values, axis=1)
        hits += difference(OSPA, swapped).permutation_p < 0.05
    assert 0.02 * 200 <= hits <= 0.09 * 200


def test_a_single_pair_proves_nothing() -> None:
    one = difference(OSPA, np.array([[0.1, 0.3]]))
    assert one.change.value == pytest.approx(0.2)
    assert np.isnan(one.change.low)
    assert (one.permutation_p, one.sign_p) == (1.0, 1.0)


@pytest.mark.parametrize(("first", "second"), [("oracle", "seek"), ("seek", "receiver.noise_v=5"), ("a", "b")])
def test_a_side_without_missions_is_refused(first: str, second: str, tmp_path: Path) -> None:
    dataset = make_dataset(tmp_path / "out", 0.02)
    with pytest.raises(InputFileError, match="no mission of it in the dataset"):
        pair_up(dataset.read(), first, second)
