"""Draw equipment/KIND.jpg: each kind of the catalogue next to a robot, with its discharge sites.

MUJOCO_GL=egl uv run python docs/pictures/make_equipment.py
"""
# pyright: reportAttributeAccessIssue=false

import re
from itertools import product
from pathlib import Path

import matplotlib.pyplot as plt
import mujoco
import numpy as np
from matplotlib.patheffects import withStroke

from pdpatrol.robot_models.description.robot_file import load_robot
from pdpatrol.robot_models.equipment.catalogue import CATALOGUE
from pdpatrol.robot_models.world import build_spec
from pdpatrol.robot_models.yard.pieces import CatalogueEquipment
from pdpatrol.robot_models.yard.yard import Yard

FOLDER = Path(__file__).parent / "equipment"
PIXELS = np.array([560, 420])
AZIMUTH_RAD, ELEVATION_RAD = np.radians([125.0, -20.0])
"""Direction in which the camera looks."""

OUTLINE = withStroke(linewidth=3, foreground="white")
AHEAD = np.array([np.cos(AZIMUTH_RAD), np.sin(AZIMUTH_RAD), np.tan(ELEVATION_RAD)]) * np.cos(ELEVATION_RAD)
RIGHT = np.array([np.sin(AZIMUTH_RAD), -np.cos(AZIMUTH_RAD), 0.0])
RIGHT_AND_UP = np.stack([RIGHT, np.cross(RIGHT, AHEAD)])
"""Unit vectors to the right and upwards in the picture, world frame."""

MIDDLE_M = np.array([80.0, 80.0])
"""Position of the piece, so far from the fence that the fence is outside the picture."""


def draw(kind: str) -> None:
    """Write the picture of one kind."""
    item = CatalogueEquipment(name="it", kind=kind, position_m=(float(MIDDLE_M[0]), float(MIDDLE_M[1])))
    (low_m, high_m), top_m = item.solids.extent_m, item.solids.top_m.max()
    robot_m = np.array([low_m[0] - 0.6, low_m[1] - 0.6])
    sides_m = ((robot_m[0] - 0.4, high_m[0]), (robot_m[1] - 0.4, high_m[1]), (0.0, top_m))
    corners_m = np.array(list(product(*sides_m)))
    half_m = 0.5 * np.ptp(corners_m @ RIGHT_AND_UP.T, axis=0) * 1.15 + 0.15
    half_height_m = max(half_m[1], half_m[0] * PIXELS[1] / PIXELS[0])
    spec = build_spec(load_robot("inspector"), Yard(size_m=(160.0, 160.0), equipment=(item,)))
    spec.visual.global_.offwidth, spec.visual.global_.offheight = PIXELS
    spec.visual.global_.fovy = 2.0 * half_height_m  # in metres for an orthographic camera
    spec.visual.quality.offsamples = 8
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    data.joint("floating_base").qpos[[0, 1, 3, 6]] = *robot_m, np.cos(np.pi / 12), np.sin(np.pi / 12)
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.lookat = corners_m.mean(axis=0)
    camera.azimuth, camera.elevation, camera.distance = np.degrees(AZIMUTH_RAD), np.degrees(ELEVATION_RAD), 50.0
    camera.orthographic = 1
    option = mujoco.MjvOption()
    option.flags[mujoco.mjtVisFlag.mjVIS_RANGEFINDER] = False
    figure = plt.figure(figsize=PIXELS / 100.0)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    with mujoco.Renderer(model, *PIXELS[::-1]) as renderer:
        renderer.update_scene(data, camera, option)
        extent = np.array([-PIXELS[0] / PIXELS[1], PIXELS[0] / PIXELS[1], -1.0, 1.0]) * half_height_m
        axes.imshow(renderer.render(), extent=extent)
    named = set[str]()
    for site in sorted(item.assembly.sites, key=lambda site: AHEAD @ item.site_position(site)):  # nearest first
        x, y = RIGHT_AND_UP @ (item.site_position(site) - camera.lookat)
        axes.plot(x, y, "o", color="#d81b60", markeredgecolor="white", markersize=8)
        if (name := re.sub(r"[_0-9]*$", "", site)) not in named:
            named.add(name)
            side = -1 if x > 0.4 * extent[1] else 1
            axes.annotate(name, (x, y), (8 * side, 4), textcoords="offset points", fontsize=15, color="#8a0036",
                          ha="left" if side > 0 else "right", path_effects=[OUTLINE])  # fmt: skip
    axes.set_axis_off()
    axes.set_xlim(*extent[:2])
    axes.set_ylim(*extent[2:])
    figure.savefig(FOLDER / f"{kind}.jpg", dpi=100, pil_kwargs={"quality": 80})
    plt.close(figure)


if __name__ == "__main__":
    for kind in CATALOGUE:
        draw(kind)
