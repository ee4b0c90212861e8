"""PatrolEnv: one robot, one yard, one array, as a Gymnasium environment."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from dirmusic import pseudo_spectrum, sample_covariance
from dirmusic.angles import difference
from dirmusic.channel_health import ChannelMonitor
from envs.lidar import measured
from envs.odometry import Odometry
from envs.pose_sensor import PoseSensor
from envs.scenario import Scenario, load_scenario
from robot_models.battery import Battery
from robot_models.camera import Camera
from robot_models.inspector import (
    LIDAR_BEAMS,
    LIDAR_RANGE_M,
    MAX_SPEED_MPS,
    MAX_YAW_RATE_RADPS,
    WHEEL_RADIUS_M,
    Inspector,
)
from robot_models.world import build_model
from sensing import (
    Carrier,
    DischargeSource,
    Faces,
    Heard,
    HelicalArray,
    PulseTrain,
    Receiver,
    Scene,
    Surroundings,
)

FloatArray = NDArray[np.float64]
Observation = dict[str, NDArray[np.float32]]

STEP_S = 0.1
"""Control step: 10 Hz."""

SPECTRUM_AZIMUTHS_RAD = np.radians(np.arange(0.0, 360.0, 5.0))
"""Array-frame azimuths of the observed pseudo-spectrum."""

MAX_BEARING_AGE_S = 60.0
LEVEL_DECADES = 5.0
POSE_MARGIN_M = 5.0

REWARD_PER_METRE = 1.0
REWARD_PER_SECOND = -0.05
REWARD_PER_CONTACT_STEP = -1.0
"""Weights of the reward's terms (assumed): a second costs 5 cm of progress, touching something costs a metre."""


class Pulses(NamedTuple):
    """What the receiver and the direction finder made of one step; n_pulses rows each, by time.

    Attributes:
        time_s: Shape (n_pulses,).
        strengths_v: Shape (n_pulses, n_elements).
        variance_v2: Noise variance of the strengths, same shape.
        mains_phase_rad: Shape (n_pulses,), in [0, 2 pi).
        azimuth_rad: Direction of arrival, array frame, shape (n_pulses,).
        std_rad: Its deviation from noise alone, shape (n_pulses,); pi where there was no strength at all.
        misfit: Share of the energy that no single direction explains, shape (n_pulses,).
        is_clipped: Whether the pulse met the end of the converter's scale, shape (n_pulses,).
        is_good: Which channels the direction finder used, shape (n_elements,).
    """

    time_s: FloatArray
    strengths_v: FloatArray
    variance_v2: FloatArray
    mains_phase_rad: FloatArray
    azimuth_rad: FloatArray
    std_rad: FloatArray
    misfit: FloatArray
    is_clipped: NDArray[np.bool_]
    is_good: NDArray[np.bool_]


class PatrolEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """An inspection robot in a substation yard hears partial discharges through six directional antennas.

    ## Action
    `Box(-1, 1, (2,), float32)`: forward speed and yaw rate (counter-clockwise), as a share of the robot's limits.

    | index | action | limit | unit |
    |---|---|---|---|
    | 0 | forward speed | 0.8 | m/s |
    | 1 | yaw rate | 1.5 | rad/s |

    ## Observation
    A flat `Dict` of float32 boxes. World frame: x east, y north, origin at the yard's south-west corner. Array frame:
    x forward, y left. Where nothing was heard, `heard` is 0 and what belongs to it is zero; nothing is ever NaN.

    | key | shape | range | unit | meaning |
    |---|---|---|---|---|
    | pose | 4 | yard and 5 m around, [-1, 1] | m, m, 1, 1 | believed x, y, cos yaw, sin yaw |
    | lidar | 36 | [0, 12] | m | range of beams every 10 degrees, from ahead counter-clockwise; 12 where nothing is |
    | velocity | 2 | [-1.6, 1.6], [-3, 3] | m/s, rad/s | forward speed and yaw rate |
    | heard | 1 | [0, 1] | 1 | 1 if a pulse came in this step |
    | strengths | 6 | [0, 1] | 1 | of the strongest pulse of this step, unit norm; 4 with an array of 4 |
    | level | 1 | [0, 5] | decades | log10 of its strength over the noise of one sample, clipped |
    | spectrum | 72 | [0, 1] | 1 | its pseudo-spectrum every 5 degrees of array azimuth, maximum 1 |
    | bearing | 2 | [-1, 1] | 1 | cos and sin of the last bearing, world frame; zeros before the first |
    | bearing_age | 1 | [0, 60] | s | time since that bearing, clipped; 60 before the first |
    | waypoint | 2 | yard | m | first waypoint not yet visited, world frame; the dock after the last |
    | time_left | 1 | [0, time limit] | s | until truncation |

    ## Reward
    Metres of progress towards the nearest source not yet approached, minus 0.05 a second, minus 1 for each step in
    contact with anything but the floor. `info["reward"]` has the terms. Progress uses the truth: it is for training.

    ## Episode
    `reset` draws each source's site and amplitude, the heading at the dock, and the errors of array and pose.
    Terminated when every source has been approached to the stand-off distance (if there are sources and
    `terminate_on_approach`), or when the robot is back at the dock after the route. Truncated at the time limit.

    ## Info
    `time_s`, `pose` (believed, float64), `odometry` (x m, y m, yaw rad by wheels and gyro alone, from the believed
    pose at the start on), `battery` (share that is left), `pulses` (a `Pulses` of this step), `touched` (names),
    `waypoints_visited` (indices), `suspects` (channels newly found at fault), and `truth`, which is for logs and
    scores: no policy but `oracle` may see it.

    ## Rendering
    `rgb_array` (480, 640, 3) uint8 and `depth_array` (480, 640) float32, metres, from a camera that follows the robot;
    `human` opens a window and keeps it up to date.

    ## Pickling
    An environment in the middle of an episode can be copied and pickled, and goes on as the original would.

    Args:
        scenario: Name of a shipped scenario, path of a TOML file, or a `Scenario`.
        terminate_on_approach: Whether an episode ends once all sources are approached. Missions say no: they go on to
            fix the source and come home.
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
        scenario: str | Path | Scenario = "one_source",
        *,
        terminate_on_approach: bool = True,
        render_mode: str | None = None,
    ) -> None:
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ValueError(
                f"`render_mode`: got {render_mode!r}; allowed are {', '.join(self.metadata['render_modes'])}, or None"
            )
        self.render_mode = render_mode
        self._camera: Camera | None = None
        self.scenario = load_scenario(scenario)
        self.terminate_on_approach = terminate_on_approach
        nominal = HelicalArray.nominal(self.scenario.array)
        self.manifold = nominal.manifold()
        yard = self.scenario.yard
        self.inspector = Inspector(build_model(yard, nominal.positions_m, nominal.boresights_rad))
        self._surroundings = Surroundings.of_kinds(
            [item.kind for item in yard.equipment], Faces(*yard.faces()), self.inspector.crossed
        )
        self._spectrum_gain = self.manifold.gain(SPECTRUM_AZIMUTHS_RAD)
        self.action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
        self._boxes = self._build_boxes()
        self.observation_space = spaces.Dict({**self._boxes})  # pyright: ignore[reportAttributeAccessIssue]

    def _build_boxes(self) -> dict[str, spaces.Box]:
        size = np.asarray(self.scenario.yard.size_m)
        low, high = np.full(2, -POSE_MARGIN_M), size + POSE_MARGIN_M
        fastest = 2.0 * np.array([MAX_SPEED_MPS, MAX_YAW_RATE_RADPS])

        def box(lowest: Any, highest: Any, n: int) -> spaces.Box:  # noqa: ANN401 - scalar or array
            return spaces.Box(
                np.broadcast_to(lowest, n).astype(np.float32), np.broadcast_to(highest, n).astype(np.float32), (n,)
            )

        return {
            "pose": box(np.append(low, [-1, -1]), np.append(high, [1, 1]), 4),
            "lidar": box(0, LIDAR_RANGE_M, LIDAR_BEAMS),
            "velocity": box(-fastest, fastest, 2),
            "heard": box(0, 1, 1),
            "strengths": box(0, 1, self.manifold.n_elements),
            "level": box(0, LEVEL_DECADES, 1),
            "spectrum": box(0, 1, SPECTRUM_AZIMUTHS_RAD.size),
            "bearing": box(-1, 1, 2),
            "bearing_age": box(0, MAX_BEARING_AGE_S, 1),
            "waypoint": box(0, size, 2),
            "time_left": box(0, self.scenario.task.time_limit_s, 1),
        }

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode at the dock; `seed` fixes all that is drawn."""
        super().reset(seed=seed, options=options)
        rng, scenario = self.np_random, self.scenario
        self._sources = self._draw_sources(rng)
        self._interferers = [
            DischargeSource(
                name=item.name,
                position_m=np.array(item.position_m),
                amplitude_v=_draw_amplitude(item.amplitude_v, item.amplitude_range_db, rng),
                pulse_rate_hz=item.pulse_rate_hz,
                burst_s=item.burst_s,
            )
            for item in scenario.interferers
        ]
        carriers = [
            Carrier(
                frequency_hz=item.frequency_hz,
                amplitude_v=item.amplitude_v,
                bearing_rad=float(np.radians(item.bearing_deg)),
            )
            for item in scenario.carriers
        ]
        self._scene = Scene([*self._sources, *self._interferers], self._surroundings, carriers)
        self._array = HelicalArray.draw(scenario.array, rng)
        self._receiver = Receiver(scenario.receiver, self._array)
        yaw_rad, fixed_deg = float(rng.uniform(-np.pi, np.pi)), scenario.route.dock_yaw_deg
        self.inspector.reset(*scenario.route.dock_m, yaw_rad if fixed_deg is None else float(np.radians(fixed_deg)))
        self._pose_sensor = PoseSensor(scenario.pose_sensor, rng)
        self._approached = np.zeros(len(self._sources), dtype=np.bool_)
        self._visited = np.zeros(len(scenario.route.waypoints_m), dtype=np.bool_)
        self._monitor = ChannelMonitor(self.manifold)
        self._n_steps = 0
        self._last_bearing_rad: float | None = None
        self._bearing_age_s = MAX_BEARING_AGE_S
        self._true_pose = self.inspector.pose()
        self._pose = self._pose_sensor.read(self._true_pose, 0.0)
        self._odometry = Odometry(scenario.odometry, rng, self._pose)
        self._wheel_angles = self.inspector.wheel_angles()
        self._battery = Battery(scenario.battery)
        heard = self._receiver.listen(self.inspector.world_from_base(), self._scene, rng, start_s=0.0, duration_s=0.0)
        if self.render_mode == "human":
            self.render()
        return self._observe(heard)

    def _draw_sources(self, rng: np.random.Generator) -> list[DischargeSource]:
        sources: list[DischargeSource] = []
        taken: set[str] = set()
        for config in self.scenario.sources:
            sites = [site for site in self.scenario.candidate_sites(config) if site not in taken]
            position = np.array(config.position_m) if config.position_m is not None else None
            if position is None:
                site = sites[int(rng.integers(len(sites)))]
                taken.add(site)
                position = self.scenario.yard.site_position(site)
            amplitude_v = _draw_amplitude(config.amplitude_v, config.amplitude_range_db, rng)
            train = None
            if config.kind is not None:
                drawn = float(rng.choice((0.0, 120.0, 240.0)))
                conductor_deg = drawn if config.conductor_deg is None else config.conductor_deg
                mains_hz = self.scenario.receiver.mains_hz
                train = PulseTrain.draw(config.kind, mains_hz, float(np.radians(conductor_deg)), rng)
            sources.append(
                DischargeSource(
                    name=config.name,
                    position_m=position,
                    amplitude_v=amplitude_v,
                    pulse_rate_hz=config.pulse_rate_hz,
                    train=train,
                    active_s=config.active_s or (0.0, np.inf),
                    drift_db_per_min=config.drift_db_per_min,
                    n_shots=config.n_shots,
                    first_shot_s=config.first_shot_s,
                )
            )
        return sources

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Drive for 0.1 s, then listen; see the class for what comes back."""
        v, yaw_rate = np.clip(np.asarray(action, dtype=np.float64), -1.0, 1.0)
        before = self._distance_to_go(self._true_pose)
        start_s = self._n_steps * STEP_S
        self.inspector.drive(v * MAX_SPEED_MPS, yaw_rate * MAX_YAW_RATE_RADPS, STEP_S)
        self._n_steps += 1
        true_pose = self._sense_motion()
        heard = self._receiver.listen(
            self.inspector.world_from_base(), self._scene, self.np_random, start_s=start_s, duration_s=STEP_S
        )
        terms = {
            "progress": REWARD_PER_METRE * (before - self._distance_to_go(true_pose)),
            "time": REWARD_PER_SECOND * STEP_S,
            "contact": REWARD_PER_CONTACT_STEP if self.inspector.touched() else 0.0,
        }
        self._note_arrivals(true_pose)
        observation, info = self._observe(heard)
        info["reward"] = terms
        if self.render_mode == "human":
            self.render()
        docked = (
            self._visited.size > 0
            and bool(self._visited.all())
            and self._is_near(true_pose, self.scenario.route.dock_m)
        )
        approached = self.terminate_on_approach and self._approached.size > 0 and bool(self._approached.all())
        truncated = self._n_steps * STEP_S >= self.scenario.task.time_limit_s - 1e-9
        return observation, float(sum(terms.values())), docked or approached, truncated, info

    def render(self) -> NDArray[Any] | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """What the camera behind the robot sees; nothing with `human`, which shows it."""
        if self.render_mode is None:
            gymnasium.logger.warn(
                "render() was called without a render mode: give one to make(), for example "
                'gymnasium.make("envs:PDPatrol-v0", render_mode="rgb_array").'
            )
            return None
        if self._camera is None:
            self._camera = Camera(self.inspector.model, self.inspector.data, self.render_mode)
        return self._camera.take()

    def close(self) -> None:
        """Close window and renderer; closing twice is no error."""
        if self._camera is not None:
            self._camera.close()
            self._camera = None

    def __getstate__(self) -> dict[str, Any]:
        """All but the camera, which opens again when it is asked for."""
        return {**self.__dict__, "_camera": None}

    def _sense_motion(self) -> FloatArray:
        """Pose sensor, odometry and battery after a step; the true pose."""
        true_pose, wheel_angles = self.inspector.pose(), self.inspector.wheel_angles()
        rolled_m = WHEEL_RADIUS_M * 0.5 * float((wheel_angles - self._wheel_angles).sum())
        turned_rad = float(difference(true_pose[2], self._true_pose[2]))
        self._true_pose, self._wheel_angles = true_pose, wheel_angles
        self._pose = self._pose_sensor.read(true_pose, STEP_S)
        self._odometry.move(rolled_m, turned_rad, STEP_S)
        self._battery.drain(self.inspector.motor_power_w(), STEP_S)
        return true_pose

    def _distance_to_go(self, pose: FloatArray) -> float:
        """Horizontal distance to the nearest source not yet approached; 0 if there is none."""
        left = [s for s, done in zip(self._sources, self._approached, strict=True) if not done]
        return min((float(np.hypot(*(s.position_m[:2] - pose[:2]))) for s in left), default=0.0)

    def _is_near(self, pose: FloatArray, stop_m: tuple[float, float]) -> bool:
        return float(np.hypot(*(np.asarray(stop_m) - pose[:2]))) <= self.scenario.task.waypoint_radius_m

    def _note_arrivals(self, pose: FloatArray) -> None:
        for index, source in enumerate(self._sources):
            if np.hypot(*(source.position_m[:2] - pose[:2])) <= self.scenario.task.standoff_m:
                self._approached[index] = True
        for index, stop in enumerate(self.scenario.route.waypoints_m):
            self._visited[index] |= self._is_near(pose, stop)

    def _observe(self, heard: Heard) -> tuple[Observation, dict[str, Any]]:
        bearings, suspects = self._monitor.watch(heard.strengths_v, heard.variance_v2)
        n_elements, good = self.manifold.n_elements, self._monitor.good
        strengths, spectrum = np.zeros(n_elements), np.zeros(SPECTRUM_AZIMUTHS_RAD.size)
        norm = np.linalg.norm(heard.strengths_v, axis=-1)
        level = 0.0
        self._bearing_age_s = min(self._bearing_age_s + STEP_S, MAX_BEARING_AGE_S)
        is_heard = norm.size > 0 and bool(norm.max() > 0)
        if is_heard:
            best = int(norm.argmax())
            strengths = heard.strengths_v[best] * good
            strengths /= max(float(np.linalg.norm(strengths)), 1e-12)
            level = float(np.clip(np.log10(norm[best] / self.scenario.receiver.noise_v), 0.0, LEVEL_DECADES))
            covariance = sample_covariance(strengths[:, np.newaxis])
            gain = self._spectrum_gain * good[:, np.newaxis]
            spectrum = np.minimum(pseudo_spectrum(covariance, gain / np.linalg.norm(gain, axis=0)), 1e12)
            spectrum = spectrum / spectrum.max()
            self._last_bearing_rad = float(bearings.azimuth_rad[best] + self._pose[2])
            self._bearing_age_s = 0.0
        last = self._last_bearing_rad
        stops = (*self.scenario.route.waypoints_m, self.scenario.route.dock_m)
        values: dict[str, Any] = {
            "pose": [*self._pose[:2], np.cos(self._pose[2]), np.sin(self._pose[2])],
            "lidar": measured(self.inspector.lidar(), LIDAR_RANGE_M, self.scenario.lidar, self.np_random),
            "velocity": self.inspector.velocity(),
            "heard": [float(is_heard)],
            "strengths": strengths,
            "level": [level],
            "spectrum": spectrum,
            "bearing": [0.0, 0.0] if last is None else [np.cos(last), np.sin(last)],
            "bearing_age": [self._bearing_age_s],
            "waypoint": stops[int(np.append(self._visited, False).argmin())],
            "time_left": [max(self.scenario.task.time_limit_s - self._n_steps * STEP_S, 0.0)],
        }
        observation = {
            key: np.clip(np.asarray(values[key], dtype=np.float32), space.low, space.high)
            for key, space in self._boxes.items()
        }
        told = bearings.without_nan()
        info = {
            "time_s": self._n_steps * STEP_S,
            "pose": self._pose.copy(),
            "odometry": self._odometry.pose.copy(),
            "battery": self._battery.left,
            "pulses": Pulses(
                time_s=heard.time_s,
                strengths_v=heard.strengths_v,
                variance_v2=heard.variance_v2,
                mains_phase_rad=heard.mains_phase_rad,
                azimuth_rad=told.azimuth_rad,
                std_rad=told.std_rad,
                misfit=told.misfit,
                is_clipped=np.any(heard.is_clipped & good, axis=-1, keepdims=True)[:, 0],
                is_good=good.copy(),
            ),
            "suspects": suspects,
            "touched": self.inspector.touched(),
            "waypoints_visited": tuple(np.flatnonzero(self._visited).tolist()),
            "truth": self._truth(),
        }
        return observation, info

    def _truth(self) -> dict[str, Any]:
        """What only nature knows."""

        def describe(source: DischargeSource) -> dict[str, Any]:
            return {
                "name": source.name,
                "position_m": source.position_m.tolist(),
                "amplitude_v": source.amplitude_v,
                "pulse_rate_hz": source.pulse_rate_hz,
            }

        return {
            "pose": self.inspector.pose(),
            "sources": [
                {**describe(source), "kind": config.kind}
                for source, config in zip(self._sources, self.scenario.sources, strict=True)
            ],
            "interferers": [describe(source) for source in self._interferers],
            "array": {
                "boresights_rad": self._array.boresights_rad.tolist(),
                "gain_factors": self._array.gain_factors.tolist(),
                "gain_offsets": self._array.gain_offsets.tolist(),
                "positions_m": self._array.positions_m.tolist(),
            },
        }


def _draw_amplitude(amplitude_v: float, range_db: float, rng: np.random.Generator) -> float:
    """Uniform in decibels over a range centred on `amplitude_v`."""
    return amplitude_v * 10 ** (float(rng.uniform(-0.5, 0.5)) * range_db / 20)
