# /// script
# requires-python = ">=3.11"
# dependencies = [
#   "pdpatrol",
#   "ray[rllib]==2.60.*",
#   "skrl==2.1.*",
#   "stable-baselines3==2.9.*",
#   "tianshou==2.0.*",
#   "torch==2.13.*",
#   "torchrl==0.14.*",
#   "tyro>=1.0",
# ]
#
# [tool.uv]
# override-dependencies = ["gymnasium>=1.4,<2"] # RLlib and Tianshou pin older versions
#
# [tool.uv.sources]
# pdpatrol = { path = "../..", editable = true }
# ///
"""Run learning libraries on PDPatrol-v0 for some steps without adapters.

    uv run examples/learning_libraries/run.py --steps 2000

Each library uses the environment that `gymnasium.make` or `gymnasium.make_vec` returns, and wraps it as the library's
documentation says. The runs are too short to learn a good policy.
"""

from __future__ import annotations

import functools
import os
import sys
import traceback
from collections.abc import Callable
from typing import Annotated, Literal

import gymnasium
import tyro

ENV = "pdpatrol:PDPatrol-v0"
N_ENVS, EPISODE = 4, 100
"""Number of environments, and steps of an episode, few enough that episodes end."""

made = functools.partial(gymnasium.make, ENV, max_episode_steps=EPISODE)
made_at_once = functools.partial(gymnasium.make_vec, ENV, num_envs=N_ENVS, max_episode_steps=EPISODE)

Library = Literal["sb3", "skrl", "torchrl", "tianshou", "rllib"]


def sb3(steps: int) -> int:
    """Run PPO on single environments with dict observations."""
    from stable_baselines3 import PPO
    from stable_baselines3.common.env_util import make_vec_env

    envs = make_vec_env(made, n_envs=N_ENVS, seed=0)
    model = PPO("MultiInputPolicy", envs, n_steps=steps // N_ENVS, batch_size=steps // N_ENVS, n_epochs=1, device="cpu")
    model.learn(steps)
    return model.num_timesteps


def skrl(steps: int) -> int:
    """Run PPO on the vector environment with observations flattened by Gymnasium."""
    from gymnasium.wrappers.vector import FlattenObservation
    from skrl.envs.wrappers.torch import wrap_env
    from skrl.utils.runner.torch import Runner

    envs = wrap_env(FlattenObservation(made_at_once()))
    layers = [{"name": "net", "input": "OBSERVATIONS", "layers": [64], "activations": "elu"}]
    actor = {"class": "GaussianMixin", "network": layers, "output": "ACTIONS", "initial_log_std": 0.0}
    critic = {"class": "DeterministicMixin", "network": layers, "output": "ONE"}
    runner = Runner(
        envs,
        {
            "seed": 0,
            "models": {"separate": True, "policy": actor, "value": critic},
            "memory": {"class": "RandomMemory", "memory_size": -1},
            "agent": {"class": "PPO", "rollouts": 100, "experiment": {"write_interval": 0, "checkpoint_interval": 0}},
            "trainer": {
                "class": "SequentialTrainer",
                "timesteps": steps // N_ENVS,
                "disable_progressbar": True,
                "headless": True,
            },
        },
    )
    runner.run()
    return steps // N_ENVS * N_ENVS


def torchrl(steps: int) -> int:
    """Run a collector with random actions on one environment, on four in processes, and on the vector environment.

    All entries of `info` are read where TorchRL supports it.
    """
    from torchrl.collectors import Collector
    from torchrl.envs import GymEnv, GymWrapper

    ways: list[Callable[[], GymWrapper]] = [
        lambda: GymWrapper(made()).auto_register_info_dict(),
        lambda: GymEnv(ENV, num_envs=N_ENVS, max_episode_steps=EPISODE),
        lambda: GymWrapper(made_at_once(autoreset_mode="SameStep")),
        lambda: GymWrapper(made_at_once(autoreset_mode="Disabled")).auto_register_info_dict(),
    ]
    taken = []
    for make in ways:
        collector = Collector(make(), None, frames_per_batch=steps // 4, total_frames=steps)
        taken.append(sum(batch.numel() for batch in collector))
        collector.shutdown()
    return min(taken)


def tianshou(steps: int) -> int:
    """Run a collector with random actions on single environments; its buffer keeps all of `info`."""
    from tianshou.algorithm.random import MARLRandomDiscreteMaskedOffPolicyAlgorithm as Random
    from tianshou.data import Collector, VectorReplayBuffer
    from tianshou.env import DummyVectorEnv

    envs = DummyVectorEnv([made for _ in range(N_ENVS)])
    collector = Collector(Random(made().action_space), envs, VectorReplayBuffer(steps, N_ENVS))
    collector.reset()
    return collector.collect(n_step=steps, random=True).n_collected_steps


def rllib(steps: int) -> int:
    """Run PPO on the vector environment and on single environments."""
    os.environ["RAY_ENABLE_UV_RUN_RUNTIME_ENV"] = "0"  # no workers need this environment
    from ray.rllib.algorithms.ppo import PPOConfig
    from ray.rllib.connectors.env_to_module import FlattenObservations

    taken = []
    for mode in (gymnasium.VectorizeMode.VECTOR_ENTRY_POINT, gymnasium.VectorizeMode.SYNC):
        config = (
            PPOConfig()
            .environment(ENV, env_config={"max_episode_steps": EPISODE})
            .env_runners(
                num_env_runners=0,
                num_envs_per_env_runner=N_ENVS,
                gym_env_vectorize_mode=mode,
                env_to_module_connector=lambda env, spaces, device: FlattenObservations(),
            )
            .training(train_batch_size_per_learner=steps, minibatch_size=steps // 4, num_epochs=1)
        )
        algorithm = config.build_algo()
        taken.append(int(algorithm.train()["num_env_steps_sampled_lifetime"]))
        algorithm.stop()
    return min(taken)


RUNS: dict[str, Callable[[int], int]] = {run.__name__: run for run in (sb3, skrl, torchrl, tianshou, rllib)}


def main(
    libraries: Annotated[tuple[Library, ...], tyro.conf.Positional] = ("sb3", "skrl", "torchrl", "tianshou", "rllib"),
    steps: int = 2000,
) -> None:
    """Run learning libraries on PDPatrol-v0.

    Args:
        libraries: Names of the libraries.
        steps: Minimum number of environment steps for each.
    """
    failed = 0
    for name in libraries:
        try:
            taken = RUNS[name](steps)
        except Exception:
            traceback.print_exc()
            failed += 1
        else:
            sys.stdout.write(f"{name}: {taken} steps\n")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    tyro.cli(main)
