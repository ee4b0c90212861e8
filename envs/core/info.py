"""The part of `info` that both environments share: entries of fixed shapes, each an array with a row for each robot."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from envs.core.progress import REWARD_TERMS
from envs.core.simulation import Outcome, Simulation


def fixed_info(simulation: Simulation, outcome: Outcome) -> dict[str, NDArray[Any]]:
    """What `PatrolEnv` tells of every step, after the step that led to `outcome`; all are copies."""
    motion, progress = simulation.motion, simulation.progress
    return {
        "time_s": motion.time_s.copy(),
        "pose": motion.pose.copy(),
        "odometry": motion.odometry.copy(),
        "battery": motion.battery.copy(),
        **{f"reward_{term}": value for term, value in zip(REWARD_TERMS, outcome.reward, strict=True)},
        "touched": simulation.robots.is_touching.copy(),
        "fell_over": outcome.fell_over,
        "success": progress.all_approached,
        "approached": progress.approached.copy(),
        "waypoints_visited": progress.visited[:, :-1].copy(),
        "true_pose": simulation.true_pose,
    }
