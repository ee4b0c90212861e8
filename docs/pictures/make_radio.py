"""Draw radio.png: level across a yard of a discharge behind a transformer, as coherent sum and as sum of powers.

uv run python docs/pictures/make_radio.py
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon

from dirmusic.arrays import FloatArray
from pdpatrol.envs import load_scenario
from pdpatrol.envs.scenario.radio import surroundings_of
from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing.radio.geometry import Vector
from pdpatrol.sensing.radio.materials import WAVELENGTH_M
from pdpatrol.sensing.radio.ray_paths import find_ray_paths

SCENARIO, SOURCE_M, AXIS = "one_source", (14.52, 17.3, 1.4), (0.0, 0.0, 1.0)
ARRAY_M = 0.6
GRID_M = 0.05


def main() -> None:
    """Write the picture next to this file."""
    yard = load_scenario(SCENARIO).yard
    width_m, depth_m = yard.size_m
    x, y = np.arange(0.0, width_m, GRID_M), np.arange(0.0, depth_m, GRID_M)
    coherent_db, power_db = levels(yard, x, y)
    figure, panels = plt.subplots(1, 2, figsize=(15.0, 6.2), layout="constrained")
    for panel, level_db, title in (
        (panels[0], coherent_db, "coherent sum of all rays at 1.75 GHz"),
        (panels[1], power_db, "sum of their powers"),
    ):
        extent = (0.0, width_m, 0.0, depth_m)
        image = panel.imshow(level_db, origin="lower", extent=extent, vmin=-65.0, vmax=-5.0, cmap="turbo")
        draw_equipment(panel, yard)
        panel.plot(*SOURCE_M[:2], "*", color="white", markersize=14, markeredgecolor="black")
        panel.set(title=title, xlabel="x (m)", ylabel="y (m)")
    figure.colorbar(image, ax=panels, label="level over that 1 m away (dB)", shrink=0.85)
    figure.savefig(Path(__file__).with_name("radio.png"), dpi=80)


def levels(yard: Yard, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the levels of the sum of all rays and of the sum of their powers, dB, each (y.size, x.size)."""
    around, source_m, axis, least = surroundings_of(yard), np.array([SOURCE_M]), np.array([AXIS]), np.zeros(1)
    field, power = np.zeros((y.size, x.size), np.complex128), np.zeros((y.size, x.size))
    for row, column in np.ndindex(y.size, x.size):
        at = Vector(float(x[column]), float(y[row]), ARRAY_M)
        rays = find_ray_paths(source_m, axis, least, at, around)
        from_m, coefficient = np.column_stack([rays.rows[axis] for axis in "xyz"]), rays.rows["coefficient"]
        length_m = rays.rows["extra_m"] + np.linalg.norm(from_m - at, axis=-1)
        field[row, column] = np.sum(coefficient / length_m * np.exp(-2j * np.pi / WAVELENGTH_M * length_m))
        power[row, column] = np.sum(np.square(np.abs(coefficient) / length_m))
    return 20 * np.log10(np.abs(field) + 1e-6), 10 * np.log10(power + 1e-12)


def draw_equipment(panel: Axes, yard: Yard) -> None:
    """Draw the outlines of all equipment."""
    solids = yard.solids
    for centre_m, yaw_rad, half_m, radius_m in zip(
        solids.centre_m, solids.yaw_rad, solids.half_size_m, solids.radius_m, strict=True
    ):
        if radius_m > 0.0:
            panel.add_patch(Circle(centre_m, radius_m, fill=False, edgecolor="white"))
            continue
        turn = np.array([[np.cos(yaw_rad), -np.sin(yaw_rad)], [np.sin(yaw_rad), np.cos(yaw_rad)]])
        corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * half_m
        panel.add_patch(Polygon(centre_m + corners @ turn.T, fill=False, edgecolor="white"))


if __name__ == "__main__":
    main()
