"""Statistics of a dataset: summaries with 95 % confidence intervals, and paired comparisons."""

from __future__ import annotations

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
"""Height below which sources have a coverage of their own, because reflections from the ground affect them most."""

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
    """Estimate a statistic of clustered values with a bootstrap interval that resamples whole clusters.

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
        - `bearing RMSE (deg)`: over missions with a single source
        - `found (%)`, `within 0.3 m (%)`: share of all sources that were found, and found with at most that error
        - `median error (m)` and its 95 % quantile `95 % below (m)`: distances of findings from their sources
        - `log score`: mean of minus the logarithm of the density stated for the position, over the found sources
        - `right site (%)`: share of the found sources whose finding names the right site first
        - `site log score`: mean of minus the logarithm of the probability stated for the site
        - `time to confirm (s)`: median time of the first right confirmation of a source
        - `path length over shortest`: median ratio of the path length until all sources were confirmed to the shortest
          one, over missions that found all sources and did not start within reach of them
        - `OSPA (m)`: mean OSPA distance between findings and sources
        - `false`, `contacts`, `missed`: numbers of findings without a source, of collisions and of waypoints that were
          not visited
        - `confirmed live`, `wrong live (%)`, `wrong live (s)`: number of findings that were confirmed at any time,
          share of those that were shown at a wrong place for more than 2 s, and the total time of that
        - `certified`, `false all-clear`: sites listed as inspected, and those of them with a source that was not found
        - `coverage 2-D 50 %` to `coverage 3-D 99.9 %`: share of the found sources in the ellipse and the ellipsoid that
          are stated to hold this share; with `below 1.5 m`, over the sources below that height
    """
    rows = rows.assign(group="" if pool else level_or_scenario(rows))
    if rows["group"].nunique() > 1 and (rows["suite"] != "").all():
        rows = pd.concat([rows, rows.assign(group=ALL)])
    names = ["group", "policy", "settings"]
    groups = rows.groupby(names, sort=False)
    return [{**dict(zip(names, values, strict=True)), **_summarise(members)} for values, members in groups]


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


def _summarise(missions: Frame) -> Summary:
    finished = missions[missions["status"] == "finished"]
    finished = finished.assign(
        path_ratio=finished["found_all_m"] / finished["shortest_m"],
        bearing_rmse_deg=np.degrees(finished["bearing_rmse_rad"].astype(np.float64)),
        n_near=_n_near(finished),
    )
    counts = {
        "false": "false_findings", "contacts": "contacts", "missed": "waypoints_missed",
        "confirmed live": "n_confirmations", "wrong live (s)": "wrong_s", "certified": "n_certified",
        "false all-clear": "n_false_all_clear",
    }  # fmt: skip
    return {
        "missions": len(missions),
        "unfinished": len(missions) - len(finished),
        "bearing RMSE (deg)": statistic_of(finished, "bearing_rmse_deg", root_mean_square),
        "found (%)": percentage_of(finished, "n_found", "n_sources"),
        "within 0.3 m (%)": percentage_of(finished, "n_near", "n_sources"),
        "median error (m)": statistic_of(finished, "errors_m", np.nanmedian),
        "95 % below (m)": Estimate(float(_numbers(finished, "errors_m").quantile(0.95))),
        "log score": statistic_of(finished, "log_scores", np.nanmean),
        "right site (%)": percentage_of(finished, "n_right_site", "n_found"),
        "site log score": statistic_of(finished, "site_log_scores", np.nanmean),
        "time to confirm (s)": statistic_of(finished, "confirmed_s", np.nanmedian),
        "path length over shortest": statistic_of(finished, "path_ratio", np.nanmedian),
        "OSPA (m)": statistic_of(finished, "ospa_m", np.nanmean),
        "wrong live (%)": percentage_of(finished, "n_wrong_confirmations", "n_confirmations"),
        **{name: round(finished[column].sum()) for name, column in counts.items()},
        **_coverages(finished),
    }


def _n_near(missions: Frame) -> Frame:
    """Return the number of sources of each mission that were found within `NEAR_M`."""
    return missions["errors_m"].map(lambda errors_m: int((np.asarray(errors_m) <= NEAR_M).sum()))


def _coverages(missions: Frame) -> dict[str, Estimate]:
    """Return the coverage of each stated share in percent, in 2-D and 3-D, over all sources and over the low ones."""
    lists = ["true_heights_m", "mahalanobis2_2d", "mahalanobis2_3d"]
    sources = missions[["scenario", "key", *lists]].explode(lists).dropna()
    coverages: dict[str, Estimate] = {}
    for of, members in (("", sources), (LOW, sources[sources["true_heights_m"] < LOW_M])):
        for n, share in product((2, 3), LEVELS):
            inside = members.assign(inside=members[f"mahalanobis2_{n}d"] <= stats.chi2.ppf(share, n), one=1)
            coverages[f"{COVERAGE} {n}-D {100 * share:g} %{of}"] = percentage_of(inside, "inside", "one")
    return coverages


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
    index, missions = missions.index, missions.reset_index(drop=True)

    def mean(numbers: Frame) -> Frame:
        return numbers.groupby(level=0).mean()

    distance2 = {n: _numbers(missions, f"mahalanobis2_{n}d") for n in (2, 3)}
    columns = {
        "found (%)": 100.0 * missions["n_found"] / missions["n_sources"],
        "within 0.3 m (%)": 100.0 * _n_near(missions) / missions["n_sources"],
        "error (m)": mean(_numbers(missions, "errors_m")),
        **{
            f"{COVERAGE} {n}-D 95 %": 100.0 * mean((d2 <= stats.chi2.ppf(0.95, n)).astype(float).where(d2.notna()))
            for n, d2 in distance2.items()
        },
        "log score": mean(_numbers(missions, "log_scores")),
        "right site (%)": 100.0 * missions["n_right_site"] / missions["n_found"],
        "site log score": mean(_numbers(missions, "site_log_scores")),
        "time to confirm (s)": mean(_numbers(missions, "confirmed_s")),
        "OSPA (m)": missions["ospa_m"],
        "false": missions["false_findings"],
        "wrong live": missions["n_wrong_confirmations"],
        "wrong live (s)": missions["wrong_s"],
        "certified": missions["n_certified"],
        "false all-clear": missions["n_false_all_clear"],
        "distance (m)": missions["distance_m"],
    }
    return pd.DataFrame(columns).set_index(index)


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
