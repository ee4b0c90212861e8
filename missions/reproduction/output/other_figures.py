"""Pictures of what the paper's successor prints, and of what the paper lacks: limits, real rings, frequency."""

from __future__ import annotations

from matplotlib.figure import Figure

from pdpatrol.missions.reproduction.exhibit import Exhibit, Measured
from pdpatrol.missions.reproduction.exhibits.limits import ELEVATIONS_DEG, RING_SIZES_M
from pdpatrol.missions.reproduction.exhibits.over_frequency import BIAS_AZIMUTHS_DEG
from pdpatrol.missions.reproduction.output.bars import BEST, LIMIT, OURS, draw_bars, new_figure


def other_tables(phase: Exhibit, rates: Exhibit) -> Figure:
    """The phase method and the sample rates as bars."""
    figure = new_figure(9.2, 3.6)
    left, right = figure.subplots(1, 2)
    draw_bars(left, phase.rows)
    left.set_title(phase.title, fontsize=10)
    draw_bars(right, rates.rows, [row.label.replace(", ", "\n") for row in rates.rows])
    right.set_title(rates.title, fontsize=10)
    return figure


def bound(exhibit: Exhibit) -> Figure:
    """Root mean square error against the Cramer-Rao bound."""
    figure = new_figure(6.1, 4.1)
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
    figure = new_figure(6.1, 4.1)
    axes = figure.subplots()
    radii_cm = [100.0 * radius_m for radius_m in RING_SIZES_M]
    series: tuple[tuple[str, str, str, list[Measured | None]], ...] = (
        ("samples, eq. (5) as printed", OURS, "s-", [row.paper_method for row in exhibit.rows]),
        ("energies of the gate", BEST, "o-", [row.best_method for row in exhibit.rows]),
        ("gain and delay together", "#2f9e6b", "^-", [row.unrounded for row in exhibit.rows]),
    )
    for label, colour, style, measured in series:
        axes.semilogy(radii_cm, [m.value for m in measured if m], style, color=colour, label=label)
    axes.set(xlabel="radius of the ring (cm)", ylabel="root mean square error (deg)", title=exhibit.title)
    axes.grid(which="both", alpha=0.25)
    axes.legend(fontsize=8)
    return figure


def elevation(exhibit: Exhibit) -> Figure:
    """Azimuth bias over elevation."""
    figure = new_figure(6.1, 3.8)
    axes = figure.subplots()
    series = (("taken for level", OURS, "s-", 0), ("told the elevation", BEST, "o-", 1))
    for label, colour, style, column in series:
        measured = [(row.paper_method, row.best_method)[column] for row in exhibit.rows]
        axes.plot(ELEVATIONS_DEG, [m.value for m in measured if m], style, color=colour, label=label)
    axes.set(xlabel="elevation of the source (deg)", ylabel="root mean square bias of the azimuth (deg)")
    axes.set(title=exhibit.title, xlim=(0, 65), xticks=range(0, 61, 10))
    axes.grid(alpha=0.25)
    axes.legend(fontsize=8)
    return figure


def over_frequency(exhibit: Exhibit) -> Figure:
    """Errors where the pattern changes over the band: against the bound, and over direction without noise."""
    figure = new_figure(9.0, 4.0)
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
