"""Table, picture and JSON of a gap report."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.box import SIMPLE_HEAD
from rich.table import Table

from dirmusic.angles import wrap
from pdpatrol.missions.field.gap.compare import Gap, GapRow
from pdpatrol.sensing import HelicalArray

RECORDED, SIMULATED = "#1f618d", "#d35400"


def gap_table(gap: Gap) -> Table:
    """Return the table of the terminal."""
    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("quantity")
    for heading in ("recording", "interval", "scenario", "verdict"):
        table.add_column(heading, justify="right", overflow="fold")
    for row in gap.rows:
        cells = [_text(row.estimate, row.unit), _interval(row), _text(row.expected, row.unit)]
        table.add_row(row.quantity, *cells, "differs" if row.is_claimed else "", style="bold" if row.is_claimed else "")
    return table


def as_json(gap: Gap) -> dict[str, Any]:
    """Return the report as plain data."""
    return {
        "scenario": gap.scenario.name,
        "interval": "3 standard deviations on each side",
        "rows": [asdict(row) for row in gap.rows],
        "sources": [
            {"name": source.name, "position_m": position_m.tolist(), "amplitude_v": float(np.exp(level))}
            for source, position_m, level in zip(gap.sources, gap.fit.world.positions_m, gap.fit.log_level, strict=True)
        ],
    }


def _text(value: float | str, unit: str) -> str:
    return value if isinstance(value, str) else f"{value:.2f} {unit}"


def _interval(row: GapRow) -> str:
    if isinstance(row.estimate, str):
        return ", ".join(map(str, row.interval))
    low, high = row.interval
    return f"{low:.2f} to {high:.2f}"


def draw_gap(gap: Gap, path: Path) -> None:
    """Draw four panels: differences, level over range, strengths over angle, and pose errors."""
    figure = Figure(figsize=(12, 8), layout="constrained")
    (noise, level), (angle, pose) = figure.subplots(2, 2)
    _draw_rows(gap, noise)
    _draw_levels(gap, level)
    _draw_angles(gap, angle)
    _draw_poses(gap, pose)
    figure.savefig(path, dpi=110, format="png")


def _draw_rows(gap: Gap, axes: Axes) -> None:
    """Draw noise floor and gains with their intervals."""
    rows = [row for row in gap.rows if row.unit == "dB"]
    for at, row in enumerate(rows):
        low, high = row.interval
        axes.plot([low, high], [at, at], color=RECORDED, linewidth=3)
        axes.plot(row.estimate, at, "o", color=RECORDED)
    axes.axvline(0.0, color=SIMULATED, label="scenario")
    axes.set_yticks(range(len(rows)), [row.quantity for row in rows])
    axes.invert_yaxis()
    axes.set_xlabel("dB against the scenario")
    axes.set_title("Noise floor and gains")
    axes.legend()


def _draw_levels(gap: Gap, axes: Axes) -> None:
    """Draw recorded and simulated levels over the range."""
    places_m = gap.fit.world.positions_m[gap.groups.source, :2]
    range_m = np.linalg.norm(places_m - gap.pose[gap.groups.step, :2], axis=1)
    recorded_db = 20 / np.log(10) * gap.groups.log_level
    for simulated, text, marker in (
        (gap.believed.simulated, f"simulation, {gap.believed.world.ground}", "x"),
        (gap.fit.simulated, f"simulation, {gap.fit.world.ground}", "+"),
    ):
        axes.plot(range_m, 20 * np.log10(np.linalg.norm(simulated, axis=1)), marker, color=SIMULATED, label=text)
        if gap.fit is gap.believed:
            break
    axes.plot(range_m, recorded_db, "o", markerfacecolor="none", color=RECORDED, label="recording")
    axes.set_xscale("log")
    axes.set_xlabel("range (m)")
    axes.set_ylabel("level (dBV)")
    axes.set_title("Level over range")
    axes.legend()


def _draw_angles(gap: Gap, axes: Axes) -> None:
    """Draw the strength of each channel relative to all over the angle off its boresight."""
    nominal = HelicalArray.nominal(gap.scenario.array)
    sight_m = gap.fit.world.positions_m[gap.groups.source, :2] - gap.pose[gap.groups.step, :2]
    azimuth_rad = np.arctan2(sight_m[:, 1], sight_m[:, 0]) - gap.pose[gap.groups.step, 2]
    off_deg = np.degrees(wrap(azimuth_rad[:, np.newaxis] - nominal.boresights_rad))
    gain = nominal.manifold().gain(azimuth_rad).T
    expected = gain / np.linalg.norm(gain, axis=1, keepdims=True)
    axes.plot(off_deg, 20 * np.log10(expected), ".", color=SIMULATED, markersize=3)
    recorded = np.where(gap.groups.unit > 0.01, gap.groups.unit, np.nan)  # weaker ones are noise
    axes.plot(off_deg, 20 * np.log10(recorded), ".", color=RECORDED, markersize=5)
    axes.plot([], [], ".", color=SIMULATED, label="data sheet")
    axes.plot([], [], ".", color=RECORDED, label="recording")
    axes.set_xlabel("angle off the boresight (deg)")
    axes.set_ylabel("strength relative to all channels (dB)")
    axes.set_title("Strength ratio over angle")
    axes.legend()


def _draw_poses(gap: Gap, axes: Axes) -> None:
    """Draw the fitted errors of the poses in stated standard deviations."""
    off = (gap.fit.pose - gap.pose) / np.maximum(gap.scenario.pose_sensor.std, 1e-6)
    for values, text in zip(off.T, ("x", "y", "heading"), strict=True):
        axes.plot(values, ".-", linewidth=0.5, label=text)
    axes.axhspan(-1.0, 1.0, color=SIMULATED, alpha=0.15, label="as stated")
    axes.set_xlabel("pose")
    axes.set_ylabel("fitted error (stated standard deviations)")
    axes.set_title("Residuals by pose")
    axes.legend()
