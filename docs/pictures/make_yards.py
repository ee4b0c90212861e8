"""Draw yards.png and suite.png: yards from above, with the robot at its dock and its route.

MUJOCO_GL=egl uv run python docs/pictures/make_yards.py
"""
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import matplotlib.pyplot as plt
import mujoco
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke
from numpy.typing import ArrayLike

from dirmusic.arrays import FloatArray
from pdpatrol.envs import Scenario, load_scenario
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.robot_models.sensors import AntennaElements
from pdpatrol.robot_models.world import build_spec
from pdpatrol.sensing import HelicalArray

YARDS = {
    "switchyard": "three lines and a coupler under a double busbar",
    "gis_hall": "gas-insulated bays by the building, transformers in kerbed pits",
    "twin_transformers": "a fire wall between them, the medium-voltage busbar in front",
    "transformer_bay": "transformer, breaker, instrument transformers, busbar",
}
SUITE = {
    "suite/open_02": "two pieces",
    "suite/cluttered_12": "twelve pieces",
    "suite/reflective_02": "metal between fire walls",
    "suite/several_04": "five discharges",
    "suite/high_04": "discharges high up",
    "suite/wrong_map_04": "the map lacks a piece",
}
HERE = Path(__file__).parent
PIXELS_PER_M = 28.0
ELEVATION_RAD = np.radians(-62.0)
MARGIN_M = 1.5
"""Width of the strip of ground shown beyond the fence."""

ROUTE_COLOUR, DOCK_COLOUR = "#0b5cad", "#d81b60"
OUTLINE = [withStroke(linewidth=2.5, foreground="white")]


def main() -> None:
    """Write suite.png and yards.png next to this file."""
    for name, yards, shape, size_in in (("yards", YARDS, (2, 2), (12.0, 10.3)), ("suite", SUITE, (2, 3), (15.0, 8.6))):
        figure, panels = plt.subplots(*shape, figsize=size_in, layout="constrained")
        for panel, (yard, shown) in zip(panels.flat, yards.items(), strict=True):
            scenario = load_scenario(yard)
            draw_yard(panel, scenario)
            draw_route(panel, scenario)
            panel.set_title(f"{yard}\n{shown}", fontsize=12)
            panel.set_axis_off()
            panel.set_anchor("N")
        figure.savefig(HERE / f"{name}.png", dpi=100)


def draw_yard(panel: Axes, scenario: Scenario) -> None:
    """Draw a yard as seen by an orthographic camera from the south, with the robot at its dock."""
    array = HelicalArray.nominal(scenario.array)
    elements = AntennaElements(array.positions_m, array.boresights_rad, array.boresight_elevations_rad)
    spec = build_spec(scenario.robot.description, scenario.yard, elements)
    half_x, half_y = 0.5 * np.asarray(scenario.yard.size_m) + MARGIN_M
    half_y *= -np.sin(ELEVATION_RAD)
    width, height = (round(2.0 * PIXELS_PER_M * half) for half in (half_x, half_y))
    spec.visual.global_.offwidth, spec.visual.global_.offheight = width, height
    spec.visual.global_.fovy = 2.0 * half_y  # in metres for an orthographic camera
    spec.visual.quality.shadowsize = 8192
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    data.joint("floating_base").qpos[[0, 1, 3, 6]] = *scenario.route.dock_m, np.cos(np.pi / 8), np.sin(np.pi / 8)
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.lookat = (*middle(scenario), 0.0)
    camera.azimuth, camera.elevation, camera.distance = 90.0, np.degrees(ELEVATION_RAD), 80.0
    camera.orthographic = 1
    with mujoco.Renderer(model, height, width) as renderer:
        renderer.update_scene(data, camera)
        panel.imshow(renderer.render(), extent=(-half_x, half_x, -half_y, half_y))


def draw_route(panel: Axes, scenario: Scenario) -> None:
    """Draw the path that the robot plans from stop to stop."""
    site_map = SiteMap(scenario)
    dock = scenario.route.dock_m
    for start, stop in pairwise((dock, *scenario.route.stops_m, dock)):
        way = on_picture(site_map.reach(start).path(site_map.cell(stop)), scenario)
        panel.plot(*way.T, ":", color=ROUTE_COLOUR, linewidth=1.6)
    for number, (x, y) in enumerate(on_picture(scenario.route.stops_m, scenario), start=1):
        panel.plot(x, y, "o", color="white", markeredgecolor=ROUTE_COLOUR, markersize=12)
        panel.text(x, y, str(number), color=ROUTE_COLOUR, fontsize=8, ha="center", va="center_baseline")
    x, y = on_picture(dock, scenario)
    panel.plot(x, y, "o", color="none", markeredgecolor=DOCK_COLOUR, markeredgewidth=2, markersize=16)
    panel.text(x + 1.2, y, "dock", color=DOCK_COLOUR, fontsize=10, va="center", path_effects=OUTLINE)


def on_picture(points_m: ArrayLike, scenario: Scenario) -> FloatArray:
    """Return the positions in the picture of points (..., 2) on the ground, metres from its centre."""
    return (np.asarray(points_m) - middle(scenario)) * (1.0, -np.sin(ELEVATION_RAD))


def middle(scenario: Scenario) -> FloatArray:
    """Return the centre of a yard, shape (2,)."""
    return 0.5 * np.asarray(scenario.yard.size_m)


if __name__ == "__main__":
    main()
