"""PPO in open yards, and its learning curve."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch  # pyright: ignore[reportMissingImports]
from stable_baselines3 import PPO  # pyright: ignore[reportMissingImports]
from stable_baselines3.common.callbacks import BaseCallback  # pyright: ignore[reportMissingImports]
from stable_baselines3.common.vec_env import VecNormalize  # pyright: ignore[reportMissingImports]

from pdpatrol.envs.patrol_env import Observation
from pdpatrol.envs.random_yard import open_yard
from pdpatrol.envs.vector_env import PatrolVectorEnv
from pdpatrol.envs.wrappers import Flattener, bearings_only_space
from pdpatrol.missions.learning.evaluation import evaluate
from pdpatrol.missions.learning.learner_envs import LearnerEnvs
from pdpatrol.missions.learning.steering import Actions, Steering

N_ROBOTS = 64
N_STEPS = 128
"""Steps of each robot between two updates: 13 s, of an episode of 90 s at most."""

BATCH = 1024
EPOCHS = 10
LEARNING_RATE = 3e-4
GAMMA = 0.99
"""Looks ahead 10 s: progress is paid at once, only getting round something would need more."""

HIDDEN = (64, 64)
"""All of the above are assumed: stable-baselines3's defaults, but for more robots and larger batches."""

CURVE_FROM = 900_000
CURVE_YARDS = 50
CURVE_EVERY = 2
"""The learning curve: in so many yards, the same every time and never trained in, after so many updates."""

Curve = list[dict[str, float]]


class _Watch(BaseCallback):  # pyright: ignore[reportUntypedBaseClass]
    """Tries the policy from time to time, between two updates."""

    def __init__(self, num_threads: int, advance: Callable[[int], None]) -> None:
        super().__init__()
        self.curve: Curve = []
        self._num_threads, self._advance, self._n_rounds = num_threads, advance, 0

    def _on_rollout_start(self) -> None:
        if self._n_rounds % CURVE_EVERY == 0:
            self.look()
        self._n_rounds += 1

    def _on_step(self) -> bool:
        self._advance(self.training_env.num_envs)
        return True

    def look(self) -> None:
        """Note how the policy does as it is now."""
        tried = evaluate(steering_of(self.model), CURVE_YARDS, first_seed=CURVE_FROM, num_threads=self._num_threads)
        self.curve.append({"steps": self.num_timesteps, "success": tried.success, "yards": CURVE_YARDS})


def train(
    steps: int, seed: int, *, num_threads: int = 1, advance: Callable[[int], None] = lambda n: None
) -> tuple[Any, Curve]:
    """Train PPO on one thread of its own; the same seed gives the same policy on the same machine.

    Args:
        steps: Of all robots together, in whole rounds of `N_ROBOTS * N_STEPS`, rounded up.
        seed: Row i of the training yards is seeded with `seed + i`.
        num_threads: Of the physics.
        advance: Called with the number of steps that were taken.

    Returns:
        The model, and the learning curve: after so many `steps`, the share `success` of so many `yards` in which it
        reached the source, with the mean of its actions.
    """
    torch.set_num_threads(1)
    envs = LearnerEnvs(PatrolVectorEnv(N_ROBOTS, open_yard(), num_threads=num_threads, autoreset_mode="SameStep"))
    watch = _Watch(num_threads, advance)
    model = PPO(
        "MlpPolicy",
        VecNormalize(envs, norm_obs=False, norm_reward=True, gamma=GAMMA),
        n_steps=N_STEPS,
        batch_size=BATCH,
        n_epochs=EPOCHS,
        learning_rate=LEARNING_RATE,
        gamma=GAMMA,
        policy_kwargs={"net_arch": list(HIDDEN), "activation_fn": torch.nn.Tanh},
        seed=seed,
        device="cpu",
    )
    model.learn(steps, callback=watch)
    watch.look()
    envs.close()
    return model, watch.curve


def steering_of(model: Any) -> Steering:  # noqa: ANN401 - a PPO, which those without the extra do not have
    """What the model has learned, without drawing: the mean of its actions."""
    whole = PatrolVectorEnv(1, open_yard(), num_threads=1).single_observation_space
    flatten = Flattener(bearings_only_space(whole))

    def steer(observation: Observation) -> Actions:
        actions, _ = model.predict(flatten(observation), deterministic=True)
        return actions

    return steer
