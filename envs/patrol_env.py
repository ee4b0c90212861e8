"""PatrolEnv: one robot in one yard as a Gymnasium environment."""

import inspect
import operator
import pkgutil
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from enum import Enum
from pathlib import Path
from typing import Any, cast

import gymnasium
import numpy as np
from gymnasium import error, spaces
from gymnasium.envs.registration import EnvSpec
from numpy.typing import NDArray

from dirmusic.arrays import FloatArray
from pdpatrol.envs.episode import ResetOptions
from pdpatrol.envs.observation import Observation
from pdpatrol.envs.scenario import Scenario, ScenarioError, load_scenario, restore_scenario
from pdpatrol.envs.scenario.base import STEP_S
from pdpatrol.envs.simulation import Simulation
from pdpatrol.robot_models.rendering import Camera

ScenarioFunction = Callable[[np.random.Generator], Scenario]
ScenarioSource = str | Path | Scenario | Mapping[str, Any] | ScenarioFunction

ROW = np.zeros(1, dtype=np.intp)
"""Index of the only robot, as the array of rows that `Simulation` expects."""


class SimulatedEnv:
    """Properties that the single and the vectorised environment share.

    Attributes:
        simulation: Simulation of all robots.
        closed: Whether the environment has been closed.
    """

    simulation: Simulation
    closed: bool = False
    _spec: EnvSpec | None = None

    @property
    def scenario(self) -> Scenario:
        """Scenario of the current episode."""
        return self.simulation.scenario

    @property
    def spec(self) -> EnvSpec | None:
        """Spec from which Gymnasium made the environment; `max_episode_steps` is that of the scenario."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = spec and replace(
            spec,
            kwargs={key: _plain(value) for key, value in spec.kwargs.items()},
            max_episode_steps=self.simulation.max_episode_steps,
        )

    def _check_call(self, call: str) -> None:
        """Raise Gymnasium's error for a call after `close` or before `reset`."""
        if self.closed:
            raise error.ClosedEnvironmentError(f"Cannot call env.{call}() after calling env.close()")
        if call != "reset" and not self.simulation.has_begun:
            raise error.ResetNeeded(f"Cannot call env.{call}() before calling env.reset()")

    def _commands(self, actions: Any, shape: tuple[int, ...]) -> FloatArray:  # noqa: ANN401 - users may pass anything
        """Convert actions to commands. They are not clipped here: the robot clips its commands to its limits.

        Raises:
            ValueError: If the actions have the wrong shape or are not finite real numbers.
        """
        given = np.asarray(actions)
        if given.shape != shape or given.dtype.kind not in "iuf" or not np.isfinite(given).all():
            raise ValueError(f"the action must be finite real numbers of shape {shape}, got {actions!r:.80}")
        return self.simulation.robot.command_from_action(given)


def _plain(value: Any) -> Any:  # noqa: ANN401 - arguments are of many types
    """Convert an argument to data that JSON can represent, if possible."""
    if isinstance(value, Scenario):
        return value.model_dump(mode="json")
    if inspect.isfunction(value) and "<" not in value.__qualname__:
        return f"{value.__module__}:{value.__qualname__}"
    if isinstance(value, Path):
        return str(value)
    return value.value if isinstance(value, Enum) else value


class PatrolEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    SimulatedEnv, gymnasium.Env[Observation, NDArray[np.float32]]
):
    """An inspection robot in a substation yard that detects partial discharges with six directional antennas.

    ## Action
    `Box(-1, 1, (2,), float32)`: forward speed and yaw rate (counter-clockwise) as fractions of the robot's limits. The
    limits of the inspector, the default robot, are:

    | index | action | limit | unit |
    |---|---|---|---|
    | 0 | forward speed | 0.8 | m/s |
    | 1 | yaw rate | 1.5 | rad/s |

    Actions outside [-1, 1] are clipped. NaN, infinity and wrong shapes raise ValueError.

    ## Observation
    A flat `Dict` of float32 boxes. World frame: x east, y north, origin at the south-west corner of the yard. Array
    frame: x forward, y left. In a step without a pulse, `detected`, `strengths`, `level` and `spectrum` are 0. No entry
    is ever NaN.

    | key | shape | range | unit | meaning |
    |---|---|---|---|---|
    | pose | 4 | yard plus 5 m on each side, [-1, 1] | m, m, 1, 1 | believed x, y, cos yaw, sin yaw |
    | lidar | 36 | [0, 12] | m | ranges every 10 degrees counter-clockwise, starting ahead; 12 if nothing is in range |
    | velocity | 2 | [-1.6, 1.6], [-3, 3] | m/s, rad/s | speed and yaw rate; bounds are twice the limits |
    | detected | 1 | [0, 1] | 1 | 1 if a pulse was detected in this step |
    | strengths | 6 | [0, 1] | 1 | strengths of the strongest pulse of this step, one per element, unit norm |
    | level | 1 | [0, 5] | decades | log10 of that pulse's strength over the noise of one sample, clipped |
    | spectrum | 72 | [0, 1] | 1 | that pulse's pseudo-spectrum every 5 degrees of array azimuth, maximum 1 |
    | bearing | 2 | [-1, 1] | 1 | cos and sin of the last bearing, world frame; zeros before the first |
    | bearing_age | 1 | [0, 60] | s | time since the last bearing, clipped; 60 before the first |
    | waypoint | 2 | yard | m | first waypoint not yet visited, world frame; the dock after the last |
    | time | 1 | [0, time limit] | s | time since the start of the episode |
    | state_of_charge | 1 | [0, 1] | 1 | charge of the battery; rises while the robot stands at the dock |

    ## Reward
    The reward is the progress in metres towards the nearest source not yet approached, minus 0.05 per second, minus 1
    for each step in contact with anything but the floor. `info` holds the three terms. Progress is computed from the
    true positions of the sources, which a policy does not know.

    ## Episode
    `reset` draws the site and amplitude of each source, the heading at the dock, and the errors of array and pose. An
    episode terminates when every source has been approached to within the stand-off distance (with
    `terminate_on_approach`), when the robot is back at the dock after the route, when its battery is empty, or when it
    has fallen over, that is, leans by more than 45 degrees. `success` in `info` is True in the first case only. An
    episode is truncated at the time limit of the scenario. `spec.max_episode_steps` of an environment gives this limit
    in steps; the registered spec has None, because the limit depends on the scenario. A lower limit from
    `gymnasium.make(max_episode_steps=...)` is applied by Gymnasium's `TimeLimit` wrapper.

    ## Seeds
    `reset(seed=...)` takes non-negative Python or NumPy integers. None continues with the current generator.

    ## Options
    `reset(options=...)` sets values that are otherwise drawn: `start_pose` (x m, y m, yaw rad), and `sources`, a dict
    that maps the name of a source to a site (`equipment/site`) or a position (x, y, z), metres.

    ## Info
    `reset` and `step` return the same entries, Python numbers and NumPy arrays of fixed shapes:

    | key | shape | unit | meaning |
    |---|---|---|---|
    | time_s | () | s | time since the start |
    | believed_pose | (3,) | m, m, rad | x, y, yaw as observed, but float64 |
    | odometry | (3,) | m, m, rad | pose from wheels and gyro alone, starting at the believed pose |
    | battery | () | 1 | state of charge |
    | reward_progress | () | 1 | reward term for progress |
    | reward_time | () | 1 | reward term for time |
    | reward_contact | () | 1 | reward term for contacts |
    | touched | () | bool | whether the robot touched anything but the floor in this step |
    | fell_over | () | bool | whether the robot leans by more than 45 degrees |
    | success | () | bool | whether every source has been approached; False without sources |
    | is_success | () | bool | the same as `success`, under the name that Stable-Baselines3 logs |
    | approached | (n_sources,) | bool | approached sources, in the order of the scenario |
    | waypoints_visited | (n_waypoints,) | bool | visited waypoints |
    | true_pose | (3,) | m, m, rad | x, y, yaw, for logs and scores; only the policy `oracle` may use it |

    With `full_info`, `info` also has entries without a fixed shape, which learning libraries cannot stack: `pulses` (a
    `dirmusic.PulseBatch` of this step), `touched_names`, `suspects` (channels newly found faulty), and after `reset`
    `truth` (everything that was drawn, for logs and scores).

    ## Order of calls
    `step` and `render` before `reset` raise `gymnasium.error.ResetNeeded`. After `close`, all calls but `close` raise
    `gymnasium.error.ClosedEnvironmentError`. An episode that is over can still be stepped; it continues.

    ## Rendering
    `rgb_array` is (480, 640, 3) uint8 and `depth_array` is (480, 640) float32, metres; both are seen by a camera that
    follows the robot. `human` opens a window and updates it at each step.

    ## Pickling
    An environment can be copied and pickled in the middle of an episode; the copy continues exactly as the original
    would.

    Args:
        scenario: Name of a shipped scenario, path of a TOML file, a `Scenario`, its plain data, or a function that
            draws a scenario from a random generator for each episode. All scenarios that a function draws must have the
            same yard size, robot limits, number of array elements and time limit. The function can also be named as
            `package.module:function`. The spec of the environment can be saved as JSON unless the function is a lambda,
            a closure or otherwise cannot be imported by name.
        terminate_on_approach: Whether an episode ends once all sources are approached. Missions switch this off: the
            robot still has to locate the sources and return to the dock.
        full_info: Whether `info` also holds entries without a fixed shape.
        render_mode: `human`, `rgb_array`, `depth_array`, or None.

    Raises:
        ScenarioError: If the scenario has errors; all of them are listed.
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
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(
                f"`render_mode` must be None or one of {', '.join(self.metadata['render_modes'])}, got {render_mode!r}"
            )
        self.render_mode = render_mode
        self._camera: Camera | None = None
        self._terminate_on_approach, self._full_info = terminate_on_approach, full_info
        resolved = resolve_scenario(scenario)
        self._draw_scenario = resolved if callable(resolved) else None
        self._enter(resolved(np.random.default_rng(0)) if callable(resolved) else resolved)
        self.action_space = spaces.Box(-1.0, 1.0, (2,))
        self.observation_space = self.simulation.layout.space  # pyright: ignore[reportAttributeAccessIssue]

    def _enter(self, scenario: Scenario) -> None:
        self.simulation = Simulation(scenario, terminate_on_approach=self._terminate_on_approach)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode at the dock.

        Args:
            seed: Seed of all random draws; None to continue with the current generator.
            options: Values to set instead of drawing them; see the class.
        """
        self._check_call("reset")
        super().reset(seed=None if seed is None else operator.index(seed))
        if self._draw_scenario is not None:
            self._close_camera()
            self._enter(self._draw_scenario(self.np_random))
            if self.simulation.layout.space != self.observation_space:
                raise ValueError(
                    "`scenario`: the function must draw scenarios with one size of yard, limits of the robot, number "
                    f"of elements and time limit, as the first one with {self.observation_space}"
                )
        self.simulation.start(ROW, [self.np_random], ResetOptions.parse(options, self.scenario))
        if self.render_mode == "human":
            self.render()
        info = self._info()
        if self._full_info:
            info["truth"] = self.simulation.truths[0]
        return self._observation(), info

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Drive for 0.1 s and record the pulses that are detected."""
        self._check_call("step")
        simulation, states = self.simulation, self.simulation.states
        simulation.step(self._commands(action, (2,))[np.newaxis])
        if self.render_mode == "human":
            self.render()
        observation, reward = self._observation(), states.reward.item(0)
        return observation, reward, states.terminated.item(0), states.truncated.item(0), self._info()

    def _observation(self) -> Observation:
        return self.simulation.layout.split(self.simulation.observe()[0])

    def _info(self) -> dict[str, Any]:
        simulation = self.simulation
        info = {key: rows.item(0) if rows.ndim == 1 else rows[0].copy() for key, rows in simulation.info.items()}
        if self._full_info:
            info["pulses"], info["suspects"] = simulation.pulses, simulation.suspects[0]
            info["touched_names"] = simulation.robots.touched[0]
        return info

    def render(self) -> NDArray[Any] | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return the image of a camera behind the robot, or show it in a window and return None."""
        if self.render_mode is None:
            gymnasium.logger.warn(
                "render() was called without a render mode: give one to make(), for example "
                'gymnasium.make("pdpatrol:PDPatrol-v0", render_mode="rgb_array").'
            )
            return None
        self._check_call("render")
        if self._camera is None:
            self._camera = Camera(self.simulation.robots.model, self.render_mode)
        return self._camera.take(self.simulation.robots.data())

    def close(self) -> None:
        """Close the environment, its window and its renderer; further calls have no effect."""
        self.closed = True
        self._close_camera()

    def _close_camera(self) -> None:
        if self._camera is not None:
            self._camera.close()
            self._camera = None

    def __getstate__(self) -> dict[str, Any]:
        """Return the state without the camera, which is reopened when it is needed."""
        return {**self.__dict__, "_camera": None}


def resolve_scenario(scenario: Any) -> Scenario | ScenarioFunction:  # noqa: ANN401 - users may pass anything
    """Resolve the `scenario` argument of an environment to a scenario, or to the function that draws one.

    Raises:
        ScenarioError: If the scenario does not exist or has errors.
        ValueError: If the argument is not a scenario.
    """
    if isinstance(scenario, str) and re.fullmatch(r"[A-Za-z_][\w.]*:[A-Za-z_][\w.]*", scenario):
        try:
            scenario = pkgutil.resolve_name(scenario)
        except (ImportError, AttributeError) as failure:
            raise ScenarioError([f"`scenario`: {scenario}: {failure}"]) from None
    if callable(scenario):
        return cast("ScenarioFunction", scenario)
    if isinstance(scenario, Mapping):
        return restore_scenario(cast("Mapping[str, Any]", scenario))
    if not isinstance(scenario, (str, Path, Scenario)):
        raise ValueError(f"`scenario` must be a name, path, Scenario, its plain data or a function, got {scenario!r}")
    return load_scenario(scenario)
