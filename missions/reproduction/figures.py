"""The exhibits as pictures, drawn like the paper's, ours beside."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from dirmusic import GainManifold, GaussianPattern, pulse_start
from missions.reproduction import protocol
from missions.reproduction.exhibits import Exhibit, Measured, Row, published
from missions.reproduction.methods import GATE_SAMPLES
from missions.reproduction.over_frequency import BIAS_AZIMUTHS_DEG
from missions.whole_file import whole_file

FloatArray = NDArray[np.float64]

PAPER, OURS, BEST, LIMIT = "#8a8f98", "#2f6db3", "#e0762b", "#222222"
ELEMENT_COLOURS = ("#c8443a", "#d99a2b", "#8fa832", "#2f9e6b", "#2f6db3", "#8a53b5")
DPI = 140


def draw_all(exhibits: Sequence[Exhibit], folder: Path, seed: int) -> list[Path]:
    """Draw every picture into `folder`; returns the files."""
    by_name = {exhibit.name: exhibit for exhibit in exhibits}
    pictures: dict[str, Callable[[], Figure]] = {
        "fig1_pattern_and_manifold": pattern_and_manifold,
        "fig3_noisy_pulse": lambda: noisy_pulse(seed),
        "fig4_errors": lambda: errors_over_direction(by_name["fig4"]),
        "tables_1_and_2_accuracy": lambda: accuracy_over_noise(by_name["table1"], by_name["table2"]),
        "fig5_manifold_error": lambda: manifold_error(by_name["fig5"]),
        "fig7_elements": lambda: element_count(by_name["fig7"]),
        "table3_field": lambda: field_test(by_name["table3"]),
        "phase_and_sample_rate": lambda: other_tables(by_name["phase_method"], by_name["sample_rate"]),
        "bound": lambda: bound(by_name["bound"]),
        "ring_size": lambda: ring_size(by_name["ring_size"]),
        "elevation": lambda: elevation(by_name["elevation"]),
        "over_frequency": lambda: over_frequency(by_name["over_frequency"]),
    }
    paths: list[Path] = []
    for name, draw in pictures.items():
        path = folder / f"{name}.png"
        with whole_file(path) as picture:
            draw().savefig(picture, dpi=DPI, format="png")
        paths.append(path)
    return paths


def _figure(width: float, height: float) -> Figure:
    return Figure(figsize=(width, height), layout="constrained")


def pattern_and_manifold() -> Figure:
    """Figure 1: the pattern of one element, and the gains of six normalised to unit norm."""
    figure = _figure(11, 4.2)
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
    figure = _figure(10, 6)
    grid = figure.subplots(6, 2, sharex="col", sharey=True, width_ratios=[3, 2])
    for element, (whole, near) in enumerate(grid):
        for axes, width in ((whole, 0.4), (near, 0.9)):
            axes.plot(time_ns, record[element], color=ELEMENT_COLOURS[element], linewidth=width)
            axes.set_yticks([])
        whole.set_ylabel(f"{element + 1}", rotation=0, labelpad=10)
    grid[0, 0].set_title("Fig. 3: a pulse from 40 degrees at -10 dB, six channels", fontsize=10)
    grid[0, 1].set_title("the same, 10 ns", fontsize=10)
    at_ns = time_ns[pulse_start(record, GATE_SAMPLES)]
    grid[-1, 0].set(xlabel="time (ns)", xlim=(0, time_ns[-1]))
    grid[-1, 1].set(xlabel="time (ns)", xlim=(at_ns - 3, at_ns + 7))
    return figure


def errors_over_direction(exhibit: Exhibit) -> Figure:
    """Figure 4: scatter and box of the errors at -10 dB."""
    figure = _figure(11, 4)
    scatter, box = figure.subplots(1, 2, width_ratios=[3, 1], sharey=True)
    paper, best = exhibit.data["paper"], np.round(exhibit.data["best"])
    jitter = np.random.default_rng(0).uniform(-0.3, 0.3, (2, paper.size))  # errors are whole degrees
    for name, errors, colour, shift in (("paper", paper, OURS, jitter[0]), ("best", best, BEST, jitter[1])):
        label = "best" if name == "best" else "paper's method"
        true_deg = exhibit.data[f"true_{name}"]
        scatter.scatter(true_deg, errors + shift, s=2, color=colour, alpha=0.5, label=label, linewidths=0)
    low, high = published()["fig4"]["error_range_deg"]
    for value in (low, high):
        scatter.axhline(value, color=PAPER, linestyle=":", linewidth=1)
    scatter.plot([], [], color=PAPER, linestyle=":", label="paper's limits")
    scatter.set(
        xlabel="true direction (deg)", ylabel="error (deg)", xlim=(0, 361), title="Fig. 4 (a): errors at -10 dB"
    )
    scatter.legend(loc="upper right", ncols=3, fontsize=8, markerscale=4, framealpha=0.9)
    drawn = box.boxplot([paper, best], tick_labels=["paper's\nmethod", "best"], widths=0.5, patch_artist=True)
    for patch, colour in zip(drawn["boxes"], (OURS, BEST), strict=True):
        patch.set(facecolor=colour, alpha=0.5)
    box.set_title("Fig. 4 (b)")
    return figure


def accuracy_over_noise(six: Exhibit, four: Exhibit) -> Figure:
    """Tables 1 and 2 as bars."""
    figure = _figure(11, 4)
    for axes, exhibit in zip(figure.subplots(1, 2, sharey=True), (six, four), strict=True):
        _bars(axes, exhibit.rows)
        axes.set_title(exhibit.title, fontsize=10)
    return figure


def manifold_error(exhibit: Exhibit) -> Figure:
    """Figure 5: accuracy, and spread of the errors."""
    figure = _figure(11, 4)
    accuracy, spread = figure.subplots(1, 2)
    shares = [row for row in exhibit.rows if row.unit == "%"]
    spreads = [row for row in exhibit.rows if row.unit == "deg"]
    _bars(accuracy, shares)
    _bars(spread, spreads, [row.label for row in shares], unit="deg")
    accuracy.set_title(exhibit.title, fontsize=10)
    spread.set_title("Standard deviation of the error", fontsize=10)
    return figure


def element_count(exhibit: Exhibit) -> Figure:
    """Figure 7 as bars."""
    figure = _figure(8, 4)
    axes = figure.subplots()
    _bars(axes, exhibit.rows)
    axes.set_title(exhibit.title, fontsize=10)
    return figure


def field_test(exhibit: Exhibit) -> Figure:
    """Table 3: each position's printed error among the draws, and the mean of all ten."""
    figure = _figure(12, 4.4)
    boxes, means = figure.subplots(1, 2, width_ratios=[3, 2])
    paper, corrected = exhibit.data["paper"], exhibit.data["corrected"]
    labels = [row.label.replace(", ", "\n").replace(" deg", "°") for row in exhibit.rows[: len(corrected)]]
    boxes.boxplot(list(paper), tick_labels=labels, whis=(5, 95), showfliers=False, medianprops={"color": OURS})
    boxes.plot(np.arange(1, len(corrected) + 1), corrected, "D", color=BEST, label="printed (slips corrected)")
    boxes.axhline(0, color=PAPER, linewidth=0.7)
    boxes.tick_params(axis="x", labelsize=7)
    boxes.set(ylabel="mean error of 20 shots (deg)", title="Table 3: whiskers hold 90 % of the draws")
    boxes.legend(fontsize=8)
    results = exhibit.results
    drawn = exhibit.data["means"], exhibit.data["means_of_one"]
    bins = np.histogram_bin_edges(np.concatenate(drawn), 40)
    for values, colour, label in zip(drawn, (PAPER, OURS), ("an array at each position", "one at all"), strict=True):
        means.hist(values, bins=bins.tolist(), color=colour, alpha=0.6, label=label)
    for key, style in (("printed", ":"), ("corrected", "-")):
        value, percentile = results[f"{key}_mean_deg"], results[f"{key}_mean_percentile_one_array"]
        means.axvline(value, color=BEST, linestyle=style, label=f"{key}: {value:.2f} deg, percentile {percentile:.0f}")
    means.set(
        xlabel="mean |error| of the ten positions (deg)",
        ylabel="draws",
        title="One mean per draw; percentiles of one array",
    )
    means.legend(fontsize=8)
    return figure


def other_tables(phase: Exhibit, rates: Exhibit) -> Figure:
    """The phase method and the sample rates as bars."""
    figure = _figure(12, 4)
    left, right = figure.subplots(1, 2)
    _bars(left, phase.rows)
    left.set_title(phase.title, fontsize=10)
    labels = [
        row.label if not row.label.startswith(" ") else f"{before.label}\nphase"
        for before, row in zip((rates.rows[0], *rates.rows[:-1]), rates.rows, strict=True)
    ]
    _bars(right, rates.rows, labels)
    right.set_title(rates.title, fontsize=10)
    return figure


def bound(exhibit: Exhibit) -> Figure:
    """Root mean square error against the Cramer-Rao bound."""
    figure = _figure(7.5, 4.6)
    axes = figure.subplots()
    snr_db, limit, paper, best = exhibit.data["curves"].T
    axes.semilogy(snr_db, paper, "s-", color=OURS, label="paper's method: whole record, 1 degree grid")
    axes.semilogy(snr_db, best, "o-", color=BEST, label="best: gate, maximum likelihood off the grid")
    axes.semilogy(snr_db, limit, "--", color=LIMIT, label="Cramer-Rao bound")
    axes.set(xlabel="SNR (dB)", ylabel="root mean square error (deg)", title="How far from the limit, six elements")
    axes.grid(which="both", alpha=0.25)
    axes.legend(fontsize=8)
    return figure


def ring_size(exhibit: Exhibit) -> Figure:
    """What the size of a real ring does to each method."""
    figure = _figure(7.5, 4.6)
    axes = figure.subplots()
    labels = [row.label for row in exhibit.rows]
    series: tuple[tuple[str, str, str, list[Measured | None]], ...] = (
        ("samples, eq. (5) as printed", OURS, "s-", [row.paper_method for row in exhibit.rows]),
        ("energies of the gate", BEST, "o-", [row.best_method for row in exhibit.rows]),
        ("gain and delay together", "#2f9e6b", "^-", [row.unrounded for row in exhibit.rows]),
    )
    for label, colour, style, measured in series:
        axes.semilogy(labels, [m.value for m in measured if m], style, color=colour, label=label)
    axes.set(xlabel="radius of the ring", ylabel="root mean square error (deg)", title=exhibit.title)
    axes.grid(which="both", alpha=0.25)
    axes.legend(fontsize=8)
    return figure


def elevation(exhibit: Exhibit) -> Figure:
    """Azimuth bias over elevation."""
    figure = _figure(7.5, 4.2)
    axes = figure.subplots()
    series = (("taken for level", OURS, "s-", 0), ("told the elevation", BEST, "o-", 1))
    for label, colour, style, column in series:
        measured = [(row.paper_method, row.best_method)[column] for row in exhibit.rows]
        axes.plot(
            [row.label for row in exhibit.rows], [m.value for m in measured if m], style, color=colour, label=label
        )
    axes.set(ylabel="root mean square bias (deg)", title=exhibit.title)
    axes.grid(alpha=0.25)
    axes.legend(fontsize=8)
    return figure


def over_frequency(exhibit: Exhibit) -> Figure:
    """Errors where the pattern changes over the band: against the bound, and over direction without noise."""
    figure = _figure(11, 4.4)
    left, right = figure.subplots(1, 2)
    snr_db, limit, narrow, by_band = exhibit.data["curves"].T
    left.semilogy(snr_db, narrow, "s-", color=OURS, label="one strength a channel")
    left.semilogy(snr_db, by_band, "o-", color=BEST, label="strengths in sub-bands, free spectrum")
    left.semilogy(snr_db, limit, "--", color=LIMIT, label="Cramer-Rao bound")
    left.set(xlabel="SNR (dB)", ylabel="root mean square error (deg)", title="Computed helices in a ring")
    (narrow_deg, by_band_deg), (lower_deg, by_band_lower_deg) = exhibit.data["bias_deg"]
    right.plot(BIAS_AZIMUTHS_DEG, narrow_deg, color=OURS, label="one strength a channel")
    right.plot(BIAS_AZIMUTHS_DEG, lower_deg, ":", color=OURS, label="the same, spectrum 10 % lower")
    right.plot(BIAS_AZIMUTHS_DEG, by_band_deg, color=BEST, label="strengths in sub-bands")
    right.plot(BIAS_AZIMUTHS_DEG, by_band_lower_deg, ":", color=BEST, label="the same, spectrum 10 % lower")
    right.set(xlabel="direction (deg)", ylabel="bias without noise (deg)", xticks=range(-180, 181, 60))
    for axes in (left, right):
        axes.grid(which="both", alpha=0.25)
        axes.legend(fontsize=8)
    return figure


def _bars(axes: Axes, rows: Sequence[Row], labels: Sequence[str] | None = None, unit: str = "%") -> None:
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
