"""Figures of the exhibits: bars of the paper's numbers next to ours, curves, and those of the method itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import groupby

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dirmusic import GainManifold, GaussianPattern, pulse_start
from pdpatrol.missions.reproduction.exhibit import Exhibit, Row, published
from pdpatrol.missions.reproduction.simulation import GATE_SAMPLES, SAMPLE_RATE_HZ, draw_records, energy_to_noise_of

PAPER, OURS, BEST, LIMIT = "#8a8f98", "#2f6db3", "#e0762b", "#222222"


def figures(seed: int) -> dict[str, tuple[tuple[str, ...], Callable[..., Figure]]]:
    """Return the exhibits that each figure shows and the function that draws it, by the name of its file."""
    return {
        "tables_1_and_2_accuracy": (("table1", "table2"), draw_bars),
        "fig4_errors": (("fig4",), draw_errors),
        "fig5_manifold_error": (("fig5",), draw_bars),
        "fig7_elements": (("fig7",), draw_bars),
        "table3_field": (("table3",), draw_field_test),
        "phase_and_sample_rate": (("phase_method", "sample_rate"), draw_bars),
        "bound": (("bound",), draw_bound),
        "fig1_pattern_and_manifold": ((), draw_manifold),
        "fig3_noisy_pulse": ((), partial(draw_noisy_pulse, seed)),
    }


def new_figure(width: float, height: float) -> Figure:
    """Make an empty figure; sizes in inches."""
    return Figure(figsize=(width, height), dpi=140, layout="constrained")


def draw_bars(*exhibits: Exhibit) -> Figure:
    """Draw the rows of exhibits as bars, one panel for each exhibit and unit."""
    panels: list[tuple[str, str, Sequence[Row]]] = []
    for exhibit in exhibits:
        for unit, rows in groupby(sorted(exhibit.rows, key=lambda row: row.unit), key=lambda row: row.unit):
            panels.append((exhibit.title, unit, tuple(rows)))
    figure = new_figure(4.6 * len(panels) if len(panels) > 1 else 6.6, 3.6)
    for axes, (title, unit, rows) in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        _bars(axes, rows)
        axes.set_title(title, fontsize=10, wrap=True)
        axes.set_ylabel("accuracy (%)" if unit == "%" else f"({unit})")
        axes.set_ylim(0, 1.22 * axes.get_ylim()[1])
        axes.legend(fontsize=7, loc="upper right", ncols=3, frameon=False)
    return figure


def _bars(axes: Axes, rows: Sequence[Row]) -> None:
    """Draw the paper's numbers next to ours with their intervals."""
    place = np.arange(len(rows))
    printed = [np.nan if row.paper is None else row.paper for row in rows]
    axes.bar(place - 0.27, printed, 0.25, color=PAPER, label="paper")
    methods = ((0.0, OURS, "paper's method"), (0.27, BEST, "best method"))
    for shift, colour, name in methods:
        measured = [row.paper_method if colour == OURS else row.best_method for row in rows]
        values = [np.nan if m is None else m.value for m in measured]
        ends = [
            (value, value) if m is None or m.low is None else (m.low, m.high)
            for m, value in zip(measured, values, strict=True)
        ]
        errors = np.abs(np.array(ends, dtype=np.float64).T - values)
        bars = axes.bar(place + shift, values, 0.25, color=colour, yerr=errors, capsize=2, label=f"ours, {name}")
        axes.bar_label(bars, fmt="%.3g", fontsize=6, rotation=90, padding=3)
    axes.set_xticks(place, [row.label.replace(", ", "\n") for row in rows], fontsize=7)


def draw_bound(exhibit: Exhibit) -> Figure:
    """Draw errors next to the Cramer-Rao bound."""
    figure = new_figure(6.1, 4.1)
    axes = figure.subplots()
    curves = (
        ("paper", "s-", OURS, "paper's method: whole record, 1 degree grid"),
        ("best", "o-", BEST, "best: gate, maximum likelihood off the grid"),
        ("bound", "--", LIMIT, "Cramer-Rao bound"),
    )
    for name, style, colour, label in curves:
        axes.semilogy(exhibit.data["snr_db"], exhibit.data[name], style, color=colour, label=label)
    axes.set(xlabel="SNR (dB)", ylabel="root mean square error (deg)", title="Distance from the bound, six elements")
    axes.grid(which="both", alpha=0.25)
    axes.legend(fontsize=8)
    return figure


def draw_errors(exhibit: Exhibit) -> Figure:
    """Draw Fig. 4: errors at -10 dB over direction, in whole degrees."""
    methods = (("paper's method", "Blues"), ("best method", "Oranges"))
    figure = new_figure(9.0, 4.9)
    low, high = published()["fig4"]["error_range_deg"]
    largest = max(float(np.abs(exhibit.data[name]).max()) for name, _ in methods)
    edges_deg = np.arange(-np.ceil(largest) - 1.5, np.ceil(largest) + 2.5)
    for axes, (name, colours) in zip(figure.subplots(2, 1, sharex=True, sharey=True), methods, strict=True):
        true_deg, errors_deg = exhibit.data[f"true direction, {name}"], np.round(exhibit.data[name])
        bins = [np.arange(0.5, 361, 10.0), edges_deg]
        *_, mesh = axes.hist2d(true_deg, errors_deg, bins, cmap=colours, cmin=1, rasterized=True)
        figure.colorbar(mesh, ax=axes, label="trials", pad=0.01)
        axes.axhspan(low, high, facecolor="none", edgecolor=LIMIT, linestyle=":", label="range printed in the paper")
        axes.set(ylabel="error (deg)", title=name)
    figure.axes[0].legend(loc="upper right", fontsize=8)
    figure.axes[1].set(xlabel="true direction (deg)", xlim=(0.5, 360.5), xticks=range(0, 361, 60))
    figure.suptitle(exhibit.title, fontsize=10)
    return figure


def draw_field_test(exhibit: Exhibit) -> Figure:
    """Draw Table 3: the printed error of each position among the draws, and the mean of all ten."""
    figure = new_figure(9.2, 4.0)
    boxes, means = figure.subplots(1, 2, width_ratios=[3, 2])
    corrected = exhibit.data["corrected"]
    labels = [row.label.replace(", ", "\n") for row in exhibit.rows[: corrected.size]]
    positions = list(exhibit.data["positions"])
    boxes.boxplot(positions, tick_labels=labels, whis=(5, 95), showfliers=False, medianprops={"color": OURS})
    boxes.plot(np.arange(1, corrected.size + 1), corrected, "D", color=BEST, label="printed (slips corrected)")
    boxes.tick_params(axis="x", labelsize=7)
    boxes.set(ylabel="mean error of 20 shots (deg)", title="Table 3: whiskers hold 90 % of the draws")
    boxes.legend(fontsize=8)
    for name, colour in (("ten arrays", PAPER), ("one array", OURS)):
        means.hist(exhibit.data[name], bins=40, color=colour, alpha=0.6, label=name)
    for key, style in (("printed", ":"), ("corrected", "-")):
        value = exhibit.results[f"{key}_mean_deg"]
        means.axvline(value, color=BEST, linestyle=style, label=f"{key}: {value:.2f} deg")
    means.set(xlabel="mean |error| of the ten positions (deg)", ylabel="draws", title="Means of the draws")
    means.legend(fontsize=7)
    return figure


def draw_manifold() -> Figure:
    """Draw Fig. 1: the pattern of one element, and the gains of six normalised to unit norm."""
    figure = new_figure(9.0, 3.8)
    azimuth_deg = np.linspace(-180, 180, 721)
    polar = figure.add_subplot(1, 3, 1, projection="polar")
    polar.plot(np.radians(azimuth_deg), GaussianPattern()(np.radians(azimuth_deg)), color=OURS)
    polar.set_xlabel("eq. (1): gain off boresight")
    axes = figure.add_subplot(1, 3, (2, 3))
    gain = GainManifold.ring(6).gain(np.radians(azimuth_deg))
    for element, values in enumerate(gain / np.linalg.norm(gain, axis=0)):
        axes.plot(azimuth_deg, values, label=f"element {element + 1}")
    axes.set(xlabel="azimuth (deg)", ylabel="normalised gain", xlim=(-180, 180), title="Fig. 1: manifold, six elements")
    axes.legend(ncols=6, fontsize=7, loc="upper center", frameon=False)
    axes.set_ylim(0, 0.95)
    return figure


def draw_noisy_pulse(seed: int) -> Figure:
    """Draw Fig. 3: six channels with one pulse at -10 dB."""
    gain = GainManifold.ring(6).gain(np.radians([40.0])).T
    record = draw_records(gain, energy_to_noise_of(gain, -10.0), np.random.default_rng([seed, 2]))[0]
    time_ns = np.arange(record.shape[-1]) / SAMPLE_RATE_HZ * 1e9
    at_ns = time_ns[pulse_start(record, GATE_SAMPLES)]
    figure = new_figure(8.2, 6.3)
    for element, row in enumerate(figure.subplots(6, 2, sharex="col", sharey=True, width_ratios=[3, 2])):
        row[0].set_title(f"element {element + 1}", loc="left", fontsize=8, pad=2)
        for axes, limits_ns in zip(row, ((0, time_ns[-1]), (at_ns - 3, at_ns + 7)), strict=True):
            axes.plot(time_ns, record[element], color=f"C{element}", linewidth=0.5, rasterized=True)
            axes.set_xlim(*limits_ns)
    figure.suptitle("Fig. 3: a pulse from 40 degrees at -10 dB, six channels; right: 10 ns of it", fontsize=10)
    figure.supylabel("amplitude (standard deviations of the noise)", fontsize=10)
    figure.supxlabel("time (ns)", fontsize=10)
    return figure
