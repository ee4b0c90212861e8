"""Pictures of a robot put where a log says it was: from behind, and the yard from above. No physics runs."""
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from pdpatrol.robot_models.camera import NO_SCREEN
from pdpatrol.robot_models.description.robot_parts import BASE, FLOATING_BASE, HOME

FloatArray = NDArray[np.float64]
Picture = NDArray[np.uint8]

DISTANCE_M, ELEVATION_DEG = 3.3, -20.0
"""Of the following camera, from the robot and below the horizon."""

LOOK_AHEAD_M, LOOK_AT_HEIGHT_M = 0.7, 0.8

ABOVE_RAD = np.radians(-66.0)
"""Direction in which the camera above looks, orthographic, from the south."""

SHADOW_PIXELS = 4096
SUN_HEIGHT_M = 22.0
"""Lower, the near corner of a yard would lie behind the light, without shadows."""


GLOW = 0.4
"""Of what is drawn into the world, which has no light of its own."""


class Line(NamedTuple):
    """A line to be drawn into a picture: from one point to another, world frame, metres; colour with opacity."""

    start_m: FloatArray
    end_m: FloatArray
    rgba: tuple[float, float, float, float]
    radius_m: float = 0.03


class Ball(NamedTuple):
    """A ball to be drawn into a picture: world frame, metres."""

    centre_m: FloatArray
    radius_m: float
    rgba: tuple[float, float, float, float]


class PosedYard:
    """A yard with a robot that is put anywhere.

    Args:
        spec: The world, as of `build_spec`.
        width: Of the pictures of the following camera, pixels.
        height: Of the same.

    Raises:
        RuntimeError: If there is no OpenGL to draw with.
    """

    def __init__(self, spec: mujoco.MjSpec, width: int, height: int) -> None:
        spec.visual.global_.offwidth = spec.visual.global_.offheight = max(2048, width, height)
        spec.visual.quality.shadowsize = SHADOW_PIXELS
        spec.light("sun").pos[2] = SUN_HEIGHT_M
        self._spec, self._model = spec, spec.compile()
        self._data = mujoco.MjData(self._model)
        mujoco.mj_resetDataKeyframe(self._model, self._data, self._model.key(HOME).id)
        self._option = mujoco.MjvOption()
        self._option.flags[mujoco.mjtVisFlag.mjVIS_RANGEFINDER] = False
        self._renderer = self._make_renderer(self._model, width, height)

    def put(self, pose: FloatArray) -> None:
        """Put the robot at x m, y m, yaw rad."""
        place = self._data.joint(FLOATING_BASE).qpos
        place[[0, 1]] = pose[:2]
        place[3:7] = np.cos(0.5 * pose[2]), 0.0, 0.0, np.sin(0.5 * pose[2])
        mujoco.mj_forward(self._model, self._data)

    def from_behind(self, yaw_rad: float, lines: Sequence[Line] = (), balls: Sequence[Ball] = ()) -> Picture:
        """The robot with what is drawn into the world, shape (height, width, 3).

        Args:
            yaw_rad: Where the camera looks, world frame: the robot's heading, or nearly.
            lines: To be drawn.
            balls: To be drawn.
        """
        camera = mujoco.MjvCamera()
        ahead = np.array([np.cos(yaw_rad), np.sin(yaw_rad), 0.0])
        camera.lookat = self._data.body(BASE).xpos + LOOK_AHEAD_M * ahead + [0.0, 0.0, LOOK_AT_HEIGHT_M]
        camera.azimuth, camera.elevation, camera.distance = np.degrees(yaw_rad), ELEVATION_DEG, DISTANCE_M
        self._renderer.update_scene(self._data, camera, self._option)
        for line in lines:
            self._draw(line.rgba, mujoco.mjtGeom.mjGEOM_CAPSULE, between=(line.start_m, line.end_m, line.radius_m))
        for ball in balls:
            geom = self._draw(ball.rgba, mujoco.mjtGeom.mjGEOM_SPHERE)
            if geom is not None:
                geom.pos, geom.size = ball.centre_m, [ball.radius_m] * 3
        return np.array(self._renderer.render())

    def from_above(self, middle_m: FloatArray, half_m: FloatArray, most: tuple[int, int]) -> Picture:
        """The yard without the robot, shape (height, width, 3); `on_picture` tells where a point is on it.

        Args:
            middle_m: Point of the ground in the middle of the picture, shape (2,).
            half_m: Half of what the picture shows, along its width and height, shape (2,).
            most: Width and height that it may have, pixels; it has one of them.
        """
        scale = min(0.5 * most[0] / half_m[0], 0.5 * most[1] / half_m[1])
        width, height = (round(2.0 * scale * half) for half in half_m)
        spec = self._spec.copy()
        spec.visual.global_.fovy = 2.0 * half_m[1]  # of an orthographic camera, in metres
        model = spec.compile()
        data = mujoco.MjData(model)
        for geom in range(model.ngeom):
            if model.body_rootid[model.geom_bodyid[geom]] == model.body(BASE).id:
                model.geom_rgba[geom], model.geom_matid[geom] = 0.0, -1
        mujoco.mj_forward(model, data)
        camera = mujoco.MjvCamera()
        camera.lookat = (*middle_m, 0.0)
        camera.azimuth, camera.elevation, camera.distance = 90.0, np.degrees(ABOVE_RAD), 80.0
        camera.orthographic = 1
        with self._make_renderer(model, width, height) as renderer:
            renderer.update_scene(data, camera, self._option)
            return np.array(renderer.render())

    def close(self) -> None:
        """Give the renderer back."""
        self._renderer.close()

    def _draw(
        self,
        rgba: tuple[float, float, float, float],
        shape: mujoco.mjtGeom,
        between: tuple[FloatArray, FloatArray, float] | None = None,
    ) -> mujoco.MjvGeom | None:
        """One more shape in the scene; None where it is full."""
        scene = self._renderer.scene
        if scene.ngeom >= scene.maxgeom:
            return None
        geom = scene.geoms[scene.ngeom]
        mujoco.mjv_initGeom(geom, shape, np.zeros(3), np.zeros(3), np.eye(3).ravel(), np.array(rgba, dtype=np.float32))
        geom.category, geom.emission = mujoco.mjtCatBit.mjCAT_DECOR, GLOW
        if between is not None:
            start, end, radius = between
            mujoco.mjv_connector(geom, shape, radius, np.asarray(start), np.asarray(end))
        scene.ngeom += 1
        return geom

    @staticmethod
    def _make_renderer(model: mujoco.MjModel, width: int, height: int) -> mujoco.Renderer:
        try:
            return mujoco.Renderer(model, height, width)
        except (mujoco.FatalError, ImportError, AttributeError) as error:
            raise RuntimeError(NO_SCREEN) from error


def on_picture(points_m: FloatArray, middle_m: FloatArray) -> FloatArray:
    """Where points (..., 2 or 3) of the world are on the picture from above, metres right and up from its middle."""
    points = np.asarray(points_m, dtype=float)
    height = points[..., 2] if points.shape[-1] > 2 else 0.0
    up = -np.sin(ABOVE_RAD) * (points[..., 1] - middle_m[1]) + np.cos(ABOVE_RAD) * height
    return np.stack([points[..., 0] - middle_m[0], up], axis=-1)
