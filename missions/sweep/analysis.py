"""Statistics of a dataset: summaries with 95 % confidence intervals, and paired comparisons."""

import json
from collections.abc import Callable, Sequence
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy import stats
from statsmodels.stats.proportion import proportion_confint

from dirmusic import InputFileError
from dirmusic.arrays import FloatArray, IntArray
from dirmusic.locating.finding import square_within
from pdpatrol.missions.sweep.dataset import MANIFEST, Dataset, Frame
from pdpatrol.missions.sweep.plan import parse_toml

CONFIDENCE = 0.95
ALL = "all"
"""Name of the group of all missions of a suite that share policy and settings."""

COVERAGE = "coverage"
"""First word of the names of coverages in a summary."""

CORRELATION = 0.1
"""Least correlation between trials of one cluster. Assumed: sweeps of the suite show 0 to 0.2 within a yard. It matters
where nearly all trials agree, since their correlation cannot be estimated there; 0.2 widens those intervals by a third.
"""

LEVELS = (0.5, 0.68, 0.9, 0.95, 0.99, 0.999)
"""Stated shares of ellipses and ellipsoids whose coverage is checked."""

LOW, LOW_M = " below 1.5 m", 1.5
"""Height below which sources have a separate coverage, because reflections from the ground affect them most."""

NEAR_M = 0.3
"""Horizontal error up to which a source counts as found near."""


class Estimate(NamedTuple):
    """Estimate with its 95 % confidence interval; NaN where there are too few data."""

    value: float
    low: float = np.nan
    high: float = np.nan


def wilson(count: float, total: float) -> Estimate:
    """Estimate a proportion of independent trials with Wilson's score interval; counts may be fractions."""
    ends: Any = proportion_confint(count, total, 1.0 - CONFIDENCE, "wilson")
    return Estimate(count / total, *ends)


def clustered_share(counts: ArrayLike, totals: ArrayLike) -> Estimate:
    """Estimate a proportion whose trials come in clusters, such as the sources in one yard.

    Trials of one cluster may succeed or fail together. Wilson's formula therefore takes the effective number of trials:
    their number divided by the design effect, which is the variance between clusters over that of independent trials,
    times (t / z)^2 with k - 1 degrees of freedom for k clusters (Korn and Graubard 1998), or that of the correlation
    `CORRELATION` (Kish 1965) if it is larger.

    Args:
        counts: Successes of each cluster, shape (k,).
        totals: Trials of each cluster, shape (k,); clusters without trials are ignored.
    """
    totals = np.asarray(totals, dtype=np.float64)
    counts = np.asarray(counts, dtype=np.float64)[totals > 0]
    totals = totals[totals > 0]
    k, n = totals.size, totals.sum()
    if k == 0:
        return Estimate(np.nan)
    share, design_effect = counts.sum() / n, 1.0 + CORRELATION * (np.square(totals).sum() / n - 1.0)
    if k > 1 and 0.0 < share < 1.0 and totals.max() > 1.0:
        z, t = (law.ppf(0.5 + 0.5 * CONFIDENCE) for law in (stats.norm, stats.t(k - 1)))
        between = k / (k - 1) * np.square(counts - share * totals).sum() / n**2
        design_effect = max(between / (share * (1.0 - share) / n) * (t / z) ** 2, design_effect)
    n_effective = max(n / design_effect, 1.0)
    return wilson(share * n_effective, n_effective)


def root_mean_square(values: FloatArray, axis: int | None = None) -> FloatArray:
    """Compute the root mean square of all values that are not NaN."""
    return np.sqrt(np.nanmean(np.square(values), axis=axis))


def cluster_bootstrap(
    clusters: Sequence[ArrayLike] | FloatArray, statistic: Callable[..., Any], n_resamples: int = 2000
) -> Estimate:
    """Estimate a statistic of clustered values with a bootstrap interval that resamples clusters.

    The percentiles are widened for few clusters (Hesterberg 2015, section 5.3). The seed is fixed, so that the same
    data give the same interval. Fewer than two clusters give no interval.

    Args:
        clusters: Values of each cluster; NaN, infinite values and empty clusters are ignored.
        statistic: Function of an array and an axis that ignores NaN, such as `np.nanmedian`.
        n_resamples: Number of bootstrap resamples.
    """
    arrays = [np.atleast_1d(np.asarray(each, np.float64)) for each in clusters]
    arrays = [values[np.isfinite(values)] for values in arrays if np.isfinite(values).any()]
    k = len(arrays)
    if k == 0:
        return Estimate(np.nan)
    padded = np.full((k, max(values.size for values in arrays)), np.nan)
    for row, values in zip(padded, arrays, strict=True):
        row[: values.size] = values
    value = float(statistic(padded))
    if k == 1:
        return Estimate(value)
    tail = stats.norm.cdf(-np.sqrt(k / (k - 1)) * stats.t(k - 1).ppf(0.5 + 0.5 * CONFIDENCE))

    def resampled(chosen: IntArray, axis: int) -> FloatArray:
        return statistic(padded[chosen].reshape(*chosen.shape[:-1], -1), axis=axis)

    result = stats.bootstrap(
        (np.arange(k),),
        resampled,
        n_resamples=n_resamples,
        batch=1 + 1_000_000 // padded.size,  # bounds the memory
        vectorized=True,
        confidence_level=1.0 - 2.0 * tail,
        method="percentile",
        rng=np.random.default_rng(0),
    )
    return Estimate(value, *map(float, result.confidence_interval))


SHARES = {
    "found (%)": ("n_found", "n_sources"),
    "within 0.3 m (%)": ("n_near", "n_sources"),
    "right site (%)": ("n_right_site", "n_found"),
    "possibly two (%)": ("n_possibly_two", "n_found"),
    "wrong live (%)": ("n_wrong_confirmations", "n_confirmations"),
}
"""Shares in a summary, each the ratio of the sums of two columns."""

COVERAGES = {
    f"{COVERAGE} {n}-D {100 * share:g} %{low}": (n, share, low) for low, n, share in product(("", LOW), (2, 3), LEVELS)
}
"""Dimension, stated share and restriction of each coverage in a summary."""

SHARES |= {name: (name, "n_low" if low else "n_found") for name, (_, _, low) in COVERAGES.items()}

STATISTICS = {
    "bearing RMSE (deg)": ("bearing_rmse_deg", root_mean_square),
    "median error (m)": ("errors_m", np.nanmedian),
    "log score": ("log_scores", np.nanmean),
    "site log score": ("site_log_scores", np.nanmean),
    "time to confirm (s)": ("confirmed_s", np.nanmedian),
    "path length over shortest": ("path_ratio", np.nanmedian),
    "distance (m)": ("distance_m", np.nanmean),
    "OSPA (m)": ("ospa_m", np.nanmean),
}
"""Statistics in a summary, each of a column of numbers or lists of numbers."""

COUNTS = {
    "false": "false_findings",
    "confirmed live": "n_confirmations",
    "wrong live (s)": "wrong_s",
    "certified": "n_certified",
    "false all-clear": "n_false_all_clear",
    "collisions": "contacts",
    "missed": "waypoints_missed",
}
"""Totals in a summary, each of a column."""

Summary = dict[str, "str | int | Estimate"]


def summarise_groups(rows: Frame, *, pool: bool = False) -> list[Summary]:
    """Summarise a dataset: groups in the order of the plan, then all levels of a suite together.

    The intervals treat the missions of one yard as a cluster, see `clusters_of`: they are valid for other yards of the
    same kind, or, in a group with a single yard, for other seeds in it.

    Args:
        rows: Rows of the dataset.
        pool: Merge all scenarios that share policy and settings into one group without a name.

    Returns:
        For each group its name, `policy`, `settings` (JSON), `missions`, and:

        - `unfinished`: missions that failed, hung, ran out of memory or died; no other figure includes them
        - `found (%)`, `within 0.3 m (%)`: share of all sources that were found, and found with at most that error
        - `right site (%)`: share of the found sources whose finding names the right site first
        - `possibly two (%)`: share of the found sources whose finding states that it is possibly two
        - `wrong live (%)`, `wrong live (s)`: share of the findings confirmed at any time, `confirmed live`, that were
          shown at a wrong place for more than 2 s, and the total time of that
        - `bearing RMSE (deg)`: over missions with a single source
        - `median error (m)` and its 95 % quantile `95 % below (m)`: distances of findings from their sources
        - `log score`, `site log score`: mean of minus the logarithm of the density stated at the true position, and
          of the probability stated for the true site
        - `time to confirm (s)`: median time of the first right confirmation of a source
        - `path length over shortest`: median ratio of the path length until all sources were confirmed to the shortest
          one, over missions that found all sources and did not start within reach of them
        - `distance (m)`, `OSPA (m)`: mean path length, and mean OSPA distance between findings and sources
        - `false`, `collisions`, `missed`: numbers of findings without a source, of collisions and of waypoints that
          were not visited
        - `certified`, `false all-clear`: sites listed as inspected, and those of them with a source that was not found
        - `COVERAGES`: share of the found sources in the ellipse or ellipsoid that is stated to hold a share
    """
    rows = _with_derived(rows.assign(group="" if pool else level_or_scenario(rows)))
    if rows["group"].nunique() > 1 and (rows["suite"] != "").all():
        rows = pd.concat([rows, rows.assign(group=ALL)])
    names = ["group", "policy", "settings"]
    groups = rows.groupby(names, sort=False)
    return [{**dict(zip(names, values, strict=True)), **_summarise(members)} for values, members in groups]


def _with_derived(missions: Frame) -> Frame:
    """Add columns that follow from others, among them the number of sources that each coverage counts."""
    missions = missions.reset_index(drop=True)
    sources = missions[["true_heights_m", "mahalanobis2_2d", "mahalanobis2_3d"]]
    sources = sources.explode(list(sources)).astype(np.float64)
    is_low = sources["true_heights_m"] < LOW_M
    inside = {
        name: (sources[f"mahalanobis2_{n}d"] <= square_within(share, n)) & (is_low | (not low))
        for name, (n, share, low) in COVERAGES.items()
    }
    return missions.assign(
        path_ratio=missions["found_all_m"] / missions["shortest_m"],
        bearing_rmse_deg=np.degrees(missions["bearing_rmse_rad"].astype(np.float64)),
        n_near=missions["errors_m"].map(lambda errors_m: np.sum(np.asarray(errors_m) <= NEAR_M)),
        **{name: values.groupby(level=0).sum() for name, values in {"n_low": is_low, **inside}.items()},
    )


def _summarise(missions: Frame) -> Summary:
    finished = missions[missions["status"] == "finished"]
    return {
        "missions": len(missions),
        "unfinished": len(missions) - len(finished),
        **{name: percentage_of(finished, *columns) for name, columns in SHARES.items()},
        **{name: statistic_of(finished, *arguments) for name, arguments in STATISTICS.items()},
        "95 % below (m)": Estimate(float(_numbers(finished, "errors_m").quantile(0.95))),
        **{name: round(finished[column].sum()) for name, column in COUNTS.items()},
    }


def level_or_scenario(rows: Frame) -> Frame:
    """Return the level of the suite that each mission belongs to, or else its scenario, as a `pandas.Series`."""
    return rows["level"].where(rows["level"] != "", rows["scenario"])


def clusters_of(missions: Frame) -> str:
    """Return the column that names the cluster of each mission: its yard, or itself if there is only one yard."""
    return "scenario" if missions["scenario"].nunique() > 1 else "key"


def percentage_of(missions: Frame, count: str, total: str) -> Estimate:
    """Estimate the sum of one column in percent of that of another, as `clustered_share` does."""
    sums = missions.groupby(clusters_of(missions), sort=False)[[count, total]].sum()
    return Estimate(*(100.0 * end for end in clustered_share(sums[count], sums[total])))


def statistic_of(missions: Frame, column: str, statistic: Callable[..., Any]) -> Estimate:
    """Estimate a statistic of a column of numbers or lists of numbers, as `cluster_bootstrap` does."""
    clusters = _numbers(missions.set_index(clusters_of(missions)), column).groupby(level=0, sort=False)
    return cluster_bootstrap([values.to_numpy() for _, values in clusters], statistic)


def _numbers(missions: Frame, column: str) -> Frame:
    """Return each number of a column of numbers or lists as a `pandas.Series`; NaN for null and empty lists."""
    return missions[column].explode().astype(np.float64)


def pair_up(rows: Frame, first: str, second: str) -> tuple[Frame, Frame]:
    """Select the finished missions of two sides of a sweep that agree in scenario, seed and everything else.

    Args:
        rows: Rows of the sweep.
        first: Policy, setting such as `receiver.noise_v=1e-3`, or folder of another dataset.
        second: Another policy, another value of the same key, or another folder.

    Returns:
        Missions of each side, in the same order; the first levels of their index are scenario and seed.

    Raises:
        InputFileError: If a side has no mission, or the two have none in common.
    """
    sides = [_side(rows, name) for name in (first, second)]
    if empty := [name for name, side in zip((first, second), sides, strict=True) if side.empty]:
        raise InputFileError([f"--compare: {name}: no mission of it in the dataset" for name in empty])
    common = sides[0].index.intersection(sides[1].index, sort=False)
    if common.empty:
        raise InputFileError([f"--compare: {first} and {second} have no scenario and seed in common"])
    return sides[0].loc[common], sides[1].loc[common]


def _side(rows: Frame, name: str) -> Frame:
    """Select the finished missions of one side, indexed by everything that both sides have in common."""
    key, is_setting, text = name.partition("=")
    if (Path(name) / MANIFEST).exists():
        rows, is_setting = Dataset(Path(name)).read(), ""
    elif not is_setting:
        rows = rows[rows["policy"] == name].assign(policy="")
    settings = rows["settings"].map(json.loads)
    if is_setting:
        value = parse_toml(text, text)
        settings = settings[[key in each and each.pop(key) == value for each in settings]]
        rows = rows.loc[settings.index]
    common = [rows["scenario"], rows["seed"], rows["policy"], settings.map(json.dumps)]
    side = rows.set_index(pd.MultiIndex.from_arrays(common))
    side = side[side["status"] == "finished"]
    return side[~side.index.duplicated(keep="last")]


class Difference(NamedTuple):
    """Paired comparison of one measure, over the missions in which both sides have a value.

    Attributes:
        name: Name of the measure, with its unit.
        n: Number of yards; of seeds, if there is only one yard. Their missions have the same sources and emissions on
            both sides, and are averaged first.
        first: Mean of the first side.
        second: Mean of the second side.
        change: Mean of second minus first, with its bootstrap interval.
        p: p-value of the paired permutation test of the mean change.
    """

    name: str
    n: int
    first: float
    second: float
    change: Estimate
    p: float


def compare(first: Frame, second: Frame) -> dict[str, list[Difference]]:
    """Compare all measures that at least one pair of missions has; `pair_up` returns the missions.

    Returns:
        Comparison for each level, if there are several of the suite, and last for all missions, `ALL`.
    """
    sides = [_measures(missions) for missions in (first, second)]
    level = first["level"].to_numpy()
    names = pd.unique(level)
    groups = {name: level == name for name in names if name and len(names) > 1} | {ALL: level == level}
    return {group: _compare(*(side[own] for side in sides)) for group, own in groups.items()}


def _compare(first: Frame, second: Frame) -> list[Difference]:
    by = [0] if first.index.get_level_values(0).nunique() > 1 else [0, 1]
    differences: list[Difference] = []
    for name in first:
        values = np.column_stack([first[name], second[name]])
        pairs: Frame = pd.DataFrame(values, first.index).dropna().groupby(level=by, sort=False).mean()
        if len(pairs):
            differences.append(difference(name, pairs.to_numpy()))
    return differences


def _measures(missions: Frame) -> Frame:
    """Return the measures of a paired comparison for each mission, with its index; NaN where it has none."""
    index, missions = missions.index, _with_derived(missions)
    names = [name for name in SHARES if name not in COVERAGES or COVERAGES[name][1] == CONFIDENCE]
    shares = {name: 100.0 * missions[SHARES[name][0]] / missions[SHARES[name][1]] for name in names}
    means = {
        name.removeprefix("median "): _numbers(missions, column).groupby(level=0).mean()
        for name, (column, _) in STATISTICS.items()
    }
    counts = {name: missions[column] for name, column in COUNTS.items()}
    return pd.DataFrame(shares | means | counts).set_index(index)


def difference(name: str, values: FloatArray) -> Difference:
    """Compare one measure; values of both sides have shape (n, 2), one row for each yard or seed."""
    change = values[:, 1] - values[:, 0]
    p, interval = 1.0, Estimate(0.0, 0.0, 0.0)
    if change.any():
        interval = cluster_bootstrap(change, np.nanmean)
    if change.any() and change.size > 1:  # with a single pair, both signs are equally likely
        test = stats.permutation_test(
            (change,), np.mean, permutation_type="samples", vectorized=True, n_resamples=9999, rng=0
        )
        p = float(test.pvalue)
    first, second = map(float, values.mean(axis=0))
    return Difference(name, len(values), first, second, interval, p)
