"""PatrolVectorEnv: vectorised environment of many robots, each in its own copy of one yard."""

import operator
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import error, spaces
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from dirmusic.arrays import BoolArray
from pdpatrol.envs.episode import ResetOptions
from pdpatrol.envs.observation import Observation
from pdpatrol.envs.patrol_env import SimulatedEnv, resolve_scenario
from pdpatrol.envs.scenario import Scenario
from pdpatrol.envs.simulation import Simulation


class PatrolVectorEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    SimulatedEnv, VectorEnv[Observation, NDArray[np.float32], NDArray[Any]]
):
    """Vectorised environment of many robots; made by `gymnasium.make_vec("pdpatrol:PDPatrol-v0", num_envs=N)`.

    Row i is bit-identical to a `PatrolEnv` that was reset with `seed + i`, for any N and any number of threads. The
    physics runs on several threads; sensing and direction finding are batched over all rows.

    ## Spaces
    The same spaces as in `PatrolEnv`, with one row per robot.

    ## Episodes
    With `AutoresetMode.NEXT_STEP`, the default, the step after the end of an episode starts the next episode: the
    action is ignored, the reward is 0, and the observation is the first of the new episode. With `SAME_STEP`, the step
    that ends an episode returns the first observation of the next one, and `info["final_obs"]` and
    `info["final_info"]` hold the last observation and info of the old one. With `DISABLED`,
    `reset(options={"reset_mask": mask})` resets the rows where the mask is True.

    ## Info
    `info` has the entries of `PatrolEnv` as arrays with one row per robot, and for each `key` a mask `_key` of the rows
    that have this entry, as in `gymnasium.vector.SyncVectorEnv`. With `full_info`, it also has `pulses`, a dict of
    arrays with one row per pulse of any robot: `robot`, and the columns of a `dirmusic.PulseBatch`.

    ## Order of calls
    These calls raise `gymnasium.error.ResetNeeded`: `step` before `reset`; with `DISABLED`, `step` while the episode of
    a row is over; and a first `reset` of only some of the rows. After `close`, `step` and `reset` raise
    `gymnasium.error.ClosedEnvironmentError`.

    Args:
        num_envs: Number of robots.
        scenario: Scenario of all rows: the name of a shipped scenario, the path of a TOML file, a `Scenario` or its
            plain data.
        terminate_on_approach: Whether an episode ends once all sources are approached.
        full_info: Whether `info` also holds the pulses of each step, which have no fixed shape.
        max_episode_steps: Maximum number of steps of an episode, in addition to the scenario's time limit.
        num_threads: Number of threads for physics and receivers, 0 for all cores. Results do not depend on it.
        autoreset_mode: When the next episode of a row starts.
        render_mode: Must be None; to render, make a single `PatrolEnv`.

    Raises:
        ScenarioError: If the scenario has errors; all of them are listed.
    """

    def __init__(
        self,
        num_envs: int = 1,
        scenario: str | Path | Scenario | Mapping[str, Any] = "one_source",
        *,
        terminate_on_approach: bool = True,
        full_info: bool = False,
        max_episode_steps: int | None = None,
        num_threads: int = 0,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: None = None,
    ) -> None:
        if render_mode is not None:
            raise ValueError(f"`render_mode` must be None, got {render_mode!r}; make a single environment for pictures")
        if num_envs < 1 or num_threads < 0 or (max_episode_steps is not None and max_episode_steps < 1):
            raise ValueError(
                "`num_envs` and `max_episode_steps` must be at least 1 and `num_threads` at least 0, got "
                f"{num_envs}, {max_episode_steps} and {num_threads}"
            )
        shared = resolve_scenario(scenario)
        if callable(shared):
            raise ValueError(
                "`scenario` must be one scenario for all rows, got a function; use "
                'vectorization_mode="sync", where each row draws its own'
            )
        self.num_envs, self._full_info = num_envs, full_info
        self.simulation = Simulation(
            shared,
            num_envs,
            num_threads,
            terminate_on_approach=terminate_on_approach,
            max_episode_steps=max_episode_steps,
        )
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {"render_modes": [], "autoreset_mode": self.autoreset_mode}
        self.single_action_space = spaces.Box(-1.0, 1.0, (2,))
        self.single_observation_space = self.simulation.layout.space
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._rngs = [seeding.np_random() for _ in range(num_envs)]
        self._all_rows = np.ones(num_envs, dtype=np.bool_)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode in every row, or in the rows of `options["reset_mask"]`.

        Args:
            seed: An integer, so that row i is seeded with `seed + i`; a list with one seed per row; or None to continue
                with the current generators.
            options: `reset_mask`, boolean, shape (num_envs,), and the options of `PatrolEnv.reset`.
        """
        self._check_call("reset")
        others = {} if options is None else dict(options)
        mask = others.pop("reset_mask", self._all_rows)
        is_mask = isinstance(mask, np.ndarray) and mask.shape == (self.num_envs,) and mask.dtype == np.bool_
        if not is_mask or not mask.any():
            raise ValueError(
                f"`options`: reset_mask must be an array of {self.num_envs} booleans, at least one of them True, got "
                f"{mask!r:.80}"
            )
        if not (mask.all() or self.simulation.has_begun):
            raise error.ResetNeeded("Cannot reset some rows before calling env.reset() for all of them")
        values = ResetOptions.parse(others, self.scenario)
        self._rngs = self._seeded(seed, mask)
        self._start(mask, values)
        return self._observation(), self._info(mask)

    def _seeded(self, seed: Any, mask: BoolArray) -> list[tuple[np.random.Generator, int]]:  # noqa: ANN401 - anything
        """Return the generators of all rows and their seeds, new ones for rows of the mask that are seeded."""
        if seed is None:
            return self._rngs
        seeds = seed if np.ndim(seed) else range(seed, seed + self.num_envs)
        if len(seeds) != self.num_envs:
            raise ValueError(f"`seed` must be an integer or {self.num_envs} of them, got {seed!r}")
        return [
            seeding.np_random(operator.index(each)) if is_chosen and each is not None else old
            for old, each, is_chosen in zip(self._rngs, seeds, mask, strict=True)
        ]

    @property
    def np_random(self) -> tuple[np.random.Generator, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Random generators of the rows."""
        return tuple(rng for rng, _ in self._rngs)

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Seeds of the rows."""
        return tuple(seed for _, seed in self._rngs)

    def _start(self, mask: BoolArray, options: ResetOptions) -> None:
        """Start new episodes in the rows of a mask, if any."""
        rows = np.flatnonzero(mask)
        if rows.size:
            self.simulation.start(rows, [self._rngs[row][0] for row in rows], options)

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[Observation, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Drive all robots for 0.1 s and record the pulses that they detect."""
        self._check_call("step")
        simulation, states = self.simulation, self.simulation.states
        was_over = states.terminated | states.truncated
        commands = self._commands(actions, (self.num_envs, 2))
        if was_over.any() and self.autoreset_mode is AutoresetMode.DISABLED:
            over = np.flatnonzero(was_over).tolist()
            raise error.ResetNeeded(f"rows {over} are over; reset them with options={{'reset_mask': mask}} first")
        if not was_over.all():
            simulation.step(commands, np.flatnonzero(~was_over) if was_over.any() else None)
        self._start(was_over, ResetOptions())
        reward, terminated, truncated = states.reward.copy(), states.terminated.copy(), states.truncated.copy()
        is_over = terminated | truncated
        final = dict[str, Any]()
        if self.autoreset_mode is AutoresetMode.SAME_STEP and is_over.any():
            vectors, final_obs = simulation.observe(), np.full(self.num_envs, None, dtype=object)
            for row in np.flatnonzero(is_over).tolist():
                final_obs[row] = simulation.layout.split(vectors[row].copy())
            final = {"final_obs": final_obs, "final_info": self._info(is_over)}
            final |= {"_final_obs": is_over, "_final_info": is_over.copy()}
            self._start(is_over, ResetOptions())
        return self._observation(), reward, terminated, truncated, self._info(self._all_rows) | final

    def _observation(self) -> Observation:
        return self.simulation.layout.split(self.simulation.observe())

    def _info(self, rows: BoolArray) -> dict[str, Any]:
        """Arrange the info as in `SyncVectorEnv`: zeros in rows without an entry, and a mask for each key."""
        info = dict[str, Any]()
        for key, values in self.simulation.info.items():
            info[key], info[f"_{key}"] = np.zeros_like(values), rows.copy()
            info[key][rows] = values[rows]
        if self._full_info:
            info["pulses"] = {"robot": self.simulation.pulse_rows, **self.simulation.pulses._asdict()}
        return info
