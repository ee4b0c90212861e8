"""PatrolVectorEnv: many robots at once, each in its own copy of one yard."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import error, spaces
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from pdpatrol.envs.core.arguments import (
    NOTHING_FIXED,
    Fixed,
    checked_actions,
    checked_count,
    checked_seed,
    given_scenario,
    told_spec,
)
from pdpatrol.envs.core.info import fixed_info, joined_pulses, masked, mixed, pulse_columns
from pdpatrol.envs.core.simulation import STEP_S, Outcome, Simulation
from pdpatrol.envs.patrol_env import Observation, observation_space
from pdpatrol.envs.scenario import Scenario

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Rows = NDArray[np.intp]

STEPS, RESET_MASK = "max_episode_steps", "reset_mask"


class PatrolVectorEnv(VectorEnv[Observation, NDArray[np.float32], NDArray[Any]]):
    """PDPatrol, many robots at once: what `gymnasium.make_vec("pdpatrol:PDPatrol-v0", num_envs=N)` gives.

    Row i is, to the bit, what a `PatrolEnv` gives that was reset with `seed + i`, whatever N and the number of threads.
    The physics runs on threads; sensing and direction finding of all rows are computed together.

    ## Spaces
    Those of `PatrolEnv`, with a row for each robot.

    ## Episodes
    With `AutoresetMode.NEXT_STEP`, the default, the step after the end of an episode starts the next one: its action
    does not count, its reward is 0 and its observation the first of the new episode. With `SAME_STEP` the step that
    ends an episode tells the first observation of the next one, and `info["final_obs"]` and `info["final_info"]` hold
    how the old one ended. With `DISABLED`, `reset(options={"reset_mask": mask})` starts anew the rows of a mask.

    ## Info
    That of `PatrolEnv`, arrays with a row for each robot, and a mask `_key` of the rows that have an entry for each
    `key`, as in `gymnasium.vector.SyncVectorEnv`. With `full_info` also `pulses`, a dict of arrays with a row
    for each pulse of any robot: `robot` (whose it is), and the columns of a `dirmusic.PulseBatch`.

    ## Order of calls
    `step` before `reset`, and of a row that is over with `DISABLED`, raises `gymnasium.error.ResetNeeded`, as does a
    first `reset` of some rows only; after `close` both raise `gymnasium.error.ClosedEnvironmentError`.

    Args:
        num_envs: How many robots.
        scenario: Name of a shipped scenario, path of a TOML file, a `Scenario` or its plain data; one yard for all
            rows.
        terminate_on_approach: Whether an episode ends once all sources are approached.
        full_info: Whether `info` also holds the pulses of each step, which have no fixed shape.
        max_episode_steps: After how many steps an episode is truncated at the latest, as `gymnasium.make` takes it;
            None for the scenario's time limit alone.
        num_threads: On how many threads the physics runs and receivers listen; 0 for all cores. The result
            does not depend on it.
        autoreset_mode: When the next episode of a row starts.
        render_mode: None; make a single environment for pictures.

    Raises:
        ScenarioError: If the scenario has faults; all are listed.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - the base class declares it so
        "render_modes": [],
        "render_fps": round(1 / STEP_S),
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

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
            raise ValueError(
                f"`render_mode`: got {render_mode!r}; allowed is None: make a single environment for pictures"
            )
        shared = given_scenario(scenario)
        if callable(shared):
            raise ValueError(
                "`scenario`: got a function; all rows share one yard: allowed is a scenario, or "
                'vectorization_mode="sync", where each row draws its own'
            )
        self.num_envs = num_envs = checked_count("num_envs", num_envs, 1)
        self.simulation = Simulation(
            shared,
            num_envs,
            checked_count("num_threads", num_threads, 0),
            terminate_on_approach=terminate_on_approach,
            max_episode_steps=None if max_episode_steps is None else checked_count(STEPS, max_episode_steps, 1),
        )
        self._full_info = full_info
        self._spec: EnvSpec | None = None
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        self.single_action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
        self.single_observation_space = observation_space(self.simulation)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._rngs: list[tuple[np.random.Generator, int] | None] = [None] * num_envs
        self._is_over = np.zeros(num_envs, dtype=np.bool_)
        self._observation = np.empty((num_envs, 0), dtype=np.float32)

    @property
    def scenario(self) -> Scenario:
        """Of all episodes."""
        return self.simulation.scenario

    @property
    def spec(self) -> EnvSpec | None:
        """How Gymnasium made it, with the length of an episode in steps; it goes through JSON."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:  # pyright: ignore[reportIncompatibleVariableOverride]
        self._spec = told_spec(spec, self.simulation.max_episode_steps)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode in every row, or in those of `options["reset_mask"]`; other options are as of `PatrolEnv`.

        Args:
            seed: Row i gets `seed + i`; or a list with one for each row. None goes on with the generators there are.
                Whole numbers from 0 on, of Python or NumPy.
            options: `reset_mask`, truth values of shape (num_envs,), and what `PatrolEnv.reset` takes.
        """
        self._check_open("reset")
        others: Any = options
        if isinstance(options, Mapping):
            others = {key: value for key, value in options.items() if key != RESET_MASK}
        mask = self._mask(options)
        rows, fixed, seeds = np.flatnonzero(mask), Fixed.checked(others, self.scenario), self._seeds(seed)
        outcome = self._start(rows, fixed, seeds=seeds)
        self._observation = (
            outcome.observation if rows.size == self.num_envs else mixed(self._observation, outcome.observation, rows)
        )
        return self.simulation.layout.parts(self._observation), self._info(outcome, mask)

    def _mask(self, options: Any) -> BoolArray:  # noqa: ANN401 - it may be anything
        """Which rows a reset is of."""
        if not isinstance(options, Mapping) or RESET_MASK not in options:
            return np.ones(self.num_envs, dtype=np.bool_)
        try:
            mask: NDArray[Any] = np.asarray(options[RESET_MASK])
        except (TypeError, ValueError):
            mask = np.empty(0)
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_ or not mask.any():
            came = f"{options[RESET_MASK]!r}; allowed are {self.num_envs} truth values with one true"
            raise ValueError(f"`options`: reset_mask: got {came}")
        if not (mask.all() or self.simulation.has_begun):
            raise error.ResetNeeded("Cannot reset some rows before calling env.reset() for all of them")
        return mask

    def _seeds(self, seed: Any) -> list[int | None]:  # noqa: ANN401 - it may be anything
        """A seed for each row, or None."""
        if not isinstance(seed, (list, tuple, np.ndarray)) or (isinstance(seed, np.ndarray) and seed.ndim == 0):
            first = checked_seed(seed)
            return [None if first is None else first + row for row in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise ValueError(f"`seed`: got {seed!r}; allowed is a whole number, or {self.num_envs} of them")
        return [checked_seed(each) for each in seed]

    def _rng(self, row: int) -> tuple[np.random.Generator, int]:
        """Generator of a row, and the seed that it is of."""
        self._rngs[row] = drawn = self._rngs[row] or seeding.np_random()
        return drawn

    @property
    def np_random(self) -> tuple[np.random.Generator, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The generators of the rows, as `SyncVectorEnv` tells them."""
        return tuple(self._rng(row)[0] for row in range(self.num_envs))

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The seeds of the rows, as `SyncVectorEnv` tells them."""
        return tuple(self._rng(row)[1] for row in range(self.num_envs))

    def _start(
        self,
        rows: Rows,
        fixed: Fixed = NOTHING_FIXED,
        commands: FloatArray | None = None,
        seeds: Sequence[int | None] | None = None,
    ) -> Outcome:
        """New episodes in some rows; the others take a step, if there are commands, or wait."""
        known = [None] * self.num_envs if seeds is None else seeds
        rngs = [self._rng(row) if known[row] is None else seeding.np_random(known[row]) for row in rows.tolist()]
        self.simulation.reset(rows, [rng for rng, _ in rngs], fixed)
        for row, rng in zip(rows.tolist(), rngs, strict=True):
            self._rngs[row] = rng
        self._is_over[rows] = False
        return self.simulation.step(commands, started=rows)

    def _check_open(self, call: str) -> None:
        if self.closed:
            raise error.ClosedEnvironmentError(f"Cannot call env.{call}() after calling env.close()")

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[Observation, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Drive all robots for 0.1 s, then listen; see the class for what comes back."""
        self._check_open("step")
        if not self.simulation.has_begun:
            raise error.ResetNeeded("Cannot call env.step() before calling env.reset()")
        wanted = self.simulation.robot.command_from_action(checked_actions(actions, (self.num_envs, 2)))
        over = np.flatnonzero(self._is_over)
        if over.size and self.autoreset_mode is AutoresetMode.NEXT_STEP:
            outcome = self._start(over, commands=wanted)
        elif over.size:
            raise error.ResetNeeded(
                f"rows {over.tolist()} are over; reset them with options={{'reset_mask': mask}} first"
            )
        else:
            outcome = self.simulation.step(wanted)
        self._is_over = outcome.terminated | outcome.truncated
        self._observation, info = outcome.observation, self._info(outcome)
        if self.autoreset_mode is AutoresetMode.SAME_STEP and self._is_over.any():
            self._observation, info = self._restarted(outcome, info)
        observation, reward = self.simulation.layout.parts(self._observation), outcome.reward.sum(axis=0)
        return observation, reward, outcome.terminated, outcome.truncated, info

    def _restarted(self, ended: Outcome, info: dict[str, Any]) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Observations with the first ones of new episodes, and an info with how the old ones ended."""
        rows = np.flatnonzero(self._is_over)
        final = np.full(self.num_envs, None, dtype=object)
        for row in rows.tolist():
            final[row] = self.simulation.layout.parts(ended.observation[row].copy())
        begun = self._start(rows)
        over = np.zeros(self.num_envs, dtype=np.bool_)
        over[rows] = True
        told: dict[str, Any] = {
            key: mixed(info[key], values, rows) for key, values in self._info(begun).items() if key != "pulses"
        }
        final_info = masked({key: info[key] for key in fixed_info(self.simulation, ended)}, over)
        if self._full_info:
            told["pulses"] = joined_pulses(info["pulses"], pulse_columns(begun), over)
            final_info["pulses"] = info["pulses"]
        return mixed(ended.observation, begun.observation, rows), {
            **told,
            "final_obs": final,
            "_final_obs": over,
            "final_info": final_info,
            "_final_info": over.copy(),
        }

    def _info(self, outcome: Outcome, rows: BoolArray | None = None) -> dict[str, Any]:
        every = np.ones(self.num_envs, dtype=np.bool_)
        info = masked(fixed_info(self.simulation, outcome), every if rows is None else rows)
        if self._full_info:
            info["pulses"] = pulse_columns(outcome)
        return info

    def close_extras(self, **kwargs: Any) -> None:  # noqa: ANN401 - as Gymnasium declares it
        """Nothing is open."""
