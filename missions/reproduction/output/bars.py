"""What the pictures share: sizes, colours, and bars of the paper's numbers beside ours."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pdpatrol.missions.reproduction.exhibit import Measured, Row

FloatArray = NDArray[np.float64]

PAPER, OURS, BEST, LIMIT = "#8a8f98", "#2f6db3", "#e0762b", "#222222"
DPI = 140
ELEMENT_COLOURS = ("#c8443a", "#d99a2b", "#8fa832", "#2f9e6b", "#2f6db3", "#8a53b5")


def new_figure(width: float, height: float) -> Figure:
    """An empty figure, sizes in inches."""
    return Figure(figsize=(width, height), dpi=DPI, layout="constrained")


def draw_bars(axes: Axes, rows: Sequence[Row], labels: Sequence[str] | None = None, unit: str = "%") -> None:
    """Paper, ours and best side by side, with the intervals of ours."""
    place = np.arange(len(rows))
    series: tuple[tuple[str, str, list[float | Measured | None]], ...] = (
        ("paper", PAPER, [row.paper for row in rows]),
        ("ours, paper's method", OURS, [row.paper_method for row in rows]),
        ("ours, best method", BEST, [row.best_method for row in rows]),
    )
    for shift, (label, colour, values) in zip((-0.27, 0.0, 0.27), series, strict=True):
        shown = [(x, v) for x, v in zip(place + shift, values, strict=True) if v is not None]
        heights = [v.value if isinstance(v, Measured) else v for _, v in shown]
        errors: FloatArray | None = None
        if any(isinstance(v, Measured) for _, v in shown):
            errors = np.array(
                [
                    (v.value - v.low, v.high - v.value)
                    if isinstance(v, Measured) and v.low is not None and v.high is not None
                    else (0.0, 0.0)
                    for _, v in shown
                ]
            ).T
        axes.bar([x for x, _ in shown], heights, 0.25, color=colour, yerr=errors, capsize=2, label=label)
        for (x, value), height in zip(shown, heights, strict=True):
            top = value.high if isinstance(value, Measured) and value.high is not None else height
            axes.annotate(
                f"{height:.3g}", (x, top), (0, 4), textcoords="offset points", ha="center", fontsize=6, rotation=90
            )
    axes.set_xticks(place, labels or [row.label for row in rows], fontsize=8)
    axes.set_ylabel("accuracy (%)" if unit == "%" else f"({unit})")
    axes.set_ylim(0, 122 if unit == "%" else 1.25 * axes.get_ylim()[1])
    axes.legend(fontsize=7, loc="upper right" if unit == "%" else "upper left", ncols=3, frameon=False)
