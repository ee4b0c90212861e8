"""Compute figures of merit of patterns, and draw them."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.projections.polar import PolarAxes
from moments import FINE_DEG, FloatArray, Pattern

REFERENCE_GHZ = 1.75
"""Centre of the frequency band of the array."""
SHOWN_GHZ = (1.3, 1.6, 1.8, 2.0, 2.3)
FLOOR_DB, CEILING_DB = -30.0, 3.0
WORDS = {"azimuth": ("ahead", "left", "behind", "right"), "elevation": ("ahead", "up", "behind", "down")}
"""Names of the directions along each cut, a quarter of a circle apart."""
COLOURS = {"alone": "tab:blue", "in the ring": "tab:orange"}


def reference(patterns: dict[float, Pattern]) -> float:
    """Return the largest gain at the frequency nearest to `REFERENCE_GHZ`, the lower one if two are equally near."""
    nearest = min(patterns, key=lambda f: (round(abs(f - REFERENCE_GHZ), 9), f))
    return float(patterns[nearest].both.max())


def cuts(gains: FloatArray) -> dict[str, FloatArray]:
    """Return the pattern on two circles from boresight in steps of `FINE_DEG`: to the left, and upwards."""
    level, quarter = gains.shape[0] // 2, gains.shape[1] // 4
    front, back = gains[:, 0], gains[:, 2 * quarter]
    return {
        "azimuth": gains[level],
        "elevation": np.concatenate([front[level::-1], back[1:-1], front[: level - 1 : -1]])[: 4 * quarter],
    }


def half_power_deg(cut: FloatArray) -> tuple[float, float]:
    """Return the angles at which the power is half of that on boresight, to the left (or up) and right (or down)."""
    half, found = cut[0] / np.sqrt(2.0), list[float]()
    for side in (cut, np.roll(cut[::-1], 1)):
        k = int(np.argmax(side < half))
        found.append(FINE_DEG * (k - (half - side[k]) / (side[k - 1] - side[k])))
    return found[0], found[1]


def summary(patterns: dict[float, Pattern]) -> str:
    """Format figures of merit by frequency as Markdown; the gain is that of both parts on boresight, in dBi."""
    lines = [
        f"{extent(patterns)}\n",
        "| GHz | gain dBi | axial ratio dB | half-power width deg: azimuth, elevation | its middle deg: left, up "
        "| 60 deg off: left, right, up, down | front to back dB: both parts, right-handed | to the others dB "
        "| impedance ohm |",
        "|" + "---|" * 9,
    ]
    for f, p in patterns.items():
        both, behind, at_60 = cuts(p.both), p.both.shape[1] // 2, round(60.0 / FINE_DEG)
        right, left = cuts(p.right)["azimuth"], cuts(p.left)["azimuth"]
        ahead, halves = both["azimuth"][0], [half_power_deg(cut) for cut in both.values()]
        widths = ", ".join(f"{a + b:.0f}" for a, b in halves)
        middles = ", ".join(f"{(a - b) / 2:z.1f}" for a, b in halves)
        sides = ", ".join(f"{cut[k] / ahead:.2f}" for cut in both.values() for k in (at_60, -at_60))
        to_others = f"{decibel(np.sqrt(p.coupled)):.0f}" if p.coupled else "-"
        lines.append(
            f"| {f:.1f} | {decibel(ahead):.1f} | {decibel((right[0] + left[0]) / abs(right[0] - left[0])):.1f} "
            f"| {widths} | {middles} | {sides} "
            f"| {decibel(ahead / both['azimuth'][behind]):.0f}, {decibel(right[0] / right[behind]):.0f} "
            f"| {to_others} | {p.impedance_ohm:.0f} |"
        )
    return "\n".join(lines)


def extent(patterns: dict[float, Pattern]) -> str:
    """Describe the number of segments, and the ratio of radiated power to the power fed in."""
    n_segments, balance = next(iter(patterns.values())).n_segments, sorted(p.balance for p in patterns.values())
    return f"{n_segments} segments, power balance {balance[0]:.3f} to {balance[-1]:.3f}"


def changes(before: dict[float, Pattern], after: dict[float, Pattern]) -> str:
    """Describe the change of the relative gain, both where the gain is above 0.1 and in all directions."""
    a, b = (np.array([p.both for p in some.values()]) / reference(some) for some in (before, after))
    main_db = np.abs(decibel(b / a))[b > 0.1]
    return (
        f"where above -20 dB, {np.sqrt(np.mean(main_db**2)):.2f} dB rms, {main_db.max():.2f} dB at most; "
        f"anywhere at most {np.abs(b - a).max():.3f} of the reference"
    )


def decibel(amplitude: FloatArray | float) -> FloatArray:
    """Convert amplitudes to decibels."""
    return 20.0 * np.log10(np.asarray(amplitude))


def draw(path: Path, solved: dict[str, dict[float, Pattern]]) -> None:
    """Draw azimuth and elevation cuts, alone and in the ring, in dB relative to the reference of the element alone."""
    mpl.use("agg")
    alone = next(iter(solved.values()))
    shown = [f for f in alone if f in SHOWN_GHZ] or list(alone)[: len(SHOWN_GHZ)]
    figure = plt.figure(figsize=(3.5 * len(shown), 7.6), layout="constrained")
    panels = figure.subplots(2, len(shown), subplot_kw={"projection": "polar"}, squeeze=False)
    for column, f in enumerate(shown):
        for panel, kind in zip(panels[:, column], WORDS, strict=True):
            for (name, colour), p in zip(COLOURS.items(), solved.values(), strict=True):
                faint = {"color": colour, "linewidth": 1.2, "alpha": 0.5, "label": f"{name}, right-handed part only"}
                solid = {"color": colour, "linewidth": 2.2, "label": f"{name}, both parts (as in the table)"}
                for gains, style in ((p[f].right, faint), (p[f].both, solid)):
                    cut = cuts(gains)[kind]
                    level_db = np.maximum(decibel(np.append(cut, cut[0]) / reference(alone)), FLOOR_DB)
                    panel.plot(np.radians(FINE_DEG) * np.arange(len(level_db)), level_db, **style)
            dress(panel, kind)
        panels[0, column].set_title(f"{f:.1f} GHz", fontsize=17, pad=8)
    for panel, text in zip(panels[:, 0], ("azimuth, from above", "elevation, from the side"), strict=True):
        panel.set_ylabel(text, fontsize=15, labelpad=34)
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=15)
    figure.savefig(path, dpi=80, metadata={"Software": None})


def dress(panel: PolarAxes, kind: str) -> None:
    """Label angles and levels; boresight points up in azimuth cuts and right in elevation cuts."""
    panel.set_theta_zero_location("N" if kind == "azimuth" else "E")
    labels = [
        WORDS[kind][k // 3] if k % 3 == 0 else ("" if 3 < k < 9 else f"{min(30 * k, 360 - 30 * k)}") for k in range(12)
    ]
    panel.set_thetagrids(np.arange(0.0, 360.0, 30.0), labels, fontsize=12)
    panel.set_ylim(FLOOR_DB, CEILING_DB)
    levels_db = np.arange(FLOOR_DB + 10.0, CEILING_DB, 10.0)
    panel.set_yticks(
        levels_db, [f"{level:.0f} dB" if level > -20.0 else "" for level in levels_db], fontsize=10, color="0.35"
    )
    panel.set_rlabel_position(200.0 if kind == "azimuth" else 110.0)
    panel.tick_params(axis="x", pad=3)
    panel.grid(color="0.85")
