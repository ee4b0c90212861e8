"""Draw frames.svg: azimuth and bearing of a source in array and world frame.

uv run python docs/pictures/make_frames.py
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Arc, Circle, Rectangle

ROBOT_M, SOURCE_M, HEADING_DEG = np.array([5.0, 3.2]), np.array([6.9, 8.2]), 20.0
WORLD, ARRAY, SIGHT = "#0b5cad", "#d81b60", "#5f6368"
PLAIN = {"fc": "white", "ec": "none", "pad": 1.5}


def main() -> None:
    """Write the picture next to this file."""
    plt.rcParams["svg.hashsalt"] = "frames"
    figure, axes = plt.subplots(figsize=(8.0, 6.2), layout="constrained")
    axes.set(xlim=(-1.2, 12.6), ylim=(-1.0, 9.6), aspect="equal")
    axes.set_axis_off()
    axes.add_patch(Rectangle((0, 0), 12, 9, fill=False, ls="--", ec="0.6"))
    axes.text(12, 9.15, "fence of the yard", ha="right", color="0.4")
    arrow(axes, np.zeros(2), 0.0, 2.6, WORLD, "x, east")
    arrow(axes, np.zeros(2), 90.0, 2.6, WORLD, "y, north")
    axes.text(-0.1, -0.55, "origin: south-west corner", color=WORLD)

    axes.plot(*np.transpose([ROBOT_M, SOURCE_M]), color=SIGHT, lw=1.2)
    axes.plot(*SOURCE_M, marker="*", ms=18, color="#f2a900", mec="0.3")
    axes.text(SOURCE_M[0] + 0.35, SOURCE_M[1], "discharge", va="center")
    axes.plot(ROBOT_M[0] + np.array([0, 4.2]), [ROBOT_M[1]] * 2, color=WORLD, lw=1, ls=":")
    axes.text(ROBOT_M[0] + 4.3, ROBOT_M[1], "east", va="center", color=WORLD)
    arrow(axes, ROBOT_M, HEADING_DEG, 3.4, ARRAY, "x, ahead")
    arrow(axes, ROBOT_M, HEADING_DEG + 90.0, 2.2, ARRAY, "y, left")
    for azimuth_deg in (90.0, 30.0, -30.0, -90.0, -150.0, 150.0):
        axes.add_patch(Circle(tuple(ROBOT_M + 0.42 * unit(HEADING_DEG + azimuth_deg)), 0.13, fc="white", ec="0.2"))

    bearing_deg = float(np.degrees(np.arctan2(*(SOURCE_M - ROBOT_M)[::-1])))
    angle(axes, 0.0, bearing_deg, 3.0, WORLD, f"bearing {bearing_deg:.0f}°", 56.0)
    angle(axes, HEADING_DEG, bearing_deg, 1.9, ARRAY, f"azimuth {bearing_deg - HEADING_DEG:.0f}°", 50.0)
    angle(axes, 0.0, HEADING_DEG, 2.6, "0.2", f"heading {HEADING_DEG:.0f}°", 8.0)
    figure.savefig(Path(__file__).with_name("frames.svg"), metadata={"Date": None}, facecolor="white")


def unit(angle_deg: float) -> np.ndarray:
    """Return the unit vector at an angle, counter-clockwise from x."""
    return np.array([np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))])


def arrow(axes: Axes, start: np.ndarray, angle_deg: float, length: float, colour: str, name: str) -> None:
    """Draw an axis of a frame."""
    end = start + length * unit(angle_deg)
    axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 2, "shrinkA": 0})
    axes.text(
        *(end + 0.3 * unit(angle_deg)),
        name,
        color=colour,
        va="center",
        ha="left" if angle_deg < 80 else "center",
        bbox=PLAIN,
    )


def angle(axes: Axes, start_deg: float, end_deg: float, radius: float, colour: str, name: str, at_deg: float) -> None:
    """Draw an angle at the robot, counter-clockwise."""
    axes.add_patch(Arc(tuple(ROBOT_M), 2 * radius, 2 * radius, theta1=start_deg, theta2=end_deg, color=colour, lw=1.8))
    tip = ROBOT_M + radius * unit(end_deg)
    axes.annotate("", tip, tip - 0.02 * unit(end_deg + 90.0), arrowprops={"arrowstyle": "-|>", "color": colour})
    axes.text(*(ROBOT_M + (radius + 0.12) * unit(at_deg)), name, color=colour, va="center", bbox=PLAIN)


if __name__ == "__main__":
    main()
