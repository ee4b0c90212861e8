"""An exhibit: numbers of the paper beside ours, with their intervals; and the trials they come from."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest, chi2

from pdpatrol.missions.reproduction.methods import SUCCESS_DEG, is_success
from pdpatrol.missions.reproduction.prediction import Prediction
from pdpatrol.missions.reproduction.protocol import GRID_DEG

FloatArray = NDArray[np.float64]

Tick = Callable[[int], None]
"""Told how many trials were done."""


CHUNK = 200
"""Trials drawn at once: what bounds the memory, and part of what a seed means."""


@cache
def published() -> dict[str, Any]:
    """Every number that the paper prints, as data."""
    return json.loads(Path(__file__).with_name("published.json").read_text(encoding="utf-8"))


@dataclass(frozen=True, kw_only=True)
class Measured:
    """A measured number, of how many trials, with its 95 % interval where it has one."""

    value: float
    n: int
    low: float | None = None
    high: float | None = None

    @classmethod
    def share(cls, is_hit: NDArray[np.bool_]) -> Measured:
        """Per cent of hits, with the exact binomial interval."""
        hits, n = int(is_hit.sum()), is_hit.size
        interval = binomtest(hits, n).proportion_ci(0.95, method="exact")
        return cls(value=100.0 * hits / n, n=n, low=100.0 * interval.low, high=100.0 * interval.high)

    @classmethod
    def spread(cls, errors: FloatArray, scale: float = 1.0) -> Measured:
        """Root mean square of errors about their mean, over `scale`, with the interval of a normal sample."""
        return cls._of_deviation(float(errors.std()) / scale, errors.size, errors.size - 1)

    @classmethod
    def rms(cls, errors: FloatArray, scale: float = 1.0) -> Measured:
        """Root mean square of errors over `scale`, with the interval of a normal sample."""
        return cls._of_deviation(float(np.sqrt(np.square(errors).mean())) / scale, errors.size, errors.size)

    @classmethod
    def _of_deviation(cls, value: float, n: int, degrees: int) -> Measured:
        low, high = (value * float(np.sqrt(degrees / chi2.ppf(q, degrees))) for q in (0.975, 0.025))
        return cls(value=value, n=n, low=low, high=high)


@dataclass(frozen=True, kw_only=True)
class Row:
    """One number of the paper beside ours.

    Attributes:
        label: What it is.
        paper: As printed; None where the paper has none.
        predicted: Where `paper` should lie by what was measured here; None where nothing can be said of it.
        paper_method: Ours, by the paper's method.
        best_method: Ours, by the best method under the same scoring.
        unrounded: The best method's refined peak, not rounded to the grid, under |error| <= 2 degrees.
        unit: Of all of them.
    """

    label: str
    paper: float | None = None
    paper_method: Measured | None = None
    best_method: Measured | None = None
    unrounded: Measured | None = None
    predicted: Prediction | None = None
    unit: str = "%"

    @property
    def is_compared(self) -> bool:
        """Whether the paper has a number that can be held against a prediction."""
        return self.paper is not None and self.predicted is not None

    @property
    def is_met(self) -> bool:
        """Whether that number lies where it should."""
        return self.paper is not None and self.predicted is not None and self.predicted.holds(self.paper)


@dataclass(frozen=True, kw_only=True)
class Exhibit:
    """A table or figure of the paper, or what it lacks.

    Attributes:
        name: Its key in the JSON file.
        title: What it shows: its name in words, a colon, and the rest.
        rows: The numbers.
        notes: What was done, what is a slip of the paper, what cannot be matched and why.
        results: Further numbers by name.
        data: What its picture needs besides; not part of the JSON file.
    """

    name: str
    title: str
    rows: tuple[Row, ...]
    notes: tuple[str, ...] = ()
    results: dict[str, float] = field(default_factory=dict[str, float])
    data: dict[str, Any] = field(default_factory=dict[str, Any])

    @property
    def heading(self) -> str:
        """Its name in words, such as `Table 1`."""
        return self.title.partition(":")[0]


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """How many trials, which seed, and who is told of progress.

    Attributes:
        trials: Of each cell.
        seed: Each cell has a stream of its own, so that no cell depends on another.
        tick: Told how many trials were done.
    """

    trials: int
    seed: int
    tick: Tick

    def rng(self, exhibit: int, cell: int) -> np.random.Generator:
        """The stream of one cell."""
        return np.random.default_rng([self.seed, exhibit, cell])

    def chunks(self) -> Iterator[int]:
        """Sizes of the chunks, progress told after each."""
        done = 0
        while done < self.trials:
            n = min(CHUNK, self.trials - done)
            yield n
            done += n
            self.tick(n)


def directions(n: int, rng: np.random.Generator) -> FloatArray:
    """Integer true directions on the paper's grid, degrees."""
    return rng.integers(GRID_DEG[0], GRID_DEG[-1] + 1, n).astype(np.float64)


def accuracy_row(label: str, paper: float | None, by_paper_deg: FloatArray, best_deg: FloatArray) -> Row:
    """A row of shares of success from errors in degrees; those of the paper's method are on the grid already."""
    return Row(
        label=label,
        paper=paper,
        paper_method=Measured.share(is_success(by_paper_deg)),
        best_method=Measured.share(is_success(best_deg)),
        unrounded=Measured.share(np.abs(best_deg) <= SUCCESS_DEG),
        predicted=Prediction.of_share(is_success(by_paper_deg)),
    )
