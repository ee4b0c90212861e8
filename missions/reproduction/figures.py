"""Figures of the reproduction: bar charts of the paper's numbers next to ours, Fig. 1, Fig. 3 and Fig. 4."""

import numpy as np
from matplotlib.figure import Figure

from dirmusic import GainManifold, pulse_start
from pdpatrol.missions.reproduction.comparison import Exhibit, FloatArray
from pdpatrol.missions.reproduction.simulation import SAMPLE_RATE_HZ, draw_records, energy_to_noise


def draw_bars(exhibit: Exhibit) -> Figure:
    """Draw the rows of an exhibit as a bar chart with intervals, one panel for each unit."""
    units = sorted({row.unit for row in exhibit.rows})
    figure = Figure(figsize=(max(6.6, 0.8 * len(exhibit.rows)), 3.8), layout="constrained")
    for axes, unit in zip(figure.subplots(1, len(units), squeeze=False)[0], units, strict=True):
        rows = [row for row in exhibit.rows if row.unit == unit]
        place = np.arange(len(rows))
        axes.bar(place - 0.27, [row.paper or 0.0 for row in rows], 0.25, color="#8a8f98", label="paper")
        methods = (
            ("ours, paper's method", [row.paper_method for row in rows], 0.0, "#2f6db3"),
            ("ours, best method", [row.best_method for row in rows], 0.27, "#e0762b"),
        )
        for label, measured, shift, colour in methods:
            numbers = [(each.value, *each.interval) if each else (0.0, 0.0, 0.0) for each in measured]
            values, low, high = np.array(numbers).T
            spans = (values - low, high - values)
            axes.bar(place + shift, values, 0.25, color=colour, yerr=spans, capsize=2, label=label)
        axes.set_xticks(place, [row.label.replace(", ", "\n") for row in rows], fontsize=7)
        axes.set(ylabel=f"({unit})", ylim=(0.0, None))
    figure.suptitle(exhibit.title, fontsize=10)
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=8)
    return figure


def draw_errors(true_paper: FloatArray, paper_deg: FloatArray, true_best: FloatArray, best_deg: FloatArray) -> Figure:
    """Draw Fig. 4: errors in whole degrees against the true directions."""
    figure = Figure(figsize=(9.0, 4.9), layout="constrained")
    bins = [np.arange(0.5, 361, 10.0), np.arange(paper_deg.min() - 1.5, paper_deg.max() + 2.5)]
    panels = figure.subplots(2, 1, sharex=True, sharey=True)
    methods = (
        ("ours, paper's method", true_paper, paper_deg, "Blues"),
        ("ours, best method", true_best, best_deg, "Oranges"),
    )
    for axes, (title, true_deg, errors_deg, colours) in zip(panels, methods, strict=True):
        *_, mesh = axes.hist2d(true_deg, errors_deg, bins, cmap=colours, cmin=1, rasterized=True)
        figure.colorbar(mesh, ax=axes, label="trials", pad=0.01)
        axes.axhspan(-7, 8, facecolor="none", edgecolor="black", linestyle=":", label="range in the paper")
        axes.set(ylabel="error (deg)", title=title)
    panels[0].legend(loc="upper right", fontsize=8)
    panels[1].set(xlabel="true direction (deg)", xticks=range(0, 361, 60))
    return figure


def draw_manifold() -> Figure:
    """Draw Fig. 1: the gains of six elements against azimuth, normalised to unit norm."""
    figure = Figure(figsize=(7.0, 3.8), layout="constrained")
    axes = figure.subplots()
    azimuth_deg = np.linspace(-180, 180, 721)
    gain = GainManifold.ring(6).gain(np.radians(azimuth_deg))
    axes.plot(azimuth_deg, (gain / np.linalg.norm(gain, axis=0)).T, label=[f"element {k}" for k in range(1, 7)])
    axes.set(xlabel="azimuth (deg)", ylabel="normalised gain", xlim=(-180, 180), ylim=(0, 0.95))
    axes.legend(ncols=6, fontsize=7, loc="upper center", frameon=False)
    return figure


def draw_noisy_pulse(seed: int) -> Figure:
    """Draw Fig. 3: six channels with one pulse at -10 dB, and 10 ns of each channel around the pulse."""
    gain = GainManifold.ring(6).gain(np.radians([40.0])).T
    record = draw_records(gain, energy_to_noise(gain, -10.0), np.random.default_rng([seed, 2]))[0]
    time_ns = np.arange(record.shape[-1]) / SAMPLE_RATE_HZ * 1e9
    at_ns = time_ns[pulse_start(record, 60)]
    figure = Figure(figsize=(8.2, 5.0), layout="constrained")
    offsets = -12.0 * np.arange(6)  # in standard deviations of the noise
    panels = figure.subplots(1, 2, sharey=True, width_ratios=[3, 2])
    for axes, limits_ns in zip(panels, ((0, time_ns[-1]), (at_ns - 3, at_ns + 7)), strict=True):
        axes.plot(time_ns, record.T + offsets, linewidth=0.5, rasterized=True)
        axes.set(xlim=limits_ns, xlabel="time (ns)")
    panels[0].set_yticks(offsets, [f"element {k}" for k in range(1, 7)])
    return figure
