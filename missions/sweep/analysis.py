"""Statistics of a dataset: summaries with 95 % confidence intervals, and paired comparisons."""

from __future__ import annotations

import json
from collections.abc import Callable, Hashable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from dirmusic import InputFileError
from pdpatrol.missions.sweep.dataset import MANIFEST, Dataset

FloatArray = NDArray[np.float64]
Row = Mapping[str, Any]

CONFIDENCE = 0.95
ALL = "all"
"""Name of the group of all missions of a suite that share policy and settings."""


class Estimate(NamedTuple):
    """Estimate with its 95 % confidence interval; NaN where there are too few data."""

    value: float
    low: float
    high: float


NO_DATA = Estimate(np.nan, np.nan, np.nan)


def wilson(count: float, total: float) -> Estimate:
    """Estimate a proportion of independent trials with Wilson's score interval; counts may be fractions."""
    share, z = count / total, stats.norm.ppf(0.5 + 0.5 * CONFIDENCE)
    centre, scale = share + z**2 / (2 * total), 1.0 + z**2 / total
    half_width = z * np.sqrt(share * (1.0 - share) / total + z**2 / (4 * total**2))
    low, high = np.clip([(centre - half_width) / scale, (centre + half_width) / scale], 0.0, 1.0)
    return Estimate(share, min(float(low), share), max(float(high), share))


def clustered_share(counts: ArrayLike, totals: ArrayLike) -> Estimate:
    """Estimate a proportion whose trials come in clusters, such as the sources of one mission.

    Trials of one cluster may succeed or fail together. Wilson's formula therefore takes the effective number of
    trials: their number over the design effect (variance between clusters over that of independent trials), times
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
        return NO_DATA
    share = counts.sum() / n
    n_effective = float(k)
    if k > 1 and 0.0 < share < 1.0 and totals.max() > 1.0:
        between = k / (k - 1) * np.square(counts - share * totals).sum() / n**2
        design_effect = max(between / (share * (1.0 - share) / n), 1.0)
        z, t = (law.ppf(0.5 + 0.5 * CONFIDENCE) for law in (stats.norm, stats.t(k - 1)))
        n_effective = max(n / design_effect * (z / t) ** 2, 1.0)
    return wilson(share * n_effective, n_effective)


def median(values: FloatArray, weights: FloatArray) -> FloatArray:
    """Compute medians of ascending values, shape (n,), each repeated `weights` times, shape (m, n)."""
    cumulative = weights.cumsum(axis=1)
    half = 0.5 * cumulative[:, -1:]
    return 0.5 * (values[(cumulative >= half).argmax(axis=1)] + values[(cumulative > half).argmax(axis=1)])


def mean(values: FloatArray, weights: FloatArray) -> FloatArray:
    """Compute means of values, shape (n,), each repeated `weights` times, shape (m, n)."""
    return weights @ values / weights.sum(axis=1)


def root_mean_square(values: FloatArray, weights: FloatArray) -> FloatArray:
    """Compute root mean squares of values, shape (n,), each repeated `weights` times, shape (m, n)."""
    return np.sqrt(mean(values**2, weights))


def cluster_bootstrap(
    clusters: Sequence[ArrayLike] | FloatArray,
    statistic: Callable[[FloatArray, FloatArray], FloatArray],
    n_resamples: int = 2000,
) -> Estimate:
    """Estimate a statistic of clustered values with a bootstrap interval that resamples whole clusters.

    The percentiles are widened for few clusters (Hesterberg 2015, section 5.3). The generator is fixed, so that the
    same data give the same interval. Fewer than two clusters give no interval.

    Args:
        clusters: Values of each cluster; NaN and empty clusters are ignored.
        statistic: `median`, `mean` or `root_mean_square`.
        n_resamples: Number of bootstrap resamples.
    """
    arrays = [np.atleast_1d(np.asarray(each, np.float64)) for each in clusters]
    arrays = [values[np.isfinite(values)] for values in arrays if np.isfinite(values).any()]
    k = len(arrays)
    if k == 0:
        return NO_DATA
    values, cluster = np.concatenate(arrays), np.repeat(np.arange(k), [each.size for each in arrays])
    order = np.argsort(values)
    values, cluster = values[order], cluster[order]
    value = float(statistic(values, np.ones((1, values.size)))[0])
    if k == 1:
        return Estimate(value, np.nan, np.nan)
    tail = stats.norm.cdf(-np.sqrt(k / (k - 1)) * stats.t(k - 1).ppf(0.5 + 0.5 * CONFIDENCE))
    rng, resampled = np.random.default_rng(0), list[FloatArray]()
    for chosen in np.array_split(rng.integers(k, size=(n_resamples, k)), 1 + n_resamples * values.size // 1_000_000):
        m = len(chosen)
        times = np.bincount((chosen + k * np.arange(m)[:, np.newaxis]).ravel(), minlength=m * k).reshape(m, k)
        resampled.append(statistic(values, times[:, cluster].astype(np.float64)))
    low, high = np.quantile(np.concatenate(resampled), [tail, 1.0 - tail])
    return Estimate(value, float(low), float(high))


Summary = dict[str, "str | int | Estimate"]

DIGITS = {
    "bearing RMSE (deg)": 2,
    "found (%)": 0,
    "median error (m)": 3,
    "95 % below (m)": 3,
    "in ellipse (%)": 0,
    "right site (%)": 0,
    "time to confirm (s)": 0,
    "path length over shortest": 1,
    "OSPA (m)": 2,
}
"""Columns of a summary that hold an `Estimate`, and their decimals in tables."""


def summarise_groups(rows: pa.Table, *, pool: bool = False) -> list[Summary]:
    """Summarise a dataset: groups in the order of the plan, then all levels of a suite together.

    The intervals resample missions: they hold for other seeds in the same yards, and where each yard has one seed, for
    other yards of the same kind. With `pool` they resample yards, and always hold for other yards of the same kind.

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
        - `path length over shortest`: median path length until all sources were confirmed over the shortest one, over
          missions that found all sources and did not start within reach of them
        - `OSPA (m)`: mean OSPA distance between findings and sources
        - `false`, `contacts`, `missed`: numbers of findings without a source, of collisions and of waypoints that were
          not visited
    """
    groups: dict[tuple[str, str, str], list[Row]] = {}
    listed: list[Row] = rows.to_pylist()
    for row in listed:
        groups.setdefault(("" if pool else group_of(row), row["policy"], row["settings"]), []).append(row)
    if len({group for group, _, _ in groups}) > 1 and all(row["suite"] for row in listed):
        for row in listed:
            groups.setdefault((ALL, row["policy"], row["settings"]), []).append(row)
    by = "scenario" if pool else "key"
    return [
        {"group": group, "policy": policy, "settings": settings, **_summarise(members, by)}
        for (group, policy, settings), members in groups.items()
    ]


def group_of(row: Row) -> str:
    """Return the level of the suite that a row belongs to, or else its scenario."""
    return row["level"] or row["scenario"]


def clusters_of(rows: Sequence[Row], by: str) -> list[list[Row]]:
    """Group finished missions that have the same value in a column."""
    clusters: dict[Hashable, list[Row]] = {}
    for row in rows:
        if row["status"] == "finished":
            clusters.setdefault(row[by], []).append(row)
    return list(clusters.values())


def percentage_of(clusters: Sequence[Sequence[Row]], count: str, total: str) -> Estimate:
    """Estimate the sum of one column in percent of that of another."""
    counts, totals = ([sum(row[name] for row in members) for members in clusters] for name in (count, total))
    return Estimate(*(100.0 * end for end in clustered_share(counts, totals)))


def values_of(clusters: Sequence[Sequence[Row]], column: str) -> list[FloatArray]:
    """Return all values of a column of numbers or lists of numbers, one array for each cluster; NaN for null."""
    return [np.hstack([np.array(row[column], dtype=np.float64) for row in members]) for members in clusters]


def _summarise(rows: Sequence[Row], by: str) -> Summary:
    clusters = clusters_of(rows, by)
    finished = [row for members in clusters for row in members]
    errors_m = values_of(clusters, "errors_m")
    bearing_rmse_rad = cluster_bootstrap(values_of(clusters, "bearing_rmse_rad"), root_mean_square)
    path_ratios = [[_ratio(row["found_all_m"], row["shortest_m"]) for row in members] for members in clusters]
    return {
        "missions": len(rows),
        "unfinished": len(rows) - len(finished),
        "bearing RMSE (deg)": Estimate(*np.degrees(bearing_rmse_rad)),
        "found (%)": percentage_of(clusters, "n_found", "n_sources"),
        "median error (m)": cluster_bootstrap(errors_m, median),
        "95 % below (m)": Estimate(_quantile95(errors_m), np.nan, np.nan),
        "in ellipse (%)": percentage_of(clusters, "n_in_ellipse", "n_found"),
        "right site (%)": percentage_of(clusters, "n_right_site", "n_found"),
        "time to confirm (s)": cluster_bootstrap(values_of(clusters, "confirmed_s"), median),
        "path length over shortest": cluster_bootstrap(path_ratios, median),
        "OSPA (m)": cluster_bootstrap(values_of(clusters, "ospa_m"), mean),
        "false": sum(row["false_findings"] for row in finished),
        "contacts": sum(row["contacts"] for row in finished),
        "missed": sum(row["waypoints_missed"] for row in finished),
    }


def _quantile95(clusters: Sequence[FloatArray]) -> float:
    values = np.concatenate([[], *clusters])
    return float(np.quantile(values, 0.95)) if values.size else np.nan


def _ratio(part: float | None, whole: float | None) -> float:
    return part / whole if part is not None and whole else np.nan


def _mean_of(values: Sequence[float]) -> float:
    return float(np.mean(values)) if values else np.nan


MEASURES: Mapping[str, tuple[Callable[[Row], float | None], int]] = {
    "found (%)": (lambda row: 100.0 * _ratio(row["n_found"], row["n_sources"]), 1),
    "right site (%)": (lambda row: 100.0 * _ratio(row["n_right_site"], row["n_found"]), 1),
    "OSPA (m)": (lambda row: row["ospa_m"], -1),
    "error (m)": (lambda row: _mean_of(row["errors_m"]), -1),
    "time to confirm (s)": (lambda row: _mean_of(row["confirmed_s"]), -1),
    "false findings": (lambda row: row["false_findings"], -1),
    "distance (m)": (lambda row: row["distance_m"], -1),
}
"""Measures of a paired comparison: the value of a mission, NaN or None if it has none; 1 if more is better, else -1."""


class Difference(NamedTuple):
    """Paired comparison of one measure, over the missions in which both sides have a value.

    Attributes:
        name: Name of the measure, with its unit.
        n: Number of pairs of a scenario and a seed. Missions that share both meet the same sources and emissions, so
            that their differences are averaged first.
        first: Mean of the first side.
        second: Mean of the second side.
        change: Mean of second minus first, with its bootstrap interval.
        p: p-value of the paired permutation test of the mean change.
        n_first_better: Number of pairs in which the first side is better.
        n_second_better: Number of pairs in which the second side is better.
    """

    name: str
    n: int
    first: float
    second: float
    change: Estimate
    p: float
    n_first_better: int
    n_second_better: int


def pair_up(rows: pa.Table, first: str, second: str) -> list[tuple[Row, Row]]:
    """Pair the finished missions of two sides of a sweep that share scenario, seed and everything else.

    Args:
        rows: Rows of the sweep.
        first: Policy, setting such as `receiver.noise_v=1e-3`, or folder of another dataset.
        second: Another policy, another value of the same key, or another folder.

    Raises:
        InputFileError: If a side has no mission, or the two have none in common.
    """
    sides = {name: _side(rows, name) for name in (first, second)}
    if empty := [f"--compare: {name}: no mission of it in the dataset" for name, side in sides.items() if not side]:
        raise InputFileError(empty)
    pairs = [(row, sides[second][key]) for key, row in sides[first].items() if key in sides[second]]
    if not pairs:
        raise InputFileError([f"--compare: {first} and {second} have no scenario and seed in common"])
    return pairs


def _side(rows: pa.Table, name: str) -> dict[Hashable, Row]:
    """Select the finished missions of one side, by everything that both sides have in common."""
    if (Path(name) / MANIFEST).exists():
        rows = Dataset(Path(name)).read()
        return {_common(row): row for row in rows.to_pylist() if row["status"] == "finished"}
    key, is_setting, value = name.partition("=")
    side: dict[Hashable, Row] = {}
    for row in rows.to_pylist():
        settings = json.loads(row["settings"])
        is_chosen = key in settings and _matches(settings[key], value) if is_setting else row["policy"] == name
        if is_chosen and row["status"] == "finished":
            side[_common(row, key) if is_setting else _common({**row, "policy": ""})] = row
    return side


def _matches(value: object, text: str) -> bool:
    try:
        return value == json.loads(text)
    except ValueError:
        return value == text


def _common(row: Row, ignored_setting: str = "") -> Hashable:
    settings = {key: value for key, value in json.loads(row["settings"]).items() if key != ignored_setting}
    return row["scenario"], json.dumps(settings, sort_keys=True), row["policy"], row["seed"]


def compare(pairs: Sequence[tuple[Row, Row]]) -> list[Difference]:
    """Compare all measures that at least one pair has."""
    differences: list[Difference] = []
    for name, (of_mission, better_sign) in MEASURES.items():
        clusters: dict[Hashable, list[FloatArray]] = {}
        for pair in pairs:
            values = np.array([of_mission(side) for side in pair], dtype=np.float64)
            if np.isfinite(values).all():
                clusters.setdefault((pair[0]["scenario"], pair[0]["seed"]), []).append(values)
        if clusters:
            means = np.array([np.mean(values, axis=0) for values in clusters.values()])
            differences.append(difference(name, means, better_sign))
    return differences


def difference(name: str, values: FloatArray, better_sign: int) -> Difference:
    """Compare one measure; values of shape (n, 2), one row for each scenario and seed."""
    change = values[:, 1] - values[:, 0]
    better = np.sign(change) * better_sign
    n_first, n_second = int((better < 0).sum()), int((better > 0).sum())
    p, interval = 1.0, Estimate(0.0, 0.0, 0.0)
    if change.any():
        interval = cluster_bootstrap(change, mean)
    if change.any() and change.size > 1:  # with a single pair, both signs are equally likely
        test = stats.permutation_test(
            (change,), np.mean, permutation_type="samples", vectorized=True, n_resamples=9999, rng=0
        )
        p = float(test.pvalue)
    first, second = values.mean(axis=0)
    return Difference(name, len(values), float(first), float(second), interval, p, n_first, n_second)
