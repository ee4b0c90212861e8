"""PatrolEnv: one robot, one yard, one array, as a Gymnasium environment."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium import error, spaces
from gymnasium.envs.registration import EnvSpec
from numpy.typing import NDArray

from pdpatrol.envs.core.arguments import NOTHING_FIXED, Fixed, checked_actions, checked_seed, given_scenario, told_spec
from pdpatrol.envs.core.info import fixed_info
from pdpatrol.envs.core.simulation import STEP_S, Outcome, Simulation
from pdpatrol.envs.scenario import Scenario
from pdpatrol.robot_models.rendering import Camera

FloatArray = NDArray[np.float64]
Observation = dict[str, NDArray[np.float32]]
ScenarioSource = str | Path | Scenario | Mapping[str, Any] | Callable[[np.random.Generator], Scenario]
"""A scenario, its plain data, or a function that draws one for each episode."""

FIRST = np.zeros(1, dtype=np.intp)


class PatrolEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """An inspection robot in a substation yard hears partial discharges through six directional antennas.

    ## Action
    `Box(-1, 1, (2,), float32)`: forward speed and yaw rate (counter-clockwise), as a share of the robot's limits. Those
    of the inspector, the robot of a scenario that names no other:

    | index | action | limit | unit |
    |---|---|---|---|
    | 0 | forward speed | 0.8 | m/s |
    | 1 | yaw rate | 1.5 | rad/s |

    Actions beyond [-1, 1] are clipped; others than two finite real numbers are refused.

    ## Observation
    A flat `Dict` of float32 boxes. World frame: x east, y north, origin at the yard's south-west corner. Array frame:
    x forward, y left. Where nothing was heard, `heard` is 0 and what belongs to it is zero; nothing is ever NaN.

    | key | shape | range | unit | meaning |
    |---|---|---|---|---|
    | pose | 4 | yard and 5 m around, [-1, 1] | m, m, 1, 1 | believed x, y, cos yaw, sin yaw |
    | lidar | 36 | [0, 12] | m | range of beams every 10 degrees, from ahead counter-clockwise; 12 where nothing is |
    | velocity | 2 | [-1.6, 1.6], [-3, 3] | m/s, rad/s | speed, yaw rate; bounds: twice the limits |
    | heard | 1 | [0, 1] | 1 | 1 if a pulse came in this step |
    | strengths | 6 | [0, 1] | 1 | of the strongest pulse of this step, unit norm; 4 with an array of 4 |
    | level | 1 | [0, 5] | decades | log10 of its strength over the noise of one sample, clipped |
    | spectrum | 72 | [0, 1] | 1 | its pseudo-spectrum every 5 degrees of array azimuth, maximum 1 |
    | bearing | 2 | [-1, 1] | 1 | cos and sin of the last bearing, world frame; zeros before the first |
    | bearing_age | 1 | [0, 60] | s | time since that bearing, clipped; 60 before the first |
    | waypoint | 2 | yard | m | first waypoint not yet visited, world frame; the dock after the last |
    | time | 1 | [0, time limit] | s | time since the start of the episode, clipped |

    ## Reward
    Metres of progress towards the nearest source not yet approached, minus 0.05 a second, minus 1 for each step in
    contact with anything but the floor. `info["reward"]` has the terms. Progress uses the truth: it is for training.

    ## Episode
    `reset` draws each source's site and amplitude, the heading at the dock, and the errors of array and pose.
    Terminated when every source has been approached to the stand-off distance (if there are sources and
    `terminate_on_approach`), when the robot is back at the dock after the route, or when it has fallen over: its base
    leans by more than 45 degrees. Truncated at the time limit. `success` in `info` tells the first from the others.

    ## Seeds
    `reset(seed=...)` takes whole numbers from 0 on, of Python or NumPy, and None, which goes on with the generator
    there is; anything else is refused.

    ## Options
    `reset(options=...)` fixes what is drawn otherwise: `start_pose` (x m, y m, yaw rad), and `sources`, a dict from a
    source's name to a site (`equipment/site`) or a position (x, y, z).

    ## Info
    The same entries after `reset` and `step`, Python numbers and NumPy arrays of fixed shapes:

    | key | shape | unit | meaning |
    |---|---|---|---|
    | time_s | () | s | since the start |
    | believed_pose | (3,) | m, m, rad | x, y, yaw as observed, but float64 |
    | odometry | (3,) | m, m, rad | by wheels and gyro alone, from the believed pose at the start on |
    | battery | () | 1 | share that is left |
    | reward_progress | () | 1 | term of the reward |
    | reward_time | () | 1 | term of the reward |
    | reward_contact | () | 1 | term of the reward |
    | touched | () | bool | whether the robot touched anything but the floor in this step |
    | fell_over | () | bool | whether it leans by more than 45 degrees |
    | success | () | bool | whether every source has been approached; never where there is none |
    | is_success | () | bool | the same as `success`, under the name that Stable-Baselines3 logs |
    | approached | (n_sources,) | bool | which sources have been, in the scenario's order |
    | waypoints_visited | (n_waypoints,) | bool | which waypoints have been |
    | true_pose | (3,) | m, m, rad | for logs and scores: no policy but `oracle` may see it |

    With `full_info` also what has no fixed shape, and what learning libraries cannot stack: `pulses` (a
    `dirmusic.PulseBatch` of this step), `touched_names`, `suspects` (channels newly found at fault), and after `reset`
    `truth`: all that was drawn, for logs and scores.

    ## Order of calls
    `step` and `render` before `reset` raise `gymnasium.error.ResetNeeded`; after `close` everything but `close` raises
    `gymnasium.error.ClosedEnvironmentError`. An episode that is over goes on when it is stepped: nothing resets itself.

    ## Rendering
    `rgb_array` (480, 640, 3) uint8 and `depth_array` (480, 640) float32, metres, from a camera that follows the robot;
    `human` opens a window and keeps it up to date.

    ## Pickling
    An environment in the middle of an episode can be copied and pickled, and goes on as the original would.

    Args:
        scenario: Name of a shipped scenario, path of a TOML file, a `Scenario`, or a function that draws one from a
            generator for each episode (all of one size of yard, limits of the robot, number of elements and time
            limit), such a function by name as `package.module:function`, or the plain data of a `Scenario`. The spec of
            an environment goes through JSON unless the function is a lambda, a closure or another object without a
            name to import it by.
        terminate_on_approach: Whether an episode ends once all sources are approached. Missions say no: they go on to
            fix the source and come home.
        full_info: Whether `info` also holds what has no fixed shape, pulses among it.
        render_mode: `human`, `rgb_array`, `depth_array`, or None.

    Raises:
        ScenarioError: If the scenario has faults; all are listed.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - the base class declares it so
        "render_modes": ["human", "rgb_array", "depth_array"],
        "render_fps": round(1 / STEP_S),
    }

    def __init__(
        self,
        scenario: ScenarioSource = "one_source",
        *,
        terminate_on_approach: bool = True,
        full_info: bool = False,
        render_mode: str | None = None,
    ) -> None:
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ValueError(
                f"`render_mode`: got {render_mode!r}; allowed are {', '.join(self.metadata['render_modes'])}, or None"
            )
        self.render_mode = render_mode
        self._camera: Camera | None = None
        resolved = given_scenario(scenario)
        self._draw_scenario = resolved if callable(resolved) else None
        self._terminate_on_approach, self._full_info = terminate_on_approach, full_info
        self._spec: EnvSpec | None = None
        self._is_closed = False
        self._enter(resolved(np.random.default_rng(0)) if callable(resolved) else resolved)
        self.action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
        self.observation_space = observation_space(self.simulation)  # pyright: ignore[reportAttributeAccessIssue]

    def _enter(self, scenario: Scenario) -> None:
        self.simulation = Simulation(scenario, terminate_on_approach=self._terminate_on_approach)

    @property
    def scenario(self) -> Scenario:
        """Of this episode."""
        return self.simulation.scenario

    @property
    def spec(self) -> EnvSpec | None:
        """How Gymnasium made it, with the length of an episode in steps; it goes through JSON, but for functions."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:  # pyright: ignore[reportIncompatibleVariableOverride]
        self._spec = told_spec(spec, self.simulation.max_episode_steps)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode at the dock; `seed` fixes all that is drawn, `options` what is not to be drawn."""
        self._check_open("reset")
        whole, fixed = checked_seed(seed), NOTHING_FIXED
        if self._draw_scenario is None:
            fixed = Fixed.checked(options, self.scenario)
        super().reset(seed=whole)
        if self._draw_scenario is not None:
            self._close_camera()
            self._enter(self._draw_scenario(self.np_random))
            drawn = observation_space(self.simulation)
            if drawn != self.observation_space:
                raise ValueError(
                    "`scenario`: the function drew one with another observation space; allowed are scenarios of one "
                    "size of yard, limits of the robot, number of elements and time limit, as of the first: "
                    f"{self.observation_space}"
                )
            fixed = Fixed.checked(options, self.scenario)
        self.simulation.reset(FIRST, [self.np_random], fixed)
        outcome = self.simulation.step(None, started=FIRST)
        if self.render_mode == "human":
            self.render()
        info = self._info(outcome)
        if self._full_info:
            info["truth"] = copy.deepcopy(self.simulation.episode(0).truth)
        return self.simulation.layout.parts(outcome.observation[0]), info

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Drive for 0.1 s, then listen; see the class for what comes back."""
        self._check_open("step")
        self._check_begun("step")
        command = self.simulation.robot.command_from_action(checked_actions(action, (2,)))
        outcome = self.simulation.step(command[np.newaxis])
        if self.render_mode == "human":
            self.render()
        reward, observation = sum(outcome.reward[:, 0].tolist()), self.simulation.layout.parts(outcome.observation[0])
        return observation, reward, bool(outcome.terminated[0]), bool(outcome.truncated[0]), self._info(outcome)

    def _check_open(self, call: str) -> None:
        if self._is_closed:
            raise error.ClosedEnvironmentError(f"Cannot call env.{call}() after calling env.close()")

    def _check_begun(self, call: str) -> None:
        if not self.simulation.has_begun:
            raise error.ResetNeeded(f"Cannot call env.{call}() before calling env.reset()")

    def _info(self, outcome: Outcome) -> dict[str, Any]:
        info: dict[str, Any] = {
            key: rows[0].item() if rows.ndim == 1 else rows[0]
            for key, rows in fixed_info(self.simulation, outcome).items()
        }
        if self._full_info:
            info["pulses"], info["suspects"] = outcome.pulses, outcome.suspects[0]
            info["touched_names"] = self.simulation.robots.touched[0]
        return info

    def render(self) -> NDArray[Any] | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """What the camera behind the robot sees; nothing with `human`, which shows it."""
        if self.render_mode is None:
            gymnasium.logger.warn(
                "render() was called without a render mode: give one to make(), for example "
                'gymnasium.make("pdpatrol:PDPatrol-v0", render_mode="rgb_array").'
            )
            return None
        self._check_open("render")
        self._check_begun("render")
        if self._camera is None:
            self._camera = Camera(self.simulation.robots.model, self.render_mode)
        return self._camera.take(self.simulation.robots.data())

    def close(self) -> None:
        """Close window and renderer, for good; closing twice is no error."""
        self._is_closed = True
        self._close_camera()

    def _close_camera(self) -> None:
        if self._camera is not None:
            self._camera.close()
            self._camera = None

    def __getstate__(self) -> dict[str, Any]:
        """All but the camera, which opens again when it is asked for."""
        return {**self.__dict__, "_camera": None}


def observation_space(simulation: Simulation) -> spaces.Dict:
    """The space of the observations of one robot."""
    return spaces.Dict(
        {
            key: spaces.Box(low, high, low.shape, np.float32)
            for key, (low, high) in simulation.layout.bounds._asdict().items()
        }
    )
