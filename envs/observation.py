"""The observation: its entries and bounds, and a kernel that computes it for all robots."""

from __future__ import annotations

from typing import Any, NamedTuple, Self

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from dirmusic.bearing.spectrum import pulse_spectrum
from dirmusic.compiled import compiled
from pdpatrol.envs.motion import MotionState
from pdpatrol.envs.progress import MAX_BEARING_AGE_S, TaskProgress
from pdpatrol.robot_models.readings import LIDAR, VELOCITY
from pdpatrol.robot_models.sensors import LIDAR_BEAMS, LIDAR_RANGE_M

Observation = dict[str, NDArray[np.float32]]
Float32Array = NDArray[np.float32]
FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

SPECTRUM_AZIMUTHS_RAD = np.radians(np.arange(0.0, 360.0, 5.0))
"""Array-frame azimuths of the observed pseudo-spectrum."""

MAX_LEVEL_DECADES = 5.0
"""Highest observed level over the noise of one sample."""

POSE_MARGIN_M = 5.0
"""Margin around the yard within which a believed pose may lie."""


def observation_space(
    yard_m: tuple[float, float], limits: tuple[float, float], n_elements: int, time_limit_s: float
) -> spaces.Dict:
    """Make the space of the observations of one robot.

    Args:
        yard_m: Size of the yard.
        limits: Greatest commanded speed, m/s, and yaw rate, rad/s.
        n_elements: Number of array elements.
        time_limit_s: Time limit of the scenario.
    """
    size, limit = np.asarray(yard_m), np.asarray(limits)

    def box(low: ArrayLike, high: ArrayLike, n: int) -> spaces.Box:
        low, high = (np.array(np.broadcast_to(end, n), dtype=np.float32) for end in (low, high))
        return spaces.Box(low, high, (n,), np.float32)

    return spaces.Dict(
        {
            "pose": box([-POSE_MARGIN_M, -POSE_MARGIN_M, -1, -1], [*(size + POSE_MARGIN_M), 1, 1], 4),
            "lidar": box(0, LIDAR_RANGE_M, LIDAR_BEAMS),
            "velocity": box(-2.0 * limit, 2.0 * limit, 2),
            "detected": box(0, 1, 1),
            "strengths": box(0, 1, n_elements),
            "level": box(0, MAX_LEVEL_DECADES, 1),
            "spectrum": box(0, 1, SPECTRUM_AZIMUTHS_RAD.size),
            "bearing": box(-1, 1, 2),
            "bearing_age": box(0, MAX_BEARING_AGE_S, 1),
            "waypoint": box(0, size, 2),
            "time": box(0, time_limit_s, 1),
        }
    )


class Offsets(NamedTuple):
    """Index of the first value of each entry in an observation laid out as one vector."""

    pose: int
    lidar: int
    velocity: int
    detected: int
    strengths: int
    level: int
    spectrum: int
    bearing: int
    bearing_age: int
    waypoint: int
    time: int


class ObservationModel(NamedTuple):
    """Layout of the observations as vectors, and parameters that all robots share.

    Attributes:
        offsets: Indices of the entries.
        low: Lowest values of all entries, shape (n_entries,).
        high: Highest values of all entries, shape (n_entries,).
        stops_m: Waypoints and dock, shape (n_stops, 2).
        lidar_std_m: Standard deviation of the lidar ranges.
        noise_v: Standard deviation of one sample of the receiver.
    """

    offsets: Offsets
    low: Float32Array
    high: Float32Array
    stops_m: FloatArray
    lidar_std_m: float
    noise_v: float

    @classmethod
    def of(cls, space: spaces.Dict, stops_m: FloatArray, lidar_std_m: float, noise_v: float) -> Self:
        """Make the model for a space of observations."""
        boxes: list[Any] = [space[key] for key in Offsets._fields]  # the space sorts its keys
        ends = np.cumsum([box.shape[0] for box in boxes]).tolist()
        low, high = (np.concatenate([getattr(box, end) for box in boxes]) for end in ("low", "high"))
        return cls(Offsets(0, *ends[:-1]), low, high, stops_m, lidar_std_m, noise_v)

    def split(self, vectors: Float32Array) -> Observation:
        """Split vectors, shape (..., n_entries), into the entries of the observation."""
        parts = zip(Offsets._fields, self.offsets, (*self.offsets[1:], len(self.low)), strict=True)
        return {name: vectors[..., start:end] for name, start, end in parts}


class RobotPulses(NamedTuple):
    """Pulses of one step of all robots.

    Attributes:
        robot: Robot of each pulse, shape (n_pulses,).
        strengths_v: Strengths, shape (n_pulses, n_elements).
        azimuth_rad: Azimuths, array frame, shape (n_pulses,).
    """

    robot: NDArray[np.intp]
    strengths_v: FloatArray
    azimuth_rad: FloatArray


class StrongestPulses(NamedTuple):
    """Pulse of each robot with most energy in its usable channels; zeros for robots without a pulse.

    Attributes:
        level_v: Root of the energy, shape (n_robots,).
        strengths: Strengths of unit norm, 0 in channels that are not usable, shape (n_robots, n_elements).
        azimuth_rad: Azimuth, array frame, shape (n_robots,).
    """

    level_v: FloatArray
    strengths: FloatArray
    azimuth_rad: FloatArray


@compiled
def strongest_pulses(pulses: RobotPulses, is_usable: BoolArray) -> StrongestPulses:
    """Find the strongest pulse of each robot; the usable channels have shape (n_robots, n_elements)."""
    n_robots, n_elements = is_usable.shape
    robot, strengths_v, azimuth_rad = pulses
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
    return StrongestPulses(level_v, strengths, azimuth)


@compiled
def observe(
    model: ObservationModel,
    progress: TaskProgress,
    motion: MotionState,
    readings: FloatArray,
    lidar_normal: FloatArray,
    is_usable: BoolArray,
    spectrum_gain: FloatArray,
    pulses: RobotPulses,
) -> Float32Array:
    """Compute the observations of all robots, clipped to their bounds.

    Args:
        model: Layout and parameters.
        progress: Progress of the robots; the last bearings are updated from the strongest pulses.
        motion: Sensors of motion.
        readings: Values of `pdpatrol.robot_models.readings.Readings`, shape (n_robots, n_values).
        lidar_normal: Standard normal draws for the lidar, shape (n_robots, n_beams).
        is_usable: Usable channels, shape (n_robots, n_elements).
        spectrum_gain: Unit gains of the usable channels towards `SPECTRUM_AZIMUTHS_RAD`, shape (n_robots, n_elements,
            n_azimuths).
        pulses: Pulses of this step.

    Returns:
        Shape (n_entries, n_robots), so that each entry is contiguous.
    """
    level_v, strengths, azimuth = strongest_pulses(pulses, is_usable)
    pose, time_s = motion.pose, motion.time_s
    spectrum = pulse_spectrum(strengths, spectrum_gain)
    velocity, lidar_m = readings[:, VELOCITY], readings[:, LIDAR]
    n_robots, n_beams = lidar_m.shape
    observation, at = np.zeros((model.low.size, n_robots), np.float32), model.offsets
    for r in range(n_robots):
        if level_v[r] > 0.0:
            bearing_rad = azimuth[r] + pose[r, 2]
            progress.bearing[r, 0], progress.bearing[r, 1] = np.cos(bearing_rad), np.sin(bearing_rad)
            progress.bearing_age_s[r] = 0.0
            observation[at.detected, r] = 1.0
            observation[at.level, r] = np.log10(level_v[r] / model.noise_v)
        observation[at.pose, r], observation[at.pose + 1, r] = pose[r, 0], pose[r, 1]
        observation[at.pose + 2, r], observation[at.pose + 3, r] = np.cos(pose[r, 2]), np.sin(pose[r, 2])
        for beam in range(n_beams):
            range_m = lidar_m[r, beam]
            if range_m < LIDAR_RANGE_M:
                range_m += model.lidar_std_m * lidar_normal[r, beam]
            observation[at.lidar + beam, r] = range_m
        observation[at.velocity, r], observation[at.velocity + 1, r] = velocity[r, 0], velocity[r, 1]
        for e in range(strengths.shape[1]):
            observation[at.strengths + e, r] = strengths[r, e]
        highest = 1.0
        for k in range(spectrum.shape[1]):
            highest = max(highest, spectrum[r, k])
        for k in range(spectrum.shape[1]):
            observation[at.spectrum + k, r] = spectrum[r, k] / highest
        observation[at.bearing, r], observation[at.bearing + 1, r] = progress.bearing[r, 0], progress.bearing[r, 1]
        observation[at.bearing_age, r] = progress.bearing_age_s[r]
        stop = 0
        while stop < len(model.stops_m) - 1 and progress.visited[r, stop]:
            stop += 1
        observation[at.waypoint, r], observation[at.waypoint + 1, r] = model.stops_m[stop, 0], model.stops_m[stop, 1]
        observation[at.time, r] = time_s[r]
        for k in range(model.low.size):
            observation[k, r] = min(max(observation[k, r], model.low[k]), model.high[k])
    return observation
