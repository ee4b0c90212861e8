"""The observation, in a compiled loop over the robots."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.bearing.spectrum import LEAST_NULL, pulse_spectra
from dirmusic.compiled import Held, compiled
from pdpatrol.envs.core.loudest_pulse import LoudestPulse, loudest_pulse, note_bearings
from pdpatrol.envs.core.observation_layout import Entries
from pdpatrol.envs.core.progress import Progress
from pdpatrol.robot_models.readings import LIDAR, VELOCITY

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


class ObservationParameters(NamedTuple):
    """What all observations of a simulation share.

    Attributes:
        stops_m: Waypoints and dock, shape (n_stops, 2).
        low: Lowest values of all entries of one robot, shape (n_entries,).
        high: Highest values, shape (n_entries,).
        places: Where the entries lie, a plain `Entries`.
        lidar_range_m: Beyond which the lidar sees nothing.
        lidar_std_m: Standard deviation of its ranges.
        noise_v: Standard deviation of one sample of the receiver.
    """

    stops_m: FloatArray
    low: NDArray[np.float32]
    high: NDArray[np.float32]
    places: tuple[int, ...]
    lidar_range_m: float
    lidar_std_m: float
    noise_v: float


class Sensed(NamedTuple):
    """What a step's sensors gave; a row is a robot.

    Attributes:
        pose: Believed, shape (n_robots, 3).
        lidar_normal: Standard normal draws for the noise of the lidar, shape (n_robots, n_beams).
        time_s: Since the start, shape (n_robots,).
        is_usable: Channels, shape (n_robots, n_elements).
        spectrum_gain: Unit gains of the usable channels towards the observed azimuths, shape (n_robots, n_elements,
            n_azimuths).
    """

    pose: FloatArray
    lidar_normal: FloatArray
    time_s: FloatArray
    is_usable: BoolArray
    spectrum_gain: FloatArray


class Observing(NamedTuple):
    """What the observations of a simulation are made of, but for readings and pulses.

    Attributes:
        parameters: What all share.
        sensed: As of the last step.
        progress: Of the robots.
    """

    parameters: ObservationParameters
    sensed: Sensed
    progress: Progress


@compiled
def perceive(observing: Held[Observing], readings: FloatArray, pulses: tuple[Any, ...]) -> NDArray[np.float32]:
    """Note the bearings of a step's loudest pulses, then observe.

    Args:
        observing: Its `progress` is renewed: the last bearings.
        readings: Values of `pdpatrol.robot_models.readings.Readings`.
        pulses: Of `loudest_pulse`.

    Returns:
        Shape (n_entries, n_robots): a row is an entry, so that each part of the observation lies together.
    """
    parameters, sensed, progress = observing.value
    loudest = loudest_pulse(pulses, sensed.is_usable)
    note_bearings(progress, loudest, sensed.pose)
    return observe(sensed, readings, parameters, progress, loudest)


@compiled
def observe(
    sensed: Sensed,
    readings: FloatArray,
    parameters: ObservationParameters,
    progress: Progress,
    loudest: LoudestPulse,
) -> NDArray[np.float32]:
    """Observations within their bounds; arguments and result as of `perceive`, but nothing is changed."""
    velocity, lidar_m = readings[:, VELOCITY], readings[:, LIDAR]
    n_robots, n_beams = lidar_m.shape
    spectrum = pulse_spectra(loudest.strengths, sensed.spectrum_gain, LEAST_NULL)
    observation = np.zeros((parameters.low.size, n_robots), np.float32)
    at = Entries(*parameters.places)
    for r in range(n_robots):
        observation[at.pose, r], observation[at.pose + 1, r] = sensed.pose[r, 0], sensed.pose[r, 1]
        observation[at.pose + 2, r], observation[at.pose + 3, r] = np.cos(sensed.pose[r, 2]), np.sin(sensed.pose[r, 2])
        for beam in range(n_beams):
            range_m = lidar_m[r, beam]
            noisy_m = range_m + parameters.lidar_std_m * sensed.lidar_normal[r, beam]
            observation[at.lidar + beam, r] = (
                noisy_m if range_m < parameters.lidar_range_m else parameters.lidar_range_m
            )
        observation[at.velocity, r], observation[at.velocity + 1, r] = velocity[r, 0], velocity[r, 1]
        if loudest.level_v[r] > 0.0:
            observation[at.heard, r] = 1.0
            observation[at.level, r] = np.log10(loudest.level_v[r] / parameters.noise_v)
        for e in range(loudest.strengths.shape[1]):
            observation[at.strengths + e, r] = loudest.strengths[r, e]
        highest = 1.0
        for k in range(spectrum.shape[1]):
            highest = max(highest, spectrum[r, k])
        for k in range(spectrum.shape[1]):
            observation[at.spectrum + k, r] = spectrum[r, k] / highest
        observation[at.bearing, r], observation[at.bearing + 1, r] = progress.bearing[r, 0], progress.bearing[r, 1]
        observation[at.bearing_age, r] = progress.bearing_age_s[r]
        stop = 0
        while stop < len(parameters.stops_m) - 1 and progress.visited[r, stop]:
            stop += 1
        observation[at.waypoint, r], observation[at.waypoint + 1, r] = (
            parameters.stops_m[stop, 0],
            parameters.stops_m[stop, 1],
        )
        observation[at.time, r] = sensed.time_s[r]
        for k in range(parameters.low.size):
            observation[k, r] = min(max(observation[k, r], parameters.low[k]), parameters.high[k])
    return observation
