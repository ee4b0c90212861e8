"""PatrolVectorEnv: many robots at once, each in its own copy of one yard."""

from __future__ import annotations

import copy
import operator
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from envs.core.progress import REWARD_TERMS
from envs.core.simulation import STEP_S, Outcome, Simulation
from envs.patrol_env import Observation, observation_space
from envs.scenario import Scenario, load_scenario

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Rows = NDArray[np.intp]


class PatrolVectorEnv(VectorEnv[Observation, NDArray[np.float32], NDArray[Any]]):
    """PDPatrol, many robots at once: what `gymnasium.make_vec("envs:PDPatrol-v0", num_envs=N)` gives.

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
    Arrays with a row for each robot: `time_s`, `pose` (believed), `odometry`, `battery`, `reward` (a dict of terms),
    `touched` (whether anything was), `fell_over`, `true_pose` (for logs and scores: no policy may see it). And
    `pulses`, a dict of arrays with a row for each pulse of any robot: `robot` (whose it is), and the columns of a
    `dirmusic.PulseBatch`.

    Args:
        num_envs: How many robots.
        scenario: Name of a shipped scenario, path of a TOML file, or a `Scenario`; one yard for all rows.
        terminate_on_approach: Whether an episode ends once all sources are approached.
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
        scenario: str | Path | Scenario = "one_source",
        *,
        terminate_on_approach: bool = True,
        num_threads: int = 0,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: None = None,
    ) -> None:
        if num_envs < 1:
            raise ValueError(f"`num_envs` must be 1 or more, got {num_envs}")
        if render_mode is not None:
            raise ValueError(
                f"`render_mode`: got {render_mode!r}; allowed is None: make a single environment for pictures"
            )
        self.num_envs = num_envs
        self.simulation = Simulation(
            load_scenario(scenario), num_envs, num_threads, terminate_on_approach=terminate_on_approach
        )
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        self.single_action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
        self.single_observation_space = observation_space(self.simulation)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._rngs: list[np.random.Generator | None] = [None] * num_envs
        self._is_over = np.zeros(num_envs, dtype=np.bool_)
        self._observation = np.empty((num_envs, 0), dtype=np.float32)

    @property
    def scenario(self) -> Scenario:
        """Of all episodes."""
        return self.simulation.scenario

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode in every row, or in those of `options["reset_mask"]`; other options are as of `PatrolEnv`.

        Args:
            seed: Row i gets `seed + i`; or a list with one for each row. None goes on with the generators there are.
            options: `reset_mask`, truth values of shape (num_envs,), and what `PatrolEnv.reset` takes.
        """
        fixed = dict(options or {})
        mask = np.asarray(fixed.pop("reset_mask", np.ones(self.num_envs)), dtype=np.bool_)
        if mask.shape != (self.num_envs,) or not mask.any():
            raise ValueError(f"`options`: reset_mask must be {self.num_envs} truth values with one true, got {mask}")
        seeds = self._seeds(seed)
        rows = np.flatnonzero(mask)
        for row in rows.tolist():
            if seeds[row] is not None or self._rngs[row] is None:
                self._rngs[row], _ = seeding.np_random(seeds[row])
        outcome = self._start(rows, fixed)
        self._observation = (
            outcome.observation if rows.size == self.num_envs else _mixed(self._observation, outcome.observation, rows)
        )
        return self.simulation.layout.parts(self._observation), self._info(outcome)

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        """A seed for each row, or None."""
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, (int, np.integer)):
            return [int(seed) + row for row in range(self.num_envs)]
        if not isinstance(seed, (list, tuple, np.ndarray)) or len(seed) != self.num_envs:
            raise ValueError(f"`seed`: got {seed!r}; allowed is a whole number, or {self.num_envs} of them")
        return [None if each is None else operator.index(each) for each in seed]

    def _start(self, rows: Rows, options: dict[str, Any], commands: FloatArray | None = None) -> Outcome:
        """New episodes in some rows; the others take a step, if there are commands, or wait."""
        self.simulation.reset(rows, [rng for row in rows.tolist() if (rng := self._rngs[row]) is not None], options)
        self._is_over[rows] = False
        return self.simulation.step(commands, started=rows)

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[Observation, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Drive all robots for 0.1 s, then listen; see the class for what comes back."""
        wanted = self.simulation.robot.command_from_action(actions)
        if wanted.shape != (self.num_envs, 2):
            raise ValueError(
                f"`actions` must have shape ({self.num_envs}, 2), a row for each robot, got {wanted.shape}"
            )
        if not np.isfinite(wanted).all():
            broken = np.flatnonzero(~np.isfinite(wanted).all(axis=-1)).tolist()
            raise ValueError(
                f"`actions` must be finite, got {np.asarray(actions)[broken[0]].tolist()} in row {broken[0]}"
            )
        over = np.flatnonzero(self._is_over)
        if over.size and self.autoreset_mode is AutoresetMode.NEXT_STEP:
            outcome = self._start(over, {}, wanted)
        elif over.size:
            raise ValueError(f"rows {over.tolist()} are over; reset them with options={{'reset_mask': mask}} first")
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
        begun = self._start(rows, {})
        over = np.zeros(self.num_envs, dtype=np.bool_)
        over[rows] = True
        return _mixed(ended.observation, begun.observation, rows), {
            **self._info(begun),
            "final_obs": final,
            "_final_obs": over,
            "final_info": copy.deepcopy(info),
            "_final_info": over.copy(),
        }

    def _info(self, outcome: Outcome) -> dict[str, Any]:
        simulation, motion = self.simulation, self.simulation.motion
        return {
            "time_s": motion.time_s.copy(),
            "pose": motion.pose.copy(),
            "odometry": motion.odometry.copy(),
            "battery": motion.battery.copy(),
            "reward": dict(zip(REWARD_TERMS, outcome.reward, strict=True)),
            "touched": simulation.robots.is_touching.copy(),
            "fell_over": outcome.fell_over,
            "true_pose": simulation.true_pose,
            "pulses": {"robot": outcome.robot, **outcome.pulses._asdict()},
        }

    def close_extras(self, **kwargs: Any) -> None:  # noqa: ANN401 - as Gymnasium declares it
        """Nothing is open."""


def _mixed(observation: NDArray[np.float32], begun: NDArray[np.float32], rows: Rows) -> NDArray[np.float32]:
    """The rows of one observation, but for some that are of another."""
    mixed = observation.copy()
    mixed[rows] = begun[rows]
    return mixed
