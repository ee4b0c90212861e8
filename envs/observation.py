"""Entries and bounds of the observation, and a compiled function that computes it for all robots."""

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from dirmusic.arrays import BoolArray, FloatArray, IntArray
from dirmusic.bearing.spectrum import pulse_spectrum
from dirmusic.compiled import compiled, compiled_inner
from pdpatrol.envs.motion import MAX_BEARING_AGE_S
from pdpatrol.envs.robot_states import SPECTRUM_AZIMUTHS_RAD, HeldRobots
from pdpatrol.envs.scenario.scenario import Scenario
from pdpatrol.robot_models.readings import LIDAR, VELOCITY
from pdpatrol.robot_models.sensors import LIDAR_BEAMS, LIDAR_RANGE_M

Float32Array = NDArray[np.float32]
Observation = dict[str, Float32Array]

MAX_LEVEL_DECADES = 5.0
"""Upper bound of the observed level, log10 of strength over the noise of one sample."""

POSE_MARGIN_M = 5.0
"""Margin around the yard to which a believed position is clipped."""


class ObservationLayout:
    """Layout of the vectors that `observe_robots` computes: order and bounds of the entries of an observation.

    Args:
        scenario: Scenario whose yard, robot, array and time limit bound the observations.

    Attributes:
        space: Space of the observations of one robot.
        bounds: Lower and upper bounds of the numbers in a vector, each of shape (n_numbers,).
    """

    def __init__(self, scenario: Scenario) -> None:
        size_m, limits = np.array(scenario.yard.size_m), np.array(scenario.robot.description.limits)

        def box(low: ArrayLike, high: ArrayLike, n: int) -> spaces.Box:
            return spaces.Box(np.full(n, low, np.float32), np.full(n, high, np.float32))

        boxes: dict[str, Any] = {
            "pose": box([-POSE_MARGIN_M, -POSE_MARGIN_M, -1, -1], [*(size_m + POSE_MARGIN_M), 1, 1], 4),
            "lidar": box(0, LIDAR_RANGE_M, LIDAR_BEAMS),
            "velocity": box(-2.0 * limits, 2.0 * limits, 2),
            "detected": box(0, 1, 1),
            "level": box(0, MAX_LEVEL_DECADES, 1),
            "bearing": box(-1, 1, 2),
            "bearing_age": box(0, MAX_BEARING_AGE_S, 1),
            "waypoint": box(0, size_m, 2),
            "time": box(0, scenario.task.time_limit_s, 1),
            "state_of_charge": box(0, 1, 1),
            "strengths": box(0, 1, scenario.array.n_channels),
            "spectrum": box(0, 1, SPECTRUM_AZIMUTHS_RAD.size),
        }
        self.space = spaces.Dict(boxes)
        low, high = (np.concatenate([getattr(box, end) for box in boxes.values()]) for end in ("low", "high"))
        self.bounds = low, high
        ends = np.cumsum([box.low.size for box in boxes.values()]).tolist()
        self._parts = {key: slice(start, end) for key, start, end in zip(boxes, [0, *ends], ends, strict=False)}

    def split(self, vectors: Float32Array) -> Observation:
        """Split vectors, shape (..., n_numbers), into the entries of the observation."""
        return {key: vectors[..., part] for key, part in self._parts.items()}


@compiled_inner
def strongest_pulses(
    is_usable: BoolArray, robot: IntArray, strengths_v: FloatArray, azimuth_rad: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Find, for each robot, the pulse with the most energy in its usable channels.

    Arguments are as in `observe_robots`.

    Returns:
        Square root of the energy, V, shape (n_robots,); strengths scaled to unit norm, 0 in channels that are not
        usable, shape (n_robots, n_elements); and azimuth, shape (n_robots,). All are 0 for robots without a pulse.
    """
    n_robots, n_elements = is_usable.shape
    level_v, strengths, azimuth = np.zeros(n_robots), np.zeros((n_robots, n_elements)), np.zeros(n_robots)
    for k in range(robot.size):
        r, energy = robot[k], 0.0
        for e in range(n_elements):
            energy += is_usable[r, e] * strengths_v[k, e] * strengths_v[k, e]
        root_v = np.sqrt(energy)
        if root_v > level_v[r]:
            level_v[r], azimuth[r] = root_v, azimuth_rad[k]
            for e in range(n_elements):
                strengths[r, e] = is_usable[r, e] * strengths_v[k, e] / root_v
    return level_v, strengths, azimuth


@compiled
def observe_robots(
    held: HeldRobots,
    readings: FloatArray,
    robot: IntArray,
    strengths_v: FloatArray,
    azimuth_rad: FloatArray,
) -> Float32Array:
    """Compute the observations of all robots, clipped to their bounds and in the order of `ObservationLayout`.

    Args:
        held: States, parameters and bounds; `bearing` and `bearing_age_s` are updated from the strongest pulses.
        readings: Sensor readings as in `pdpatrol.robot_models.readings.Readings`, shape (n_robots, n_values).
        robot: Index of the robot that detected each pulse of this step, shape (n_pulses,).
        strengths_v: Strengths of the pulses, shape (n_pulses, n_elements).
        azimuth_rad: Azimuths of the pulses, array frame, shape (n_pulses,).

    Returns:
        Observation vectors as columns, shape (n_numbers, n_robots), so that each entry is contiguous.
    """
    state, parameters, (low, high) = held.value
    level_v, strengths, azimuth = strongest_pulses(state.is_usable, robot, strengths_v, azimuth_rad)
    spectrum = pulse_spectrum(strengths, state.spectrum_gain)
    velocity, lidar_m = readings[:, VELOCITY], readings[:, LIDAR]
    n_robots, n_beams = lidar_m.shape
    numbers, observation = np.empty(low.size), np.empty((low.size, n_robots), np.float32)
    for r in range(n_robots):
        pose, bearing, detected, level_decades = state.believed_pose[r], state.bearing[r], 0.0, 0.0
        if level_v[r] > 0.0:
            detected = 1.0
            bearing_rad = azimuth[r] + pose[2]
            bearing[0], bearing[1], state.bearing_age_s[r] = np.cos(bearing_rad), np.sin(bearing_rad), 0.0
            level_decades = np.log10(level_v[r] / parameters.noise_v)
        numbers[0], numbers[1], numbers[2], numbers[3] = pose[0], pose[1], np.cos(pose[2]), np.sin(pose[2])
        for beam in range(n_beams):
            range_m = lidar_m[r, beam]
            if range_m < LIDAR_RANGE_M:
                range_m += parameters.lidar_std_m * state.lidar_normal[r, beam]
            numbers[4 + beam] = range_m
        stop = 0
        while stop < state.waypoints_visited.shape[1] and state.waypoints_visited[r, stop]:
            stop += 1
        k, stop_m = 4 + n_beams, parameters.stops_m[stop]
        for number in (
            velocity[r, 0], velocity[r, 1], detected, level_decades, bearing[0], bearing[1],
            state.bearing_age_s[r], stop_m[0], stop_m[1], state.time_s[r], state.battery[r],
        ):  # fmt: skip
            numbers[k] = number
            k += 1
        for strength in strengths[r]:
            numbers[k] = strength
            k += 1
        highest = max(1.0, spectrum[r].max())
        for value in spectrum[r]:
            numbers[k] = value / highest
            k += 1
        for k in range(low.size):
            observation[k, r] = min(max(np.float32(numbers[k]), low[k]), high[k])
    return observation
