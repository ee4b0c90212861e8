"""Whether the paper's numbers are those that its method gives, and what is known of those that are not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from pdpatrol.missions.reproduction.exhibit import Exhibit, Row
from pdpatrol.missions.reproduction.prediction import COVERAGE, PAPER_TRIALS, Prediction

OTHER_PROTOCOL = "elements 1 to 4 do better by the printed protocol; so they do in another implementation of it"

WORKED_BACK = "not printed, but worked back from rounded percentages of the text"
NO_SPECIAL_POSITION = "more than an array off by U(-0.06, 0.06) does; the paper calls no position special"
NO_APERTURE = "no one aperture fits all phase rows, and it is not printed"

WHY = {
    **{("table2", f"{snr_db} dB"): OTHER_PROTOCOL for snr_db in (5, 0, -5, -10)},
    **{("fig7", f"N = {n_elements}"): WORKED_BACK for n_elements in (2, 4, 6, 8)},
    **{("table3", f"7.5 m, {true_deg}°"): NO_SPECIAL_POSITION for true_deg in (-66, -10)},
    **{("sample_rate", f"{rate:g} GS/s, phase method"): NO_APERTURE for rate in (1, 0.5, 0.1)},
    ("sample_rate", "0.5 GS/s"): "between neighbours that fit; half the samples of 1 GS/s cannot cost so much",
}
"""What is known of cells that lie outside, by exhibit and label; said of those alone that do."""


class Miss(NamedTuple):
    """A number of the paper that lies where it should not.

    Attributes:
        exhibit: Its name in words.
        label: Of its row.
        unit: Of the numbers.
        printed: In the paper.
        predicted: Where it should lie.
        why: What is known of it; None if that is nothing.
    """

    exhibit: str
    label: str
    unit: str
    printed: float
    predicted: Prediction
    why: str | None

    def __str__(self) -> str:
        """In words."""
        low, high = (f"{end:.2f}" for end in self.predicted)
        return f"{self.exhibit}, {self.label}: {self.printed:g} printed, {low} to {high} {self.unit} predicted"


class Verdict(NamedTuple):
    """How many of the paper's numbers are where they should be.

    Attributes:
        n_compared: Numbers that can be held against a prediction.
        n_met: Those of them that lie in it.
        misses: The others, in the order of the exhibits.
    """

    n_compared: int
    n_met: int
    misses: tuple[Miss, ...]

    @property
    def by_chance(self) -> float:
        """How many would lie outside by chance alone."""
        return (1.0 - COVERAGE) * self.n_compared

    def __str__(self) -> str:
        """In a sentence or two."""
        told = (
            f"{self.n_met} of the {self.n_compared} numbers that the paper prints lie where {PAPER_TRIALS} trials by "
            f"its method put them in {100 * COVERAGE:.0f} of 100 cases"
        )
        if not self.misses:
            return f"{told}."
        return f"{told}; by chance alone some {self.by_chance:.0f} of them would not. Those that do not:"


def verdict(exhibits: Sequence[Exhibit]) -> Verdict:
    """The verdict on all exhibits."""
    compared = [(exhibit, row) for exhibit in exhibits for row in exhibit.rows if row.is_compared]
    misses = tuple(_miss(exhibit, row) for exhibit, row in compared if not row.is_met)
    return Verdict(len(compared), len(compared) - len(misses), misses)


def _miss(exhibit: Exhibit, row: Row) -> Miss:
    assert row.paper is not None
    assert row.predicted is not None
    label = row.label
    return Miss(exhibit.heading, label, row.unit, row.paper, row.predicted, WHY.get((exhibit.name, label)))
