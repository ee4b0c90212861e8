"""Pictures of a world: the camera of the environment, its window, and pictures of a robot at logged poses."""
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import logging
import os
import sys
import threading
from collections.abc import Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from pdpatrol.robot_models.world import CHASE

FloatArray = NDArray[np.float64]
Picture = NDArray[np.uint8]

WIDTH, HEIGHT = 640, 480
"""Size of the pictures of the environment, pixels."""


def make_renderer(model: mujoco.MjModel, width: int, height: int) -> mujoco.Renderer:
    """Make a renderer.

    Raises:
        RuntimeError: If MuJoCo finds no OpenGL.
    """
    try:
        return mujoco.Renderer(model, height, width)
    except (mujoco.FatalError, ImportError, AttributeError) as error:
        raise RuntimeError(
            "MuJoCo found no OpenGL to render with. Without a screen set MUJOCO_GL=egl (Debian: libegl1) or "
            "MUJOCO_GL=osmesa (libosmesa6) before Python starts."
        ) from error


def _without_beams() -> mujoco.MjvOption:
    """Return options that hide the beams of the lidar."""
    option = mujoco.MjvOption()
    option.flags[mujoco.mjtVisFlag.mjVIS_RANGEFINDER] = False
    return option


class Camera:
    """Camera that follows the robot, or a window.

    Args:
        model: The world.
        mode: `rgb_array`, `depth_array`, or `human` for a window. Without a screen no window opens, with a warning.

    Raises:
        RuntimeError: If MuJoCo finds no OpenGL.
    """

    def __init__(self, model: mujoco.MjModel, mode: str) -> None:
        self._model, self._shown = model, mujoco.MjData(model)
        self._window: Any = None
        self._threads: list[threading.Thread] = []
        self._renderer: mujoco.Renderer | None = None
        if mode != "human":
            self._renderer = make_renderer(model, WIDTH, HEIGHT)
            if mode == "depth_array":
                self._renderer.enable_depth_rendering()
        elif not _has_screen():
            logging.getLogger(__name__).warning("there is no screen (DISPLAY is not set): no window is opened")
        else:
            from mujoco import viewer  # importing it fails without a screen

            before = set(threading.enumerate())
            self._window = viewer.launch_passive(model, self._shown, show_left_ui=False, show_right_ui=False)
            self._threads = [thread for thread in threading.enumerate() if thread not in before]
            self._window.opt.flags[mujoco.mjtVisFlag.mjVIS_RANGEFINDER] = False
            self._window.cam.type = mujoco.mjtCamera.mjCAMERA_FIXED
            self._window.cam.fixedcamid = model.camera(CHASE).id

    def take(self, data: mujoco.MjData) -> NDArray[Any] | None:
        """Take a picture, or update the window.

        Returns:
            Shape (HEIGHT, WIDTH, 3), uint8, or (HEIGHT, WIDTH), float32, metres; None for a window.
        """
        if self._window is not None:
            with self._window.lock():
                mujoco.mj_copyData(self._shown, self._model, data)
            self._window.sync()
        if self._renderer is None:
            return None
        self._renderer.update_scene(data, camera=CHASE, scene_option=_without_beams())
        return np.array(self._renderer.render())

    def close(self) -> None:
        """Close window or renderer."""
        for opened in (self._window, self._renderer):
            if opened is not None:
                opened.close()
        for thread in self._threads:  # a window that outlives the interpreter crashes it
            thread.join(timeout=5.0)


def _has_screen() -> bool:
    return not sys.platform.startswith("linux") or bool({"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys())


class DrawnLine(NamedTuple):
    """A line in a picture: from one point to another, world frame, metres; colour with opacity."""

    start_m: FloatArray
    end_m: FloatArray
    rgba: tuple[float, float, float, float]
    radius_m: float = 0.03


class DrawnBall(NamedTuple):
    """A ball in a picture: world frame, metres."""

    centre_m: FloatArray
    radius_m: float
    rgba: tuple[float, float, float, float]


class PosedYard:
    """A yard with a robot that can be put anywhere, without physics.

    Args:
        spec: The world, see `build_spec`.
        width: Width of the pictures, pixels.
        height: Height of the pictures, pixels.

    Raises:
        RuntimeError: If MuJoCo finds no OpenGL.
    """

    def __init__(self, spec: mujoco.MjSpec, width: int, height: int) -> None:
        spec.visual.global_.offwidth = spec.visual.global_.offheight = max(2048, width, height)
        spec.visual.quality.shadowsize = 4096
        spec.light("sun").pos[2] = 22.0  # lower, the near corner of a yard would be behind the light, without shadows
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        mujoco.mj_resetDataKeyframe(self._model, self._data, self._model.key("home").id)
        self._renderer = make_renderer(self._model, width, height)

    def put(self, pose: FloatArray) -> None:
        """Put the robot at x m, y m, yaw rad."""
        place = self._data.joint("floating_base").qpos
        place[[0, 1]] = pose[:2]
        place[3:7] = np.cos(0.5 * pose[2]), 0.0, 0.0, np.sin(0.5 * pose[2])
        mujoco.mj_forward(self._model, self._data)

    def from_behind(self, yaw_rad: float, lines: Sequence[DrawnLine] = (), balls: Sequence[DrawnBall] = ()) -> Picture:
        """Take a picture of the robot from behind, shape (height, width, 3).

        Args:
            yaw_rad: Direction of view, world frame: the robot's heading, or nearly.
            lines: Lines to be drawn.
            balls: Balls to be drawn.
        """
        camera = mujoco.MjvCamera()
        ahead = np.array([np.cos(yaw_rad), np.sin(yaw_rad), 0.0])
        camera.lookat = self._data.body("base").xpos + 0.7 * ahead + [0.0, 0.0, 0.8]
        camera.azimuth, camera.elevation, camera.distance = np.degrees(yaw_rad), -20.0, 3.3
        self._renderer.update_scene(self._data, camera, _without_beams())
        for line in lines:
            geom = self._add_geom(line.rgba, mujoco.mjtGeom.mjGEOM_CAPSULE)
            if geom is not None:
                start, end = np.asarray(line.start_m), np.asarray(line.end_m)
                mujoco.mjv_connector(geom, mujoco.mjtGeom.mjGEOM_CAPSULE, line.radius_m, start, end)
        for ball in balls:
            geom = self._add_geom(ball.rgba, mujoco.mjtGeom.mjGEOM_SPHERE)
            if geom is not None:
                geom.pos, geom.size = ball.centre_m, [ball.radius_m] * 3
        return np.array(self._renderer.render())

    def close(self) -> None:
        """Close the renderer."""
        self._renderer.close()

    def _add_geom(self, rgba: tuple[float, float, float, float], shape: mujoco.mjtGeom) -> mujoco.MjvGeom | None:
        """Add a glowing shape to the scene; None if the scene is full."""
        scene = self._renderer.scene
        if scene.ngeom >= scene.maxgeom:
            return None
        geom = scene.geoms[scene.ngeom]
        mujoco.mjv_initGeom(geom, shape, np.zeros(3), np.zeros(3), np.eye(3).ravel(), np.array(rgba, dtype=np.float32))
        geom.category, geom.emission = mujoco.mjtCatBit.mjCAT_DECOR, 0.4
        scene.ngeom += 1
        return geom
