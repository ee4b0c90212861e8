"""How many open yards a steering reaches the source in, and how fast."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pdpatrol.envs.core.simulation import STEP_S
from pdpatrol.envs.random_yard import open_yard
from pdpatrol.envs.vector_env import PatrolVectorEnv
from pdpatrol.envs.wrappers import bearings_only
from pdpatrol.missions.learning.steering import Steering
from pdpatrol.missions.runner import Mission

UNSEEN_FROM = 1_000_000
"""Seeds of the yards of the final evaluation start here; neither training nor its learning curve goes there."""


@dataclass(frozen=True, kw_only=True)
class Evaluation:
    """What became of each yard.

    Attributes:
        reached_s: Time at which the robot came within the stand-off distance of the source, shape (n_yards,); NaN
            where it did not within the time limit.
        n_touched: Yards in which the robot touched anything but the floor.
    """

    reached_s: NDArray[np.float64]
    n_touched: int

    @property
    def success(self) -> float:
        """Share of the yards in which it got there."""
        return float(np.isfinite(self.reached_s).mean())

    def summary(self) -> dict[str, float | int | None]:
        """Plain figures; `median_s` is over the yards in which it got there, None where there is none.

        `beside_at_start` counts the yards whose source happens to hang within the stand-off distance of the dock:
        nobody can miss those.
        """
        reached = np.isfinite(self.reached_s)
        return {
            "yards": self.reached_s.size,
            "reached": int(reached.sum()),
            "success": self.success,
            "beside_at_start": int((self.reached_s < 1.5 * STEP_S).sum()),
            "median_s": float(np.median(self.reached_s[reached])) if reached.any() else None,
            "yards_with_contact": self.n_touched,
        }


def evaluate(steering: Steering, n_yards: int, *, first_seed: int = UNSEEN_FROM, num_threads: int = 1) -> Evaluation:
    """Steer through the open yards `first_seed`, `first_seed + 1`, ...: the same for every steering."""
    envs = PatrolVectorEnv(n_yards, open_yard(), num_threads=num_threads)
    observation, _ = envs.reset(seed=first_seed)
    reached_s, touched, running = np.full(n_yards, np.nan), np.zeros(n_yards, np.bool_), np.ones(n_yards, np.bool_)
    step = 0
    while running.any():
        observation, _, terminated, truncated, info = envs.step(steering(bearings_only(observation)))
        step += 1
        touched |= running & info["touched"]
        reached_s[running & terminated & info["success"]] = step * STEP_S
        running &= ~(terminated | truncated)
    envs.close()
    return Evaluation(reached_s=reached_s, n_touched=int(touched.sum()))


def evaluate_seek(n_yards: int) -> Evaluation:
    """Missions of `seek` in the first of the same yards, by the same measure.

    It is after something else, a position: it drives its round until it has one, and then looks at it from several
    sides. So it comes near later than who just follows the bearing.
    """
    scenario = open_yard()
    reached_s, n_touched = np.full(n_yards, np.nan), 0
    for yard in range(n_yards):
        mission = Mission(scenario, "seek", UNSEEN_FROM + yard)
        while not mission.is_over and not np.isfinite(reached_s[yard]):
            mission.step()
            if mission.is_over:
                break
            place_m = np.asarray(mission.log.meta["truth"]["sources"][0]["position_m"][:2])
            away_m = np.hypot(*(mission.env.simulation.true_pose[0, :2] - place_m))
            if away_m <= scenario.task.standoff_m:
                reached_s[yard] = mission.time_s
        n_touched += bool(np.any(mission.log.table("event")["kind"] == "contact"))
    return Evaluation(reached_s=reached_s, n_touched=n_touched)
