# /// script
# requires-python = ">=3.11"
# dependencies = ["matplotlib>=3.10", "numpy>=2.3", "PyNEC==2.3.4", "tyro>=1.0"]
# ///
"""Compute the pattern of a helical antenna by the method of moments, alone and in a ring of six.

    uv run examples/antenna/helix.py --figure

The engine is NEC-2 as packaged by PyNEC (GPL-3.0). Only this script uses it; pdpatrol does not depend on it.

Frame of the element: boresight along +x (azimuth 0, elevation 0), y to the left, z up. Wires are perfect conductors,
and the model contains only the antennas: no ground, no robot. The column `gain` is the amplitude received from a
linearly polarised wave, as root mean square over the direction of its polarisation, per root of accepted power,

    gain = sqrt(G(f, direction) / G_ref),    G = 4 pi (U_right + U_left) / (P_radiated + P_loads),

where G_ref is the largest G of the table at the frequency nearest to 1.75 GHz (the lower one if two are equally near).
Waves of discharges are linearly polarised, so both circular parts are received. From behind, the left-handed part is
the larger one: there the right-handed part alone would be 20 to 42 dB down, but a linear wave is only 7 to 19 dB down.

Mismatch at the feed is not included: a receiver matched at each frequency is assumed. By reciprocity the gain holds for
reception.
"""

from __future__ import annotations

import csv
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import tyro
from figures import changes, draw, extent, reference, summary
from moments import FINE_DEG, Helix, Mesh, Pattern, solve

CURRENT = Path()
TABLES = {"helix": 1, "helix_in_ring": 6}
"""Number of elements of each table; the first element is fed."""
USUAL = Helix()
OTHER_LOAD_OHM = 50.0
"""Load of the other elements of the ring in the comparison of `--check`."""
SMALLEST_GAIN = 1e-4
"""Smallest gain in a table; pdpatrol requires gains above 0."""


def main(
    first_ghz: float = 1.3,
    last_ghz: float = 2.3,
    step_ghz: float = 0.1,
    step_deg: float = 10.0,
    helix: Helix = USUAL,
    folder: Path = CURRENT,
    figure: bool = False,
    check: bool = False,
) -> None:
    """Write helix.csv and helix_in_ring.csv, and print figures of merit as Markdown.

    Args:
        first_ghz: Lowest frequency.
        last_ghz: Highest frequency.
        step_ghz: Step between frequencies.
        step_deg: Step of azimuth and elevation; a multiple of 2.5 that divides 90.
        helix: Dimensions.
        folder: Output folder, by default the current one; `sensing/array/patterns` has the shipped tables.
        figure: Draw helix.png as well.
        check: Also solve with segments twice as long, and in the ring with other loads, and print the changes.
    """
    if step_deg <= 0.0 or step_deg % FINE_DEG or 90.0 % step_deg:
        raise SystemExit(f"--step-deg must be a multiple of {FINE_DEG} that divides 90, got {step_deg}.")
    if step_ghz <= 0.0 or not 0.0 < first_ghz <= last_ghz:
        raise SystemExit(f"Frequencies must rise from above 0, got {first_ghz} to {last_ghz} by {step_ghz} GHz.")
    n_steps = int((last_ghz - first_ghz) / step_ghz + 1e-6)
    frequencies_ghz = [round(first_ghz + k * step_ghz, 6) for k in range(n_steps + 1)]
    solved: dict[str, dict[float, Pattern]] = {}
    for name, n_elements in TABLES.items():
        patterns = {f: solve(helix, Mesh(), f, n_elements) for f in frequencies_ghz}
        write_table(folder / f"{name}.csv", patterns, round(step_deg / FINE_DEG))
        sys.stdout.write(f"{name}: {summary(patterns)}\n\n")
        if check:
            coarse = {f: solve(helix, Mesh().coarser(), f, n_elements) for f in frequencies_ghz}
            sys.stdout.write(f"Half of {extent(coarse)}: {changes(coarse, patterns)}\n\n")
        solved[name] = patterns
    sys.stdout.write(f"The neighbours: {changes(*solved.values())}\n\n")
    if check:
        other, (name, n_elements) = replace(helix, load_ohm=OTHER_LOAD_OHM), list(TABLES.items())[-1]
        loaded = {f: solve(other, Mesh(), f, n_elements) for f in frequencies_ghz}
        sys.stdout.write(f"Loads of {OTHER_LOAD_OHM:g} ohm: {changes(solved[name], loaded)}\n\n")
    if figure:
        draw(folder / "helix.png", solved)


def write_table(path: Path, patterns: dict[float, Pattern], every: int) -> None:
    """Write relative gains of every n-th direction, sorted by frequency, azimuth and elevation."""
    here = np.s_[::every, ::every]
    on_grid = {f: p._replace(right=p.right[here], left=p.left[here]) for f, p in patterns.items()}
    largest, step_deg = reference(on_grid), every * FINE_DEG
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["frequency_ghz", "azimuth_deg", "elevation_deg", "gain"])
        for f in sorted(on_grid):
            gains = np.maximum(on_grid[f].both / largest, SMALLEST_GAIN)
            for azimuth_deg in np.arange(-180.0, 180.0, step_deg):
                column = gains[::-1, round(azimuth_deg / step_deg)]  # from elevation -90 up
                table.writerows(
                    [f"{f:g}", f"{azimuth_deg:g}", f"{step_deg * row - 90.0:g}", f"{gain:.4f}"]
                    for row, gain in enumerate(column)
                )


if __name__ == "__main__":
    tyro.cli(main)
