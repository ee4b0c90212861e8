"""Two sides of one sweep, or two sweeps, compared mission by mission: the same scenario and seed on both sides.

Both sides meet the same sources, array and emissions, so that most of what differs between missions cancels.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from dirmusic import InputFileError
from pdpatrol.missions.sweep.dataset import MANIFEST, Dataset
from pdpatrol.missions.sweep.results.intervals import Interval, bootstrap_interval

FloatArray = NDArray[np.float64]
Row = Mapping[str, Any]

RESAMPLES = 9999
"""Random swaps of sides behind the probability of the permutation test."""


class Measure(NamedTuple):
    """What is compared.

    Attributes:
        name: With its unit.
        of_mission: Its value in a mission; NaN where it has none.
        is_better: 1 if more is better, -1 if less is.
    """

    name: str
    of_mission: Callable[[Row], float]
    is_better: int


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if values else float("nan")


def _percentage(count: int, total: int) -> float:
    return 100.0 * count / total if total else float("nan")


MEASURES = (
    Measure("found (%)", lambda row: _percentage(row["n_found"], row["n_sources"]), 1),
    Measure("right site (%)", lambda row: _percentage(row["n_right_site"], row["n_found"]), 1),
    Measure("OSPA (m)", lambda row: np.nan if row["ospa_m"] is None else row["ospa_m"], -1),
    Measure("error (m)", lambda row: _mean(row["errors_m"]), -1),
    Measure("time to confirm (s)", lambda row: _mean(row["confirmed_s"]), -1),
    Measure("false findings", lambda row: row["false_findings"], -1),
    Measure("distance (m)", lambda row: np.nan if row["distance_m"] is None else row["distance_m"], -1),
)


class Difference(NamedTuple):
    """One measure on both sides, over the missions in which both have a value.

    Attributes:
        name: Of the measure, with its unit.
        n_pairs: Missions that both sides have.
        first: Mean of the first side.
        second: Mean of the second side.
        change: Mean of second minus first, with its 95 % bootstrap interval over the pairs.
        permutation_p: How probable a change at least so large is if the sides are alike (paired permutation test).
        n_first_better: Pairs in which the first side is better.
        n_second_better: Pairs in which the second side is better.
        sign_p: How probable shares at least so uneven are if the sides are alike (sign test).
    """

    name: str
    n_pairs: int
    first: float
    second: float
    change: Interval
    permutation_p: float
    n_first_better: int
    n_second_better: int
    sign_p: float


class Pair(NamedTuple):
    """One mission on both sides."""

    first: Row
    second: Row

    @property
    def has_flipped(self) -> bool:
        """Whether one side found more than the other."""
        return self.first["n_found"] != self.second["n_found"]


def pair_up(rows: pa.Table, first: str, second: str) -> list[Pair]:
    """The missions that two sides of a sweep have in common, in order.

    Args:
        rows: Of the sweep.
        first: A policy, a setting as `receiver.noise_v=1e-3`, or the folder of another dataset.
        second: Another policy, another value of the same key, or another folder.

    Raises:
        InputFileError: If a side has no mission, or the two have none in common.
    """
    sides = [_side(rows, name) for name in (first, second)]
    faults = [
        f"--compare: {name}: no mission of it in the dataset"
        for name, side in zip((first, second), sides, strict=True)
        if not side
    ]
    if faults:
        raise InputFileError(faults)
    pairs = [Pair(row, sides[1][key]) for key, row in sides[0].items() if key in sides[1]]
    if not pairs:
        raise InputFileError([f"--compare: {first} and {second} have no scenario and seed in common"])
    return pairs


def _side(rows: pa.Table, name: str) -> dict[tuple[Any, ...], Row]:
    """Finished missions of one side, by what both sides have in common."""
    if (Path(name) / MANIFEST).exists():
        chosen = Dataset(Path(name)).read().to_pylist()
        return {_common(row): row for row in chosen if row["status"] == "finished"}
    finished = [row for row in rows.to_pylist() if row["status"] == "finished"]
    key, equals, value = name.partition("=")
    if not equals:
        return {_common(row, policy=False): row for row in finished if row["policy"] == name}
    return {
        _common(row, key): row
        for row in finished
        if key in (settings := json.loads(row["settings"])) and _reads_as(settings[key], value)
    }


def _reads_as(value: object, text: str) -> bool:
    """Whether a text stands for a value."""
    try:
        return value == json.loads(text)
    except ValueError:
        return value == text


def _common(row: Row, without: str = "", *, policy: bool = True) -> tuple[Any, ...]:
    settings = {key: value for key, value in json.loads(row["settings"]).items() if key != without}
    return row["scenario"], json.dumps(settings, sort_keys=True), row["policy"] if policy else "", row["seed"]


def compare(pairs: Sequence[Pair]) -> list[Difference]:
    """All measures that any pair has."""
    found: list[Difference] = []
    for measure in MEASURES:
        values = np.array([[measure.of_mission(side) for side in pair] for pair in pairs], dtype=np.float64)
        values = values[np.isfinite(values).all(axis=-1)]
        if len(values):
            found.append(difference(measure, values))
    return found


def difference(measure: Measure, values: FloatArray) -> Difference:
    """One measure; values of shape (n_pairs, 2)."""
    from scipy.stats import binomtest, permutation_test

    change = values[:, 1] - values[:, 0]
    better = np.sign(change) * measure.is_better
    n_first, n_second = int((better < 0).sum()), int((better > 0).sum())
    permutation_p, sign_p, interval = 1.0, 1.0, Interval(0.0, 0.0, 0.0)
    if change.any():
        sign_p, interval = float(binomtest(n_first, n_first + n_second).pvalue), bootstrap_interval(change, np.mean)
    if change.any() and change.size > 1:  # a single pair is as likely either way round
        permuted = permutation_test(
            (change,), lambda x, axis: np.mean(x, axis=axis), permutation_type="samples", vectorized=True,
            n_resamples=RESAMPLES, rng=0,
        )  # fmt: skip
        permutation_p = float(permuted.pvalue)
    first, second = values.mean(axis=0)
    return Difference(
        measure.name, len(values), float(first), float(second), interval, permutation_p, n_first, n_second, sign_p
    )
