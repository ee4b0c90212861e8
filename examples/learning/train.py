"""Train PPO to reach the discharge in an open yard from bearings and lidar, and draw the learning curve.

uv run --extra rl python examples/learning/train.py

Writes model.zip, learning_curve.json and learning.png.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import torch
import tyro
from gymnasium.vector import AutoresetMode
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv, VecNormalize

from pdpatrol.envs.observation import Observation
from pdpatrol.envs.vector_env import PatrolVectorEnv
from pdpatrol.envs.wrappers import Flattener, bearings_only, bearings_only_space

Array = NDArray[Any]
Steering = Callable[[Observation], Array]
"""Function that maps the observations of all robots, as of `bearings_only`, to actions, shape (n_robots, 2)."""

OPEN_YARD = Path(__file__).with_name("open_yard.toml")
N_ROBOTS = 64
N_STEPS = 128
"""Steps of each robot between two updates: 13 s out of at most 90 s of an episode."""

CURVE_SEED, CURVE_YARDS = 900_000, 50
EVALUATION_SEED = 1_000_000
"""First seeds of the yards of the learning curve and of the final evaluation; no training run of practical length
reaches them."""

STEP_S = 0.1
ROBOT_COLOUR, RULE_COLOUR, RANDOM_COLOUR = "#2f6db3", "#e0762b", "#8a8f98"


class FlatVecEnv(VecEnv):
    """`PatrolVectorEnv` for Stable-Baselines3: bearings and lidar as vectors in [-1, 1].

    Stable-Baselines3 expects the step that ends an episode to return the first observation of the next one, and the
    last observation of the old one as `terminal_observation` in the info of that robot.
    """

    def __init__(self, num_envs: int) -> None:
        self.envs = PatrolVectorEnv(num_envs, OPEN_YARD, autoreset_mode=AutoresetMode.SAME_STEP)
        self.flatten = Flattener(bearings_only_space(self.envs.single_observation_space))
        super().__init__(num_envs, self.flatten.space, self.envs.single_action_space)

    def reset(self) -> Array:
        """Start an episode in every row."""
        observation, _ = self.envs.reset(seed=list(self._seeds))
        self._reset_seeds()
        return self.flatten(bearings_only(observation))

    def step_async(self, actions: Array) -> None:
        """Store the actions for `step_wait`."""
        self.actions = actions

    def step_wait(self) -> tuple[Array, Array, Array, list[dict[str, Any]]]:
        """Step all rows."""
        observation, reward, terminated, truncated, info = self.envs.step(self.actions)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for row in np.flatnonzero(terminated | truncated):
            infos[row] = {
                "terminal_observation": self.flatten(bearings_only(info["final_obs"][row])),
                "TimeLimit.truncated": bool(truncated[row] and not terminated[row]),
                "is_success": bool(info["final_info"]["is_success"][row]),
            }
        return self.flatten(bearings_only(observation)), reward.astype(np.float32), terminated | truncated, infos

    def close(self) -> None:
        """Close the environments."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices: int | Iterable[int] | None = None) -> list[Any]:
        """Return an attribute of the vector environment for each row."""
        return [getattr(self.envs, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: int | Iterable[int] | None = None) -> None:  # noqa: ANN401
        """Refuse to set an attribute of single rows."""
        raise NotImplementedError("the rows are one environment")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:  # noqa: ANN401
        """Refuse to call a method of single rows."""
        raise NotImplementedError("the rows are one environment")

    def env_is_wrapped(self, wrapper_class: type, indices: int | Iterable[int] | None = None) -> list[bool]:
        """Report that no row has a wrapper."""
        return [False] * len(list(self._get_indices(indices)))


def towards_last_bearing(observation: Observation) -> Array:
    """Turn towards the last bearing, and drive faster the closer it is to straight ahead."""
    ahead, left = observation["bearing"][..., 0], observation["bearing"][..., 1]
    turn = np.clip(1.5 * np.arctan2(left, ahead), -1.0, 1.0)
    return np.stack([np.clip(ahead, 0.0, 1.0), turn], axis=-1).astype(np.float32)


def random_steering(seed: int, hold_steps: int = 10) -> Steering:
    """Return a steering function that draws new random actions every `hold_steps` steps."""
    rng = np.random.default_rng(seed)
    step, actions = 0, np.empty(0)

    def steer(observation: Observation) -> Array:
        nonlocal step, actions
        if step % hold_steps == 0:
            actions = rng.uniform(-1.0, 1.0, (len(observation["bearing"]), 2)).astype(np.float32)
        step += 1
        return actions

    return steer


def evaluate(steering: Steering, n_yards: int, first_seed: int) -> dict[str, Any]:
    """Count the yards in which a steering function reaches the source in time, and compute its median time."""
    envs = PatrolVectorEnv(n_yards, OPEN_YARD)
    observation, _ = envs.reset(seed=first_seed)
    reached_s, running, step = np.full(n_yards, np.nan), np.ones(n_yards, np.bool_), 0
    while running.any():
        observation, _, terminated, truncated, info = envs.step(steering(bearings_only(observation)))
        step += 1
        reached_s[running & info["is_success"]] = step * STEP_S
        running &= ~(terminated | truncated)
    envs.close()
    reached = np.isfinite(reached_s)
    median_s = float(np.median(reached_s[reached])) if reached.any() else None
    return {"yards": n_yards, "reached": int(reached.sum()), "success": float(reached.mean()), "median_s": median_s}


def steering_of(model: PPO) -> Steering:
    """Return the steering function that a model has learned: the mean of its action distribution."""
    flatten = Flattener(bearings_only_space(PatrolVectorEnv(1, OPEN_YARD).single_observation_space))
    return lambda observation: model.predict(flatten(observation), deterministic=True)[0]


class LearningCurve(BaseCallback):
    """Callback that evaluates the policy before every second update.

    Attributes:
        points: Number of training steps, and fraction of yards in which the policy reached the source.
    """

    def __init__(self) -> None:
        super().__init__()
        self.points: list[dict[str, Any]] = []
        self.n_rollouts = 0

    def _on_rollout_start(self) -> None:
        if self.n_rollouts % 2 == 0:
            self.add_point()
        self.n_rollouts += 1

    def _on_step(self) -> bool:
        return True

    def add_point(self) -> None:
        """Evaluate the current policy and add the result to the curve."""
        result = evaluate(steering_of(self.model), CURVE_YARDS, CURVE_SEED)
        self.points.append({"steps": self.num_timesteps, "success": result["success"]})
        print(f"{self.num_timesteps} steps: {result['success']:.0%}")  # noqa: T201


def train(steps: int, seed: int) -> tuple[PPO, list[dict[str, Any]]]:
    """Train PPO; the same seed gives the same policy on the same machine.

    Args:
        steps: Steps of all robots together, rounded up to a multiple of `N_ROBOTS * N_STEPS`.
        seed: Seed of the learner; the yard of row i is seeded with `seed + i`.
    """
    torch.set_num_threads(1)
    envs = FlatVecEnv(N_ROBOTS)
    model = PPO(
        "MlpPolicy",
        VecNormalize(envs, norm_obs=False, norm_reward=True, gamma=0.99),
        n_steps=N_STEPS,
        batch_size=1024,
        learning_rate=3e-4,
        gamma=0.99,
        policy_kwargs={"net_arch": [64, 64], "activation_fn": torch.nn.Tanh},
        seed=seed,
        device="cpu",
    )
    curve = LearningCurve()
    model.learn(steps, callback=curve)
    curve.add_point()
    envs.close()
    return model, curve.points


def draw_curve(points: list[dict[str, Any]], policies: dict[str, dict[str, Any]]) -> Figure:
    """Draw the success rate over training steps, with the simple rule and random actions for comparison."""
    figure = Figure(figsize=(8, 3.6), layout="constrained")
    axes = figure.add_subplot()
    for name, colour in (("towards last bearing", RULE_COLOUR), ("random", RANDOM_COLOUR)):
        success, n_yards = policies[name]["success"], policies[name]["yards"]
        axes.axhline(success, color=colour, ls="--", label=f"{name}, {success:.1%} of {n_yards} yards")
    thousands = [point["steps"] / 1000 for point in points]
    label = f"PPO during training, {CURVE_YARDS} other yards"
    axes.plot(thousands, [point["success"] for point in points], color=ROBOT_COLOUR, marker="o", ms=3.5, label=label)
    final = policies["PPO"]
    label = f"PPO after training, {final['success']:.1%} of {final['yards']} yards"
    axes.plot(thousands[-1], final["success"], "s", color=ROBOT_COLOUR, label=label)
    axes.set(xlabel="training steps, thousands", ylabel="yards in which the\nsource was reached", ylim=(-0.03, 1.06))
    axes.yaxis.set_major_formatter(PercentFormatter(1.0))
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.3)
    axes.legend(loc="center right", framealpha=1.0, edgecolor="none")
    return figure


def main(*, steps: int = 300_000, yards: int = 200, seed: int = 0, out: Path = Path("runs/learning")) -> None:
    """Train PPO and compare it with following the last bearing and with random actions, in yards it has never seen.

    Args:
        steps: Training steps of 64 robots together.
        yards: Yards of the final evaluation.
        seed: Seed of the training.
        out: Folder for model.zip, learning_curve.json and learning.png.
    """
    out.mkdir(parents=True, exist_ok=True)
    model, points = train(steps, seed)
    model.save(out / "model.zip")
    steerings = {
        "PPO": steering_of(model),
        "towards last bearing": towards_last_bearing,
        "random": random_steering(seed),
    }
    policies = {name: evaluate(steering, yards, EVALUATION_SEED) for name, steering in steerings.items()}
    text = json.dumps({"seed": seed, "curve": points, "policies": policies}, indent=2)
    (out / "learning_curve.json").write_text(text + "\n", encoding="utf-8")
    draw_curve(points, policies).savefig(out / "learning.png", dpi=140)
    for name, result in policies.items():
        median = "-" if result["median_s"] is None else f"{result['median_s']:.1f} s"
        print(f"{name}: {result['reached']} of {yards} yards, median time {median}")  # noqa: T201


if __name__ == "__main__":
    tyro.cli(main)
