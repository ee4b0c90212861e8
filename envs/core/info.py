"""What environments tell beside the observation: `info`, with a row for each robot."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdpatrol.envs.core.progress import REWARD_TERMS
from pdpatrol.envs.core.simulation import Outcome, Rows, Simulation

BoolArray = NDArray[np.bool_]

REWARD_KEYS = tuple(f"reward_{term}" for term in REWARD_TERMS)
"""Of the terms of the reward."""


def fixed_info(simulation: Simulation, outcome: Outcome) -> dict[str, NDArray[Any]]:
    """What `PatrolEnv` tells of every step, entries of fixed shapes, after the step that led to `outcome`; copies."""
    motion, progress = simulation.motion, simulation.progress
    return {
        "time_s": motion.time_s.copy(),
        "believed_pose": motion.pose.copy(),
        "odometry": motion.odometry.copy(),
        "battery": motion.battery.copy(),
        **dict(zip(REWARD_KEYS, outcome.reward, strict=True)),
        "touched": simulation.robots.is_touching.copy(),
        "fell_over": outcome.fell_over,
        "success": progress.success.copy(),
        "is_success": progress.success.copy(),
        "approached": progress.approached.copy(),
        "waypoints_visited": progress.visited[:, :-1].copy(),
        "true_pose": simulation.true_pose,
    }


def masked(info: dict[str, NDArray[Any]], rows: BoolArray) -> dict[str, Any]:
    """Lay out an info as `SyncVectorEnv` does: zeros in the rows that have no entry, and a mask `_key` for each key.

    Args:
        info: Entries with a row for each robot.
        rows: True for the robots that have an entry, shape (n_robots,).
    """
    entries = dict[str, Any]()
    for key, values in info.items():
        entries[key], entries[f"_{key}"] = np.zeros_like(values), rows.copy()
        entries[key][rows] = values[rows]
    return entries


def mixed(values: NDArray[Any], begun: NDArray[Any], rows: Rows) -> NDArray[Any]:
    """The rows of one array, but for some that are of another."""
    mixed = values.copy()
    mixed[rows] = begun[rows]
    return mixed


def pulse_columns(outcome: Outcome) -> dict[str, NDArray[Any]]:
    """Pulses of all robots by the names of their columns."""
    return {"robot": outcome.robot, **outcome.pulses._asdict()}


def joined_pulses(
    ended: dict[str, NDArray[Any]], begun: dict[str, NDArray[Any]], over: BoolArray
) -> dict[str, NDArray[Any]]:
    """Pulses of the robots that go on, and those of the new episodes of the others, robot by robot."""
    goes_on = ~over[ended["robot"]]
    order = np.argsort(np.append(ended["robot"][goes_on], begun["robot"]), kind="stable")
    return {name: np.concatenate([column[goes_on], begun[name]])[order] for name, column in ended.items()}
