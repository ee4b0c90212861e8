"""Intervals have their stated coverage for clustered data, and paired comparisons find differences that exist."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from dirmusic import InputFileError
from pdpatrol.missions.sweep.analysis import (
    Estimate,
    cluster_bootstrap,
    clustered_share,
    compare,
    difference,
    pair_up,
    percentage_of,
    wilson,
)
from pdpatrol.missions.sweep.dataset import Dataset, MissionRow
from pdpatrol.missions.sweep.plan import make_plan

N_SEEDS = 40


def coverage(estimates: list[Estimate], truth: float) -> float:
    return float(np.mean([each.low <= truth <= each.high for each in estimates]))


@pytest.mark.parametrize(("n_clusters", "share"), [(20, 0.8), (90, 0.95)])
def test_share_interval_covers_truth_for_correlated_sources(n_clusters: int, share: float) -> None:
    """Sources of one mission succeed together (beta-binomial, correlation 0.5): Wilson's interval is too short."""
    rng, clustered, pooled = np.random.default_rng(1), list[Estimate](), list[Estimate]()
    for _ in range(1000):
        totals = rng.integers(1, 7, n_clusters)
        counts = rng.binomial(totals, rng.beta(share, 1.0 - share, n_clusters))
        clustered.append(clustered_share(counts, totals))
        pooled.append(wilson(counts.sum(), totals.sum()))
    assert 0.93 <= coverage(clustered, share) <= 0.99
    assert coverage(pooled, share) < 0.88


@pytest.mark.whole
@pytest.mark.parametrize("n_clusters", [9, 40])
@pytest.mark.parametrize("statistic", [np.nanmedian, np.nanmean])
def test_bootstrap_interval_covers_truth_for_correlated_errors(statistic: object, n_clusters: int) -> None:
    """Errors in one mission share most of their variance."""
    rng, clustered, pooled = np.random.default_rng(2), list[Estimate](), list[Estimate]()
    for _ in range(400):
        values = rng.normal(0.0, 1.0, (n_clusters, 1)) + rng.normal(0.0, 0.5, (n_clusters, 5))
        clustered.append(cluster_bootstrap(list(values), statistic, 400))  # pyright: ignore[reportArgumentType]
        pooled.append(cluster_bootstrap(values.ravel(), statistic, 400))  # pyright: ignore[reportArgumentType]
    assert 0.915 <= coverage(clustered, 0.0) <= 0.985
    assert coverage(pooled, 0.0) < 0.75


def test_share_of_independent_trials_has_wilson_interval() -> None:
    assert clustered_share(np.arange(20) < 17, np.ones(20)) == pytest.approx(wilson(17, 20))
    assert wilson(17, 20) == pytest.approx((0.85, 0.6396, 0.9476), abs=1e-4)
    assert clustered_share([3, 3], [3, 3]) == pytest.approx(wilson(2, 2))  # a cluster counts once


def test_too_few_values_have_no_interval() -> None:
    one_pair = difference("OSPA (m)", np.array([[0.1, 0.3]]))
    assert np.isnan(one_pair.change.low)
    assert one_pair.p == 1.0
    assert np.isnan(cluster_bootstrap([[], [np.nan]], np.nanmedian)).all()
    assert np.isnan(cluster_bootstrap([[], [3.0, 4.0]], np.nanmedian).low)


def make_dataset(folder: Path, penalty_m: float) -> Dataset:
    """Make missions whose errors depend on the seed, and grow by `penalty_m` with more noise and with `patrol`."""
    grid = {"receiver.noise_v": [1e-3, 2e-3]}
    plan = make_plan(["one_source"], ["seek", "patrol"], grid, range(N_SEEDS))
    dataset = Dataset.open_or_make(folder, plan)
    errors_m = np.random.default_rng(0).rayleigh(0.05, N_SEEDS)
    for job in plan.jobs:
        worse = (job.policy == "patrol") + (job.settings["receiver.noise_v"] > 1e-3)
        error_m = float(errors_m[job.seed] + worse * penalty_m)
        row = MissionRow.of_failure(job, "finished", "")._replace(n_sources=1, ospa_m=2.0)
        if error_m < 0.2:
            row = row._replace(n_found=1, errors_m=(error_m,), ospa_m=error_m)
        dataset.write(row)
    return dataset


def test_intervals_over_yards_are_wider_than_over_missions() -> None:
    """Ten missions find all sources in one yard and none in another: two yards say little about other yards."""
    found = [1] * 10 + [0] * 10
    missions = pd.DataFrame({"key": range(20), "scenario": found, "n_found": found, "n_sources": 1})
    over_missions, over_yards = (percentage_of(missions, by, "n_found", "n_sources") for by in ("key", "scenario"))
    assert over_missions == pytest.approx([100.0 * end for end in wilson(10, 20)])
    assert over_yards.low < 10.0


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return make_dataset(tmp_path_factory.mktemp("sweep") / "a", 0.02)


def test_a_side_does_not_differ_from_itself(dataset: Dataset) -> None:
    for each in compare(*pair_up(dataset.read(), "seek", "seek")):
        assert (each.change, each.p, each.first) == ((0.0, 0.0, 0.0), 1.0, each.second)


@pytest.mark.parametrize("sides", [("seek", "patrol"), ("receiver.noise_v=0.001", "receiver.noise_v=2e-3")])
def test_difference_smaller_than_the_spread_is_found(sides: tuple[str, str], dataset: Dataset) -> None:
    first, second = pair_up(dataset.read(), *sides)
    assert len(first) == 2 * N_SEEDS
    assert first["seed"].tolist() == second["seed"].tolist()
    error = next(each for each in compare(first, second) if each.name == "error (m)")
    assert error.n == N_SEEDS  # missions with the same seed have the same emissions
    assert error.change.value == pytest.approx(0.02, abs=1e-9)
    assert error.p < 0.001


def test_two_datasets_are_paired_by_mission(dataset: Dataset, tmp_path: Path) -> None:
    make_dataset(tmp_path / "b", 0.05)
    first, second = pair_up(dataset.read(), str(dataset.folder), str(tmp_path / "b"))
    assert len(first) == 4 * N_SEEDS
    assert (first["n_found"] != second["n_found"]).any()
    ospa = next(each for each in compare(first, second) if each.name == "OSPA (m)")
    assert ospa.change.low > 0.0


@pytest.mark.whole
def test_permutation_test_has_its_stated_size() -> None:
    rng = np.random.default_rng(1)
    values = np.stack([rng.rayleigh(0.05, 60), rng.rayleigh(0.08, 60)], axis=-1)
    assert difference("OSPA (m)", values).p < 0.01
    hits = sum(difference("OSPA (m)", rng.permuted(values, axis=1)).p < 0.05 for _ in range(200))
    assert 4 <= hits <= 18


@pytest.mark.parametrize("sides", [("oracle", "seek"), ("seek", "receiver.noise_v=5")])
def test_a_side_without_missions_is_refused(sides: tuple[str, str], dataset: Dataset) -> None:
    with pytest.raises(InputFileError, match="no mission of it in the dataset"):
        pair_up(dataset.read(), *sides)
