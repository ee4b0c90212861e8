"""A yard in MuJoCo: floor, sky and light, fence, and a geom for each solid of its equipment."""
# pyright: reportAttributeAccessIssue=false
# The compiled bindings of MuJoCo carry no types for their enums and spec elements.

from __future__ import annotations

import mujoco
import numpy as np

from pdpatrol.robot_models.description.robot_parts import FLOOR_CONTYPE, OBSTACLE_CONTYPE
from pdpatrol.robot_models.equipment import colour_of
from pdpatrol.robot_models.yard.pieces import Equipment
from pdpatrol.robot_models.yard.yard import Yard

GROUND_GROUP = 0
"""Geom group of floor and fence."""

EQUIPMENT_GROUP = 1
"""Geom group of equipment, and of nothing else."""

FENCE_HEIGHT_M = 1.8
"""Height of the fence (assumed; a usual height of fences around substations)."""

FENCE_THICKNESS_M = 0.1
"""Thickness of the fence (assumed); many times what a robot moves in one physics step."""

FENCE_COLOUR = (0.50, 0.56, 0.54, 0.35)


PREFIX = "yard/"
"""Of the names of textures and materials of a yard."""


def add_yard(spec: mujoco.MjSpec, yard: Yard) -> None:
    """Put a yard around a robot: floor `floor`, light `sun`, fence `fence/SIDE`, equipment `equipment/NAME`.

    It is described apart and attached, so that defaults of the robot's file do not apply to it.
    """
    own = mujoco.MjSpec()
    _add_ground(own, yard)
    _add_fence(own, yard)
    for item in yard.equipment:
        _add_equipment(own, item)
    names = [element.name for element in (*own.geoms, *own.lights)]
    spec.attach(own, frame=spec.worldbody.add_frame(), prefix=PREFIX)
    for name in names:
        (spec.geom(PREFIX + name) or spec.light(PREFIX + name)).name = name
    _set_view(spec, yard)


def _add_ground(spec: mujoco.MjSpec, yard: Yard) -> None:
    """Add floor, sky and light."""
    size_x, size_y = yard.size_m
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.45, 0.65, 0.85],
        rgb2=[0.90, 0.94, 0.97],
        width=256,
        height=1536,
    )
    spec.add_texture(
        name="paving",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        mark=mujoco.mjtMark.mjMARK_EDGE,
        rgb1=[0.56, 0.57, 0.56],
        rgb2=[0.52, 0.53, 0.52],
        markrgb=[0.45, 0.46, 0.45],
        width=256,
        height=256,
    )
    paving = spec.add_material(name="paving", texuniform=True, texrepeat=[1.0, 1.0])
    paving.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "paving"
    world = spec.worldbody
    world.add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        pos=[0.5 * size_x, 0.5 * size_y, 0.0],
        size=[0.5 * size_x + 3.0, 0.5 * size_y + 3.0, 0.05],
        material="paving",
        group=GROUND_GROUP,
        contype=FLOOR_CONTYPE,
        conaffinity=0,
    )
    world.add_light(
        name="sun",
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=[0.5 * size_x, 0.5 * size_y, 12.0],
        dir=[0.4, 0.5, -1.0],
        diffuse=[0.6, 0.6, 0.6],
    )


def _set_view(spec: mujoco.MjSpec, yard: Yard) -> None:
    """Tell viewers how much there is to see, and in what light."""
    size_x, size_y = yard.size_m
    spec.stat.center = [0.5 * size_x, 0.5 * size_y, 0.5]
    spec.stat.extent = 0.5 * float(np.hypot(size_x, size_y))
    spec.visual.headlight.ambient = [0.35, 0.35, 0.35]
    spec.visual.headlight.diffuse = [0.45, 0.45, 0.45]
    spec.visual.map.shadowclip = 2.0  # at 1 the far floor falls out of the sun's shadow map and is speckled
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 640, 480


def _add_fence(spec: mujoco.MjSpec, yard: Yard) -> None:
    """Stand four thin boxes around the yard, their inner faces on its boundary."""
    (size_x, size_y), half = yard.size_m, 0.5 * FENCE_THICKNESS_M
    along_x, along_y = (0.5 * size_x + 2 * half, half), (half, 0.5 * size_y)
    sides = {
        "south": ((0.5 * size_x, -half), along_x),
        "north": ((0.5 * size_x, size_y + half), along_x),
        "west": ((-half, 0.5 * size_y), along_y),
        "east": ((size_x + half, 0.5 * size_y), along_y),
    }
    for side, (centre, half_size) in sides.items():
        spec.worldbody.add_geom(
            name=f"fence/{side}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=[*centre, 0.5 * FENCE_HEIGHT_M],
            size=[*half_size, 0.5 * FENCE_HEIGHT_M],
            rgba=FENCE_COLOUR,
            group=GROUND_GROUP,
            contype=OBSTACLE_CONTYPE,
            conaffinity=0,
        )


def _add_equipment(spec: mujoco.MjSpec, item: Equipment) -> None:
    """Stand one piece of equipment on the ground, a geom for each of its parts."""
    solids, half_yaw = item.solids, 0.5 * np.radians(item.yaw_deg)
    for k, part in enumerate(item.assembly.parts):
        half_height = 0.5 * (solids.top_m[k] - solids.bottom_m[k])
        if solids.radius_m[k] > 0:
            shape, size = mujoco.mjtGeom.mjGEOM_CYLINDER, [solids.radius_m[k], half_height, 0.0]
        else:
            shape, size = mujoco.mjtGeom.mjGEOM_BOX, [*solids.half_size_m[k], half_height]
        spec.worldbody.add_geom(
            name=f"equipment/{item.name}" if k == 0 else f"equipment/{item.name}/{part}",
            type=shape,
            pos=[*solids.centre_m[k], solids.bottom_m[k] + half_height],
            quat=[np.cos(half_yaw), 0.0, 0.0, np.sin(half_yaw)],
            size=size,
            rgba=colour_of(item.kind, part),
            group=EQUIPMENT_GROUP,
            contype=OBSTACLE_CONTYPE,
            conaffinity=0,
        )
