"""The learning curve as a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

LEARNED, BY_HAND, AT_RANDOM = "#2f6db3", "#e0762b", "#8a8f98"


def draw_curve(curve: Sequence[Mapping[str, float]], policies: Mapping[str, Mapping[str, Any]], path: Path) -> None:
    """Draw success over training steps, with the hand-written policy and the random one as levels.

    Args:
        curve: `steps`, `success` and `yards` of each point.
        policies: Summaries of the final evaluation by name: `ppo`, `towards_last_bearing`, `random`.
        path: Of the PNG.
    """
    figure = Figure(figsize=(8, 3.6), layout="constrained")
    axes = figure.add_subplot()
    n_yards = policies["ppo"]["yards"]
    for name, colour, label in (
        ("towards_last_bearing", BY_HAND, "by hand: towards the last bearing"),
        ("random", AT_RANDOM, "random"),
    ):
        success = policies[name]["success"]
        axes.axhline(success, color=colour, ls="--", label=f"{label}, {success:.1%} of {n_yards} yards")
    thousands = [point["steps"] / 1000 for point in curve]
    label = f"PPO as it learns, in {curve[0]['yards']} other yards"
    axes.plot(thousands, [point["success"] for point in curve], color=LEARNED, marker="o", ms=3.5, label=label)
    final = policies["ppo"]["success"]
    axes.plot(thousands[-1], final, "s", color=LEARNED, label=f"PPO at the end, {final:.1%} of {n_yards} yards")
    axes.set(
        xlabel="training steps, thousands", ylabel="open yards in which it\nreached the source", ylim=(-0.03, 1.06)
    )
    axes.set_xlim(left=0)
    axes.yaxis.set_major_formatter(PercentFormatter(1.0))
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.3)
    axes.legend(loc="center right", framealpha=1.0, edgecolor="none")
    figure.savefig(path, dpi=140, format="png")
