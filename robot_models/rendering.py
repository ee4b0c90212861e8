"""Rendering of a world: camera and window of the environment, and images at given poses."""
# pyright: reportAttributeAccessIssue=false

import logging
import os
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import closing
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from dirmusic.arrays import FloatArray
from pdpatrol.robot_models.world import CHASE

WIDTH, HEIGHT = 640, 480
"""Size of rendered images, pixels."""


def make_renderer(model: mujoco.MjModel) -> mujoco.Renderer:
    """Create a renderer for images of the environment's size.

    Raises:
        RuntimeError: If MuJoCo cannot use OpenGL.
    """
    try:
        return mujoco.Renderer(model, HEIGHT, WIDTH)
    except (mujoco.FatalError, ImportError, AttributeError) as error:
        raise RuntimeError(
            "MuJoCo found no OpenGL to render with. Without a screen set MUJOCO_GL=egl (Debian: libegl1) or "
            "MUJOCO_GL=osmesa (libosmesa6) before Python starts."
        ) from error


def take_picture(
    renderer: mujoco.Renderer, data: mujoco.MjData, camera: mujoco.MjvCamera | str = CHASE
) -> NDArray[Any]:
    """Render an image without the lidar beams.

    Returns:
        Pixels, shape (HEIGHT, WIDTH, 3), or depths, shape (HEIGHT, WIDTH), metres, depending on the renderer.
    """
    option = mujoco.MjvOption()
    option.flags[mujoco.mjtVisFlag.mjVIS_RANGEFINDER] = False
    renderer.update_scene(data, camera, option)
    return np.array(renderer.render())


class Camera:
    """Camera that follows the robot, or a window.

    Args:
        model: The world.
        mode: `rgb_array`, `depth_array`, or `human` for a window. Without a display, no window opens and a warning is
            issued.

    Raises:
        RuntimeError: If MuJoCo cannot use OpenGL.
    """

    def __init__(self, model: mujoco.MjModel, mode: str) -> None:
        self._model, self._shown = model, mujoco.MjData(model)
        self._window: Any = None
        self._threads: set[threading.Thread] = set()
        self._renderer: mujoco.Renderer | None = None
        if mode != "human":
            self._renderer = make_renderer(model)
            if mode == "depth_array":
                self._renderer.enable_depth_rendering()
        elif sys.platform.startswith("linux") and not {"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys():
            logging.getLogger(__name__).warning("there is no screen (DISPLAY is not set): no window is opened")
        else:
            from mujoco import viewer  # the import fails without a display

            before = set(threading.enumerate())
            self._window = viewer.launch_passive(model, self._shown, show_left_ui=False, show_right_ui=False)
            self._threads = set(threading.enumerate()) - before
            self._window.opt.flags[mujoco.mjtVisFlag.mjVIS_RANGEFINDER] = False
            self._window.cam.type = mujoco.mjtCamera.mjCAMERA_FIXED
            self._window.cam.fixedcamid = model.camera(CHASE).id

    def take(self, data: mujoco.MjData) -> NDArray[Any] | None:
        """Render an image, or update the window.

        Returns:
            Pixels, shape (HEIGHT, WIDTH, 3), uint8, or depths, shape (HEIGHT, WIDTH), float32, metres; None for a
            window.
        """
        if self._window is not None:
            with self._window.lock():
                mujoco.mj_copyData(self._shown, self._model, data)
            self._window.sync()
        return None if self._renderer is None else take_picture(self._renderer, data)

    def close(self) -> None:
        """Close the window or the renderer."""
        for opened in (self._window, self._renderer):
            if opened is not None:
                opened.close()
        for thread in self._threads:  # a window that outlives the interpreter crashes it
            thread.join(timeout=5.0)


def pictures_from_behind(model: mujoco.MjModel, poses: FloatArray, view_rad: FloatArray) -> Iterator[NDArray[np.uint8]]:
    """Yield an image, seen from behind the robot, for each of several poses, without simulating physics.

    Args:
        model: The world.
        poses: Poses x m, y m, yaw rad, shape (n, 3).
        view_rad: Viewing directions, world frame, shape (n,), usually close to the headings of the robot.

    Raises:
        RuntimeError: If MuJoCo cannot use OpenGL.
    """
    data, camera = mujoco.MjData(model), mujoco.MjvCamera()
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    base = data.joint("floating_base").qpos
    with closing(make_renderer(model)) as renderer:
        for (x, y, yaw_rad), direction_rad in zip(poses.tolist(), view_rad.tolist(), strict=True):
            base[[0, 1]] = x, y
            base[3:7] = np.cos(0.5 * yaw_rad), 0.0, 0.0, np.sin(0.5 * yaw_rad)
            mujoco.mj_forward(model, data)
            camera.lookat = x + 0.7 * np.cos(direction_rad), y + 0.7 * np.sin(direction_rad), 0.8
            camera.azimuth, camera.elevation, camera.distance = np.degrees(direction_rad), -20.0, 3.3
            yield take_picture(renderer, data, camera)


class View(NamedTuple):
    """Place that a camera looks at, in the middle of its picture.

    Attributes:
        target_m: The place, world frame.
        azimuth_rad: Direction from the place to the camera, world frame.
        elevation_rad: Elevation of the camera, seen from the place.
        distance_m: Distance of the camera from the place.
    """

    target_m: tuple[float, float, float]
    azimuth_rad: float
    elevation_rad: float
    distance_m: float


def pixels_per_metre(view: View, model: mujoco.MjModel) -> float:
    """Return the scale of a picture of `pictures_of` at the distance of the place."""
    return 0.5 * HEIGHT / np.tan(0.5 * np.radians(model.vis.global_.fovy)) / view.distance_m


def pictures_of(model: mujoco.MjModel, views: Sequence[View]) -> Iterator[NDArray[np.uint8]]:
    """Yield a picture of each of several places in a world at rest, shape (HEIGHT, WIDTH, 3).

    Raises:
        RuntimeError: If MuJoCo cannot use OpenGL.
    """
    data, camera = mujoco.MjData(model), mujoco.MjvCamera()
    mujoco.mj_forward(model, data)
    with closing(make_renderer(model)) as renderer:
        for view in views:
            camera.lookat, camera.distance = view.target_m, view.distance_m
            camera.azimuth = np.degrees(view.azimuth_rad) + 180.0
            camera.elevation = -np.degrees(view.elevation_rad)
            yield take_picture(renderer, data, camera)
