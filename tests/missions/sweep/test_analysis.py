"""Intervals have their stated coverage for clustered data, and paired comparisons find differences that exist."""

import itertools
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import f

from dirmusic import InputFileError
from pdpatrol.missions.sweep.analysis import (
    ALL,
    LEVELS,
    Estimate,
    cluster_bootstrap,
    clustered_share,
    compare,
    difference,
    pair_up,
    percentage_of,
    summarise_groups,
    wilson,
)
from pdpatrol.missions.sweep.dataset import Dataset, Frame, MissionRow
from pdpatrol.missions.sweep.plan import make_plan

N_SEEDS = 24


def coverage(estimates: list[Estimate], truth: float) -> float:
    return float(np.mean([each.low <= truth <= each.high for each in estimates]))


@pytest.mark.parametrize(
    ("n_yards", "share", "correlation"), [(6, 0.6, 0.3), (9, 0.9, 0.2), (9, 0.99, 0.1), (100, 0.95, 0.2)]
)
def test_share_interval_covers_truth_for_correlated_sources(n_yards: int, share: float, correlation: float) -> None:
    """Sources of one yard succeed together (beta-binomial): Wilson's interval of independent trials is too short."""
    rng, clustered, pooled = np.random.default_rng(1), list[Estimate](), list[Estimate]()
    alone = 1.0 / correlation - 1.0
    for _ in range(500):
        totals = rng.integers(5, 16, n_yards)
        counts = rng.binomial(totals, rng.beta(share * alone, (1.0 - share) * alone, n_yards))
        clustered.append(clustered_share(counts, totals))
        pooled.append(wilson(counts.sum(), totals.sum()))
    assert 0.935 <= coverage(clustered, share) <= 0.99
    assert coverage(pooled, share) < coverage(clustered, share) - 0.02


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
    assert clustered_share([10] * 9, [10] * 9) == pytest.approx(wilson(90 / 1.9, 90 / 1.9))  # correlation at least 0.1


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
    over_yards = percentage_of(missions, "n_found", "n_sources")
    over_missions = percentage_of(missions.assign(scenario="one"), "n_found", "n_sources")
    assert over_missions == pytest.approx([100.0 * end for end in wilson(10, 20)])
    assert over_yards.low < 10.0


def frame(rows: list[dict[str, object]]) -> Frame:
    """Return a dataset of finished missions of one source each, in yards of a suite."""
    known = MissionRow(0, "", "1", "", "", "", "seek", "{}", 0, "finished", "", n_sources=1, n_found=1)._asdict()
    return pd.DataFrame([known | {"order": k, "key": str(k), **row} for k, row in enumerate(rows)])


def test_coverage_is_that_of_stated_covariances() -> None:
    """Coverage equals the stated share if covariances are right, at any height, and not if they are half as large."""
    rng = np.random.default_rng(3)
    rows = list[dict[str, object]]()
    for k in range(4000):
        low, z = k % 2 == 0, rng.standard_normal(3) * np.sqrt(6.0 / rng.chisquare(8))  # Student's t, variance 1
        squares = np.square(z if low else np.sqrt(2.0) * z).cumsum()
        rows.append(
            {
                "scenario": str(k % 50), "level": "open", "true_heights_m": (1.0 if low else 2.0,),
                "mahalanobis2_2d": (squares[1],), "mahalanobis2_3d": (squares[2],),
            }
        )  # fmt: skip
    (summary,) = summarise_groups(frame(rows))
    for n, share in itertools.product((2, 3), LEVELS):
        name = f"coverage {n}-D {100 * share:g} %"
        of_all, of_low = summary[name], summary[f"{name} below 1.5 m"]
        assert isinstance(of_all, Estimate)
        assert isinstance(of_low, Estimate)
        assert of_low.low <= 100.0 * share <= of_low.high, name
        assert of_low.value > of_all.value
        assert of_all.value == pytest.approx(50.0 * (share + f.cdf(f.ppf(share, n, 8) / 2.0, n, 8)), abs=2.5), name


def test_paired_interval_is_over_yards() -> None:
    """Seeds of one yard that change together count once; each level has its own comparison."""
    rng = np.random.default_rng(4)
    change = rng.standard_normal(12)
    first, second = (
        frame(
            [
                {"scenario": str(yard), "level": "open" if yard < 6 else "weak", "seed": seed, "ospa_m": by * each}
                for yard, each in enumerate(change)
                for seed in range(20)
            ]
        ).set_index(["scenario", "seed"], drop=False)
        for by in (0.0, 1.0)
    )
    compared = compare(first, second)
    assert list(compared) == ["open", "weak", ALL]
    for group, yards in (("open", change[:6]), ("weak", change[6:]), (ALL, change)):
        ospa = next(each for each in compared[group] if each.name == "OSPA (m)")
        expected = difference("OSPA (m)", np.column_stack([np.zeros_like(yards), yards]))
        assert (ospa.n, ospa.p) == (len(yards), expected.p)
        assert ospa.change == pytest.approx(expected.change)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return make_dataset(tmp_path_factory.mktemp("sweep") / "a", 0.02)


def test_a_side_does_not_differ_from_itself(dataset: Dataset) -> None:
    for each in compare(*pair_up(dataset.read(), "seek", "seek"))[ALL]:
        assert (each.change, each.p, each.first) == ((0.0, 0.0, 0.0), 1.0, each.second)


@pytest.mark.parametrize("sides", [("seek", "patrol"), ("receiver.noise_v=0.001", "receiver.noise_v=2e-3")])
def test_difference_smaller_than_the_spread_is_found(sides: tuple[str, str], dataset: Dataset) -> None:
    first, second = pair_up(dataset.read(), *sides)
    assert len(first) == 2 * N_SEEDS
    assert first["seed"].tolist() == second["seed"].tolist()
    error = next(each for each in compare(first, second)[ALL] if each.name == "error (m)")
    assert error.n == N_SEEDS  # missions with the same seed have the same emissions
    assert error.change.value == pytest.approx(0.02, abs=1e-9)
    assert error.p < 0.001


def test_two_datasets_are_paired_by_mission(dataset: Dataset, tmp_path: Path) -> None:
    make_dataset(tmp_path / "b", 0.05)
    first, second = pair_up(dataset.read(), str(dataset.folder), str(tmp_path / "b"))
    assert len(first) == 4 * N_SEEDS
    assert (first["n_found"] != second["n_found"]).any()
    ospa = next(each for each in compare(first, second)[ALL] if each.name == "OSPA (m)")
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
