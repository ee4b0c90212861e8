"""Yard and robot as one MuJoCo model: floor, fence and equipment around the inspector.

The robot comes from `inspector/inspector.xml`, what stands around it from a `Yard`. Where the antenna elements sit is
told by the caller, because the array is configured apart from the body.
"""
# pyright: reportAttributeAccessIssue=false
# The compiled bindings of MuJoCo carry no types for their enums and spec elements.

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_models.yard.pieces import BoxEquipment, CatalogueEquipment, CylinderEquipment
from robot_models.yard.yard import Yard

FloatArray = NDArray[np.float64]

INSPECTOR_XML = Path(__file__).parent / "inspector" / "inspector.xml"

MAX_ELEMENTS = 6
"""How many antenna elements the head carries."""

GROUND_GROUP = 0
"""Geom group of floor and fence: seen by cameras, not by radio rays."""

EQUIPMENT_GROUP = 1
"""Geom group of equipment, and of nothing else: what radio rays are cut by."""

ROBOT_VISUAL_GROUP = 2
"""Geom group of what the robot looks like; it touches nothing."""

FLOOR_CONTYPE = 1
"""Contact bit that wheels and casters answer to."""

OBSTACLE_CONTYPE = 2
"""Contact bit that the robot's hull answers to: equipment and fence."""

FENCE_HEIGHT_M = 1.8
"""Height of the fence (assumed; a usual height of fences around substations)."""

FENCE_THICKNESS_M = 0.1
"""Thickness of the fence (assumed); many times what the robot moves in one physics step."""

_KIND_COLOURS = {
    "power_transformer": (0.45, 0.55, 0.50, 1.0),
    "circuit_breaker": (0.62, 0.66, 0.70, 1.0),
    "disconnector": (0.70, 0.66, 0.58, 1.0),
    "current_transformer": (0.52, 0.30, 0.22, 1.0),
    "voltage_transformer": (0.60, 0.36, 0.24, 1.0),
    "surge_arrester": (0.40, 0.42, 0.52, 1.0),
    "bushing": (0.50, 0.28, 0.20, 1.0),
    "capacitor_bank": (0.58, 0.60, 0.44, 1.0),
    "reactor": (0.72, 0.74, 0.70, 1.0),
    "gis": (0.74, 0.77, 0.80, 1.0),
    "cabinet": (0.36, 0.46, 0.44, 1.0),
    "busbar": (0.55, 0.58, 0.60, 1.0),
    "control_building": (0.76, 0.70, 0.62, 1.0),
    "fence": (0.50, 0.56, 0.54, 0.35),
    "gis_bay": (0.74, 0.77, 0.80, 1.0),
    "kerb": (0.66, 0.65, 0.62, 1.0),
    "building": (0.76, 0.70, 0.62, 1.0),
}
_PART_COLOURS = {
    "hv_bushing": (0.55, 0.27, 0.18, 1.0),
    "lv_bushing": (0.55, 0.27, 0.18, 1.0),
    "pole": (0.55, 0.27, 0.18, 1.0),
    "post": (0.55, 0.27, 0.18, 1.0),
    "insulator": (0.55, 0.27, 0.18, 1.0),
    "column": (0.55, 0.58, 0.60, 1.0),
    "tube": (0.80, 0.82, 0.84, 1.0),
    "drive": (0.40, 0.48, 0.46, 1.0),
    "cubicle": (0.40, 0.48, 0.46, 1.0),
    "base": (0.62, 0.61, 0.58, 1.0),
}
"""Where a part is not of the colour of its kind: porcelain is brown, steel grey."""

_DEFAULT_COLOUR = (0.58, 0.60, 0.62, 1.0)
_FENCE_COLOUR = (0.50, 0.56, 0.54, 0.35)


def build_spec(yard: Yard, element_positions_m: ArrayLike, element_boresights_rad: ArrayLike) -> mujoco.MjSpec:
    """Describe the yard with one robot in it, still editable.

    Args:
        yard: Fence and equipment.
        element_positions_m: Where the antenna elements sit, shape (n, 3), array frame (x forward, y left, z up from
            the floor), n in [1, 6].
        element_boresights_rad: Azimuths the elements look to, shape (n,), array frame.

    Returns:
        The spec. Equipment is named `equipment/NAME`, its further parts `equipment/NAME/PART`, the fence `fence/SIDE`,
        the sites of the elements `element_1` to `element_n`, each with its x axis along the boresight.

    Raises:
        ValueError: If the element arrays disagree in shape, are not finite, or hold more elements than the head.
    """
    positions, boresights = _checked_elements(element_positions_m, element_boresights_rad)
    spec = mujoco.MjSpec.from_file(str(INSPECTOR_XML))
    spec.modelname = "yard"
    _place_elements(spec, positions, boresights)
    _add_surroundings(spec, yard)
    _add_fence(spec, yard)
    for item in yard.equipment:
        _add_equipment(spec, item)
    return spec


def build_model(yard: Yard, element_positions_m: ArrayLike, element_boresights_rad: ArrayLike) -> mujoco.MjModel:
    """Compile the yard with one robot in it; arguments and faults as in `build_spec`."""
    return build_spec(yard, element_positions_m, element_boresights_rad).compile()


def physics_only(spec: mujoco.MjSpec, sensors: Sequence[str]) -> mujoco.MjSpec:
    """The same world for physics alone: no geoms that nothing can touch, only the sensors named, no cameras nor lights.

    It moves as the whole one does, in the same state, and steps by a fifth faster (measured).
    """
    lean = spec.copy()
    kept = [sensor for sensor in lean.sensors if sensor.name in sensors]
    read_at = {sensor.objname for sensor in kept if sensor.objtype == mujoco.mjtObj.mjOBJ_SITE}
    idle = [
        *(geom for geom in lean.geoms if geom.group == ROBOT_VISUAL_GROUP),
        *(sensor for sensor in lean.sensors if sensor.name not in sensors),
        *(site for site in lean.sites if site.name not in read_at),
        *lean.cameras,
        *lean.lights,
    ]
    for element in idle:
        lean.delete(element)
    return lean


def _checked_elements(positions_m: ArrayLike, boresights_rad: ArrayLike) -> tuple[FloatArray, FloatArray]:
    positions = np.asarray(positions_m, dtype=np.float64)
    boresights = np.asarray(boresights_rad, dtype=np.float64)
    if positions.ndim != 2 or positions.shape[1] != 3 or not 1 <= len(positions) <= MAX_ELEMENTS:
        raise ValueError(
            f"`element_positions_m` must have shape (n, 3) with n from 1 to {MAX_ELEMENTS}, got {positions.shape}. "
            "Rows are antenna elements in the array frame."
        )
    if boresights.shape != (len(positions),):
        raise ValueError(
            f"`element_boresights_rad` must have shape ({len(positions)},) to match `element_positions_m`, "
            f"got {boresights.shape}. Give one azimuth for each element."
        )
    if not (np.isfinite(positions).all() and np.isfinite(boresights).all()):
        raise ValueError("element positions and boresights must be finite, got NaN or infinity among them.")
    return positions, boresights


def _place_elements(spec: mujoco.MjSpec, positions_m: FloatArray, boresights_rad: FloatArray) -> None:
    for index in range(MAX_ELEMENTS):
        frame = spec.frame(f"element_{index + 1}")
        if index < len(positions_m):
            half = 0.5 * boresights_rad[index]
            frame.pos = positions_m[index]
            frame.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT  # the file's euler would win otherwise
            frame.quat = [np.cos(half), 0.0, 0.0, np.sin(half)]
        else:
            spec.delete(frame)  # and with it the site and the antenna that one sees


def _add_surroundings(spec: mujoco.MjSpec, yard: Yard) -> None:
    """Add floor, sky and light, and tell viewers how much there is to see."""
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
            rgba=_FENCE_COLOUR,
            group=GROUND_GROUP,
            contype=OBSTACLE_CONTYPE,
            conaffinity=0,
        )


def _add_equipment(spec: mujoco.MjSpec, item: BoxEquipment | CylinderEquipment | CatalogueEquipment) -> None:
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
            rgba=_PART_COLOURS.get(part.rstrip("_123"), _KIND_COLOURS.get(item.kind, _DEFAULT_COLOUR)),
            group=EQUIPMENT_GROUP,
            contype=OBSTACLE_CONTYPE,
            conaffinity=0,
        )


def describe_solids(model: mujoco.MjModel) -> dict[str, list[dict[str, object]]]:
    """Shapes of yard and robot as plain data, to draw them without the model.

    Returns:
        Lists `yard` (world frame) and `robot` (frame of the robot's base, origin on the floor under the axle). Each
        solid has `name`, `group` (equipment, fence, robot), `shape`, `size_m` (MuJoCo's half sizes), `position_m`,
        `quaternion_wxyz` and `rgba`.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)  # the base stands at the world's origin in the model's own pose
    base = model.body("base").id
    shapes = {
        int(mujoco.mjtGeom.mjGEOM_BOX): "box",
        int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
        int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
        int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): "ellipsoid",
        int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
    }
    solids: dict[str, list[dict[str, object]]] = {"yard": [], "robot": []}
    for geom in range(model.ngeom):
        name = model.geom(geom).name
        is_robot = model.body_rootid[model.geom_bodyid[geom]] == base
        if int(model.geom_type[geom]) not in shapes or (is_robot and model.geom_group[geom] != ROBOT_VISUAL_GROUP):
            continue
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, data.geom_xmat[geom])
        material = int(model.geom_matid[geom])
        rgba = model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
        solids["robot" if is_robot else "yard"].append(
            {
                "name": name or f"part_{geom}",
                "group": "robot" if is_robot else name.partition("/")[0],
                "shape": shapes[int(model.geom_type[geom])],
                "size_m": model.geom_size[geom].tolist(),
                "position_m": data.geom_xpos[geom].tolist(),
                "quaternion_wxyz": quaternion.tolist(),
                "rgba": [float(value) for value in rgba],
            }
        )
    return solids
