"""Statistics of a dataset: summaries with 95 % confidence intervals, and paired comparisons."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
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
    """Estimate a proportion whose trials come in clusters, such as the sources of one mission.

    Trials of one cluster may succeed or fail together. Wilson's formula therefore takes the effective number of
    trials: their number divided by the design effect (variance between clusters over that of independent trials), times
    (z / t)^2 with k - 1 degrees of freedom for k clusters (Korn and Graubard 1998). Where all trials have the same
    result, the design effect cannot be estimated and a cluster counts as a single trial.

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
    share = counts.sum() / n
    n_effective = float(k)
    if k > 1 and 0.0 < share < 1.0 and totals.max() > 1.0:
        between = k / (k - 1) * np.square(counts - share * totals).sum() / n**2
        design_effect = max(between / (share * (1.0 - share) / n), 1.0)
        z, t = (law.ppf(0.5 + 0.5 * CONFIDENCE) for law in (stats.norm, stats.t(k - 1)))
        n_effective = max(n / design_effect * (z / t) ** 2, 1.0)
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

    The intervals come from resampling missions: they are valid for other seeds in the same yards and, where each yard
    has one seed, for other yards of the same kind. With `pool`, they come from resampling yards and are always valid
    for other yards of the same kind.

    Args:
        rows: Rows of the dataset.
        pool: Merge all scenarios that share policy and settings into one group without a name.

    Returns:
        For each group its name, `policy`, `settings` (JSON), `missions`, and:

        - `unfinished`: missions that failed, hung, ran out of memory or died; no other figure includes them
        - `bearing RMSE (deg)`: over missions with a single source
        - `found (%)`: share of all sources that were found
        - `median error (m)` and its 95 % quantile `95 % below (m)`: distances of findings from their sources
        - `in ellipse (%)`: share of the found sources inside the 95 % ellipse of their finding
        - `right site (%)`: share of the found sources whose finding names the right site
        - `time to confirm (s)`: median over the found sources
        - `path length over shortest`: median ratio of the path length until all sources were confirmed to the shortest
          one, over missions that found all sources and did not start within reach of them
        - `OSPA (m)`: mean OSPA distance between findings and sources
        - `false`, `contacts`, `missed`: numbers of findings without a source, of collisions and of waypoints that were
          not visited
    """
    rows = rows.assign(group="" if pool else level_or_scenario(rows))
    if rows["group"].nunique() > 1 and (rows["suite"] != "").all():
        rows = pd.concat([rows, rows.assign(group=ALL)])
    names = ["group", "policy", "settings"]
    groups = rows.groupby(names, sort=False)
    return [
        {**dict(zip(names, values, strict=True)), **_summarise(members, "scenario" if pool else "key")}
        for values, members in groups
    ]


def level_or_scenario(rows: Frame) -> Frame:
    """Return the level of the suite that each mission belongs to, or else its scenario, as a `pandas.Series`."""
    return rows["level"].where(rows["level"] != "", rows["scenario"])


def percentage_of(missions: Frame, by: str, count: str, total: str) -> Estimate:
    """Estimate the sum of one column in percent of that of another, for clusters with equal values in column `by`."""
    sums = missions.groupby(by, sort=False)[[count, total]].sum()
    return Estimate(*(100.0 * end for end in clustered_share(sums[count], sums[total])))


def statistic_of(missions: Frame, by: str, column: str, statistic: Callable[..., Any]) -> Estimate:
    """Estimate a statistic of a column of numbers or lists of numbers, as `cluster_bootstrap` does."""
    clusters = _numbers(missions.set_index(by), column).groupby(level=0, sort=False)
    return cluster_bootstrap([values.to_numpy() for _, values in clusters], statistic)


def _numbers(missions: Frame, column: str) -> Frame:
    """Return each number of a column of numbers or lists as a `pandas.Series`; NaN for null and empty lists."""
    return missions[column].explode().astype(np.float64)


def _summarise(missions: Frame, by: str) -> Summary:
    finished = missions[missions["status"] == "finished"]
    finished = finished.assign(
        path_ratio=finished["found_all_m"] / finished["shortest_m"],
        bearing_rmse_deg=np.degrees(finished["bearing_rmse_rad"].astype(np.float64)),
    )
    return {
        "missions": len(missions),
        "unfinished": len(missions) - len(finished),
        "bearing RMSE (deg)": statistic_of(finished, by, "bearing_rmse_deg", root_mean_square),
        "found (%)": percentage_of(finished, by, "n_found", "n_sources"),
        "median error (m)": statistic_of(finished, by, "errors_m", np.nanmedian),
        "95 % below (m)": Estimate(float(_numbers(finished, "errors_m").quantile(0.95))),
        "in ellipse (%)": percentage_of(finished, by, "n_in_ellipse", "n_found"),
        "right site (%)": percentage_of(finished, by, "n_right_site", "n_found"),
        "time to confirm (s)": statistic_of(finished, by, "confirmed_s", np.nanmedian),
        "path length over shortest": statistic_of(finished, by, "path_ratio", np.nanmedian),
        "OSPA (m)": statistic_of(finished, by, "ospa_m", np.nanmean),
        "false": int(finished["false_findings"].sum()),
        "contacts": int(finished["contacts"].sum()),
        "missed": int(finished["waypoints_missed"].sum()),
    }


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
        n: Number of pairs of a scenario and a seed. Missions that share both have the same sources and emissions, so
            their differences are averaged first.
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


def compare(first: Frame, second: Frame) -> list[Difference]:
    """Compare all measures that at least one pair of missions has; `pair_up` returns the missions."""
    sides = [_measures(missions) for missions in (first, second)]
    differences: list[Difference] = []
    for name in sides[0]:
        values = np.column_stack([missions[name] for missions in sides])
        pairs: Frame = pd.DataFrame(values, first.index).dropna().groupby(level=[0, 1], sort=False).mean()
        if len(pairs):
            differences.append(difference(name, pairs.to_numpy()))
    return differences


def _measures(missions: Frame) -> Frame:
    """Return the measures of a paired comparison for each mission; NaN where it has none."""
    missions = missions.reset_index(drop=True)
    error_m, confirmed_s = (_numbers(missions, name).groupby(level=0).mean() for name in ("errors_m", "confirmed_s"))
    return pd.DataFrame(
        {
            "found (%)": 100.0 * missions["n_found"] / missions["n_sources"],
            "in ellipse (%)": 100.0 * missions["n_in_ellipse"] / missions["n_found"],
            "right site (%)": 100.0 * missions["n_right_site"] / missions["n_found"],
            "OSPA (m)": missions["ospa_m"],
            "error (m)": error_m,
            "time to confirm (s)": confirmed_s,
            "false findings": missions["false_findings"],
            "distance (m)": missions["distance_m"],
        }
    )


def difference(name: str, values: FloatArray) -> Difference:
    """Compare one measure; values of both sides have shape (n, 2), one row for each scenario and seed."""
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
