"""What the hulls of robots remember to have touched, in compiled loops."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


@compiled
def touching(touches: FloatArray) -> IntArray:
    """Robots that any contact is remembered of.

    Args:
        touches: What the sensors of the hull remember, shape (n_robots, n_sensors, n_steps, n_contacts, 4): found or
            not, and x, y, z of each contact. Those found come first.
    """
    n_robots, n_sensors, n_steps = touches.shape[:3]
    rows, n = np.empty(n_robots, np.intp), 0
    for r in range(n_robots):
        n_found = 0
        for sensor in range(n_sensors):
            for step in range(n_steps):
                n_found += touches[r, sensor, step, 0, 0] > 0.0
        if n_found > 0:
            rows[n] = r
            n += 1
    return rows[:n]


@compiled
def take_places(touches: FloatArray, row: int) -> FloatArray:
    """Where contacts are remembered of a robot, x and y, shape (n, 2); they are forgotten."""
    _, n_sensors, n_steps, n_contacts = touches.shape[:4]
    places, n = np.empty((n_sensors * n_steps * n_contacts, 2)), 0
    for sensor in range(n_sensors):
        for step in range(n_steps):
            for k in range(n_contacts):
                contact = touches[row, sensor, step, k]
                if contact[0] > 0.0:
                    places[n, 0], places[n, 1] = contact[1], contact[2]
                    contact[0] = 0.0
                    n += 1
    return places[:n]
