"""Open yards as stable-baselines3 wants them: its VecEnv on the native vector environment."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv  # pyright: ignore[reportMissingImports]

from pdpatrol.envs.patrol_env import Observation
from pdpatrol.envs.vector_env import PatrolVectorEnv
from pdpatrol.envs.wrappers import Flattener, bearings_only, bearings_only_space

FloatArray = NDArray[np.float32]


class LearnerEnvs(VecEnv):  # pyright: ignore[reportUntypedBaseClass]
    """Bearings and lidar of many robots as vectors in [-1, 1], with the resets that stable-baselines3 expects.

    It wants the step that ends an episode to tell the first observation of the next one, and the last of the old one in
    that row's info, as `terminal_observation`; `TimeLimit.truncated` there tells that only time ended it. The value of
    what would have followed then still counts. `is_success` tells that the source was reached.

    Args:
        envs: With `AutoresetMode.SAME_STEP`.

    Raises:
        ValueError: If `envs` resets in another way.
    """

    def __init__(self, envs: PatrolVectorEnv) -> None:
        if envs.autoreset_mode.value != "SameStep":
            raise ValueError(f"`envs`: autoreset_mode is {envs.autoreset_mode.value}; allowed is SameStep")
        self.envs = envs
        self._flatten = Flattener(bearings_only_space(envs.single_observation_space))
        self._actions = np.zeros((envs.num_envs, 2), dtype=np.float32)
        super().__init__(envs.num_envs, self._flatten.space, envs.single_action_space)

    def reset(self) -> FloatArray:
        """First observations, shape (n_robots, n_entries); row i is seeded with what `seed` told, plus i."""
        observation, _ = self.envs.reset(seed=list(self._seeds))
        self._reset_seeds()
        self._reset_options()
        return self._seen(observation)

    def step_async(self, actions: FloatArray) -> None:
        """Take the actions, shape (n_robots, 2)."""
        self._actions = actions

    def step_wait(self) -> tuple[FloatArray, FloatArray, NDArray[np.bool_], list[dict[str, Any]]]:
        """Step with them: observations, rewards, which rows began anew, and an info for each row."""
        observation, reward, terminated, truncated, info = self.envs.step(self._actions)
        done = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for row in np.flatnonzero(done).tolist():
            infos[row] = {
                "terminal_observation": self._seen(info["final_obs"][row]),
                "TimeLimit.truncated": bool(truncated[row] and not terminated[row]),
                "is_success": bool(info["final_info"]["success"][row]),
            }
        return self._seen(observation), reward.astype(np.float32), done, infos

    def _seen(self, observation: Observation) -> FloatArray:
        return self._flatten(bearings_only(observation))

    def close(self) -> None:
        """Close the environments."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices: int | Iterable[int] | None = None) -> list[Any]:
        """The same of the environments for every row."""
        return [getattr(self.envs, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: int | Iterable[int] | None = None) -> None:  # noqa: ANN401
        """Nothing can be set row by row."""
        raise NotImplementedError(f"`{attr_name}`: the rows are one environment; set it there, in `.envs`")

    def env_method(
        self,
        method_name: str,
        *args: Any,  # noqa: ANN401 - as stable-baselines3 declares it
        indices: int | Iterable[int] | None = None,
        **kwargs: Any,  # noqa: ANN401
    ) -> list[Any]:
        """Nothing can be called row by row."""
        raise NotImplementedError(f"`{method_name}`: the rows are one environment; call it there, in `.envs`")

    def env_is_wrapped(self, wrapper_class: type, indices: int | Iterable[int] | None = None) -> list[bool]:
        """No row is wrapped on its own."""
        return [False] * len(list(self._get_indices(indices)))
