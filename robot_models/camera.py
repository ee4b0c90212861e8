"""Pictures of a world, and a window into it."""
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import logging
import os
import sys
import threading
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from pdpatrol.robot_models.world import CHASE

WIDTH, HEIGHT = 640, 480

NO_SCREEN = (
    "no picture can be taken: MuJoCo found no OpenGL. Without a screen set MUJOCO_GL=egl (Debian: libegl1) or "
    "MUJOCO_GL=osmesa (libosmesa6) before Python starts."
)


class Camera:
    """Follows the robot.

    Args:
        model: The world.
        mode: `rgb_array`, `depth_array`, or `human` for a window; without a screen that is said once, and none opens.

    Raises:
        RuntimeError: If there is no OpenGL to draw with.
    """

    def __init__(self, model: mujoco.MjModel, mode: str) -> None:
        self._model, self._shown = model, mujoco.MjData(model)
        self._option = mujoco.MjvOption()
        self._option.flags[mujoco.mjtVisFlag.mjVIS_RANGEFINDER] = False  # the lidar's beams are no part of the world
        self._window: Any = None
        self._threads: list[threading.Thread] = []
        self._renderer: mujoco.Renderer | None = None
        if mode == "human" and not _has_screen():
            logging.getLogger(__name__).warning("there is no screen (DISPLAY is not set): no window is opened")
        elif mode == "human":
            from mujoco import viewer  # here, for it needs a screen

            before = set(threading.enumerate())
            self._window = viewer.launch_passive(model, self._shown, show_left_ui=False, show_right_ui=False)
            self._threads = [thread for thread in threading.enumerate() if thread not in before]
            self._window.opt.flags[mujoco.mjtVisFlag.mjVIS_RANGEFINDER] = False
            self._window.cam.type = mujoco.mjtCamera.mjCAMERA_FIXED
            self._window.cam.fixedcamid = model.camera(CHASE).id
        else:
            try:
                renderer = mujoco.Renderer(model, HEIGHT, WIDTH)
            except (mujoco.FatalError, ImportError, AttributeError) as error:
                raise RuntimeError(NO_SCREEN) from error
            if mode == "depth_array":
                renderer.enable_depth_rendering()
            self._renderer = renderer

    def take(self, data: mujoco.MjData) -> NDArray[Any] | None:
        """A picture: (HEIGHT, WIDTH, 3) uint8, or (HEIGHT, WIDTH) float32 in metres; None, with the window renewed."""
        if self._window is not None:
            with self._window.lock():
                mujoco.mj_copyData(self._shown, self._model, data)
            self._window.sync()
        if self._renderer is None:
            return None
        self._renderer.update_scene(data, camera=CHASE, scene_option=self._option)
        return np.array(self._renderer.render())

    def close(self) -> None:
        """Give window or renderer back."""
        for opened in (self._window, self._renderer):
            if opened is not None:
                opened.close()
        for thread in self._threads:  # a window that outlives the interpreter takes it down
            thread.join(timeout=5.0)


def _has_screen() -> bool:
    return not sys.platform.startswith("linux") or bool({"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys())
