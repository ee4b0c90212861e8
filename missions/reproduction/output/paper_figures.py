"""The figures and tables of the paper as pictures, drawn like the paper's, ours beside."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from dirmusic import GainManifold, GaussianPattern, pulse_start
from pdpatrol.missions.reproduction import protocol
from pdpatrol.missions.reproduction.exhibit import Exhibit, published
from pdpatrol.missions.reproduction.methods import GATE_SAMPLES
from pdpatrol.missions.reproduction.output.bars import BEST, ELEMENT_COLOURS, LIMIT, OURS, PAPER, draw_bars, new_figure


def pattern_and_manifold() -> Figure:
    """Figure 1: the pattern of one element, and the gains of six normalised to unit norm."""
    figure = new_figure(9.0, 3.8)
    off = np.radians(np.linspace(-180, 180, 721))
    polar = figure.add_subplot(1, 3, 1, projection="polar")
    polar.plot(off, GaussianPattern()(off), color=OURS)
    polar.set_theta_zero_location("N")  # pyright: ignore[reportAttributeAccessIssue]
    polar.set_xlabel("eq. (1): gain off boresight")
    axes = figure.add_subplot(1, 3, (2, 3))
    azimuth_deg = np.linspace(-180, 180, 721)
    gain = GainManifold.ring(6).gain(np.radians(azimuth_deg))
    for element, values in enumerate(gain / np.linalg.norm(gain, axis=0)):
        axes.plot(azimuth_deg, values, color=ELEMENT_COLOURS[element], label=f"element {element + 1}")
    axes.set(xlabel="azimuth (deg)", ylabel="normalised gain", xlim=(-180, 180), title="Fig. 1: manifold, six elements")
    axes.legend(ncols=6, fontsize=7, loc="upper center", frameon=False)
    axes.set_ylim(0, 0.95)
    return figure


def noisy_pulse(seed: int) -> Figure:
    """Figure 3: six channels with one pulse at -10 dB."""
    rng = np.random.default_rng([seed, 2])
    gain = GainManifold.ring(6).gain(np.radians([40.0])).T
    rho = protocol.energy_to_noise_of(gain, -10.0)
    record = protocol.draw_records(gain, rho, rng)[0]
    time_ns = np.arange(record.shape[-1]) / protocol.SAMPLE_RATE_HZ * 1e9
    figure = new_figure(8.2, 6.3)
    grid = figure.subplots(6, 2, sharex="col", sharey=True, width_ratios=[3, 2])
    for element, (whole, near) in enumerate(grid):
        for axes, width in ((whole, 0.4), (near, 0.9)):
            axes.plot(time_ns, record[element], color=ELEMENT_COLOURS[element], linewidth=width, rasterized=True)
            axes.grid(axis="y", alpha=0.25)
        whole.set_title(f"element {element + 1}", loc="left", fontsize=8, pad=2)
    grid[0, 0].set_title("Fig. 3: a pulse from 40 degrees at -10 dB, six channels", fontsize=10)
    grid[0, 1].set_title("the same, 10 ns", fontsize=10)
    figure.supylabel("amplitude (standard deviations of the noise)", fontsize=10)
    at_ns = time_ns[pulse_start(record, GATE_SAMPLES)]
    grid[-1, 0].set(xlabel="time (ns)", xlim=(0, time_ns[-1]))
    grid[-1, 1].set(xlabel="time (ns)", xlim=(at_ns - 3, at_ns + 7))
    return figure


def errors_over_direction(exhibit: Exhibit) -> Figure:
    """Figure 4: errors at -10 dB over direction, and how often each occurs."""
    methods = (("paper", "paper's method", OURS, "Blues"), ("best", "best method", BEST, "Oranges"))
    figure = new_figure(9.0, 4.9)
    grid = figure.subplots(2, 2, width_ratios=[3, 1], sharey=True, sharex="col")
    low, high = published()["fig4"]["error_range_deg"]
    most = 1.0 + max(float(np.abs(exhibit.data[name]).max()) for name, *_ in methods)
    edges_deg = np.arange(-np.ceil(most) - 0.5, np.ceil(most) + 1.5)
    for (over_direction, how_often), (name, label, colour, colours) in zip(grid, methods, strict=True):
        errors_deg, true_deg = np.round(exhibit.data[name]), exhibit.data[f"true_{name}"]
        *_, mesh = over_direction.hist2d(
            true_deg, errors_deg, [np.arange(0.5, 361, 10.0), edges_deg], cmap=colours, cmin=1, rasterized=True
        )
        figure.colorbar(mesh, ax=over_direction, label="trials", pad=0.01)
        over_direction.set(ylabel="error (deg)", xlim=(0.5, 360.5), xticks=range(0, 361, 60))
        over_direction.set_title(label, loc="left", fontsize=9)
        share = 100.0 * np.histogram(errors_deg, edges_deg)[0] / errors_deg.size
        how_often.barh(0.5 * (edges_deg[1:] + edges_deg[:-1]), share, 0.85, color=colour)
        for axes in (over_direction, how_often):
            axes.axhspan(
                low, high, facecolor="none", edgecolor=LIMIT, linestyle=":", label="range that the paper prints"
            )
    grid[0, 0].set_title("Fig. 4: errors at -10 dB, six elements, whole degrees", fontsize=10)
    grid[0, 0].legend(loc="upper right", fontsize=8)
    grid[1, 0].set_xlabel("true direction (deg)")
    grid[1, 1].set_xlabel("share of the trials (%)")
    return figure


def accuracy_over_noise(six: Exhibit, four: Exhibit) -> Figure:
    """Tables 1 and 2 as bars."""
    figure = new_figure(9.0, 3.6)
    for axes, exhibit in zip(figure.subplots(1, 2, sharey=True), (six, four), strict=True):
        draw_bars(axes, exhibit.rows)
        axes.set_title(exhibit.title, fontsize=10)
    return figure


def manifold_error(exhibit: Exhibit) -> Figure:
    """Figure 5: accuracy, and spread of the errors."""
    figure = new_figure(9.0, 3.6)
    accuracy, spread = figure.subplots(1, 2)
    shares = [row for row in exhibit.rows if row.unit == "%"]
    spreads = [row for row in exhibit.rows if row.unit == "deg"]
    draw_bars(accuracy, shares)
    draw_bars(spread, spreads, [row.label for row in shares], unit="deg")
    accuracy.set_title(exhibit.title, fontsize=10)
    spread.set_title("Standard deviation of the error", fontsize=10)
    return figure


def element_count(exhibit: Exhibit) -> Figure:
    """Figure 7 as bars."""
    figure = new_figure(6.6, 3.6)
    axes = figure.subplots()
    draw_bars(axes, exhibit.rows)
    axes.set_title(exhibit.title, fontsize=10)
    return figure


def field_test(exhibit: Exhibit) -> Figure:
    """Table 3: each position's printed error among the draws, and the mean of all ten."""
    figure = new_figure(9.2, 4.0)
    boxes, means = figure.subplots(1, 2, width_ratios=[3, 2])
    paper, corrected = exhibit.data["paper"], exhibit.data["corrected"]
    labels = [row.label.replace(", ", "\n") for row in exhibit.rows[: len(corrected)]]
    boxes.boxplot(list(paper), tick_labels=labels, whis=(5, 95), showfliers=False, medianprops={"color": OURS})
    boxes.plot(np.arange(1, len(corrected) + 1), corrected, "D", color=BEST, label="printed (slips corrected)")
    boxes.axhline(0, color=PAPER, linewidth=0.7)
    boxes.tick_params(axis="x", labelsize=7)
    boxes.set(ylabel="mean error of 20 shots (deg)", title="Table 3: whiskers hold 90 % of the draws")
    boxes.legend(fontsize=8)
    results = exhibit.results
    drawn = exhibit.data["means"], exhibit.data["means_of_one"]
    bins = np.histogram_bin_edges(np.concatenate(drawn), 40)
    for values, colour, label in zip(
        drawn, (PAPER, OURS), ("an array at each position", "one array at all"), strict=True
    ):
        means.hist(values, bins=bins.tolist(), color=colour, alpha=0.6, label=label)
    for key, style in (("printed", ":"), ("corrected", "-")):
        value, percentile = results[f"{key}_mean_deg"], results[f"{key}_mean_percentile_one_array"]
        means.axvline(value, color=BEST, linestyle=style, label=f"{key}: {value:.2f} deg, percentile {percentile:.0f}")
    means.set(
        xlabel="mean |error| of the ten positions (deg)",
        ylabel="draws",
        title="Means of the draws; percentiles of one array",
    )
    means.set_ylim(top=1.4 * means.get_ylim()[1])
    means.title.set_fontsize(9)
    means.legend(fontsize=7)
    return figure
