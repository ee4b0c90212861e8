"""The observation, in a compiled loop over the robots."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.bearing.likelihood_kernels import pulse_spectra
from dirmusic.bearing.spectrum import LEAST_NULL
from dirmusic.compiled import compiled
from envs.core.motion import N_DRAWS
from robot_models.readings import LIDAR, VELOCITY

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]


class ObservationParameters(NamedTuple):
    """What stays as it is.

    Attributes:
        stops_m: Waypoints and dock, shape (n_stops, 2).
        low: Of all entries of the observation of one robot.
        high: Likewise.
        lidar_reach_m: Beyond which the lidar sees nothing.
        lidar_std_m: Standard deviation of its ranges.
        noise_v: Standard deviation of one sample of the receiver.
        time_limit_s: Length of an episode.
    """

    stops_m: FloatArray
    low: NDArray[np.float32]
    high: NDArray[np.float32]
    lidar_reach_m: float
    lidar_std_m: float
    noise_v: float
    time_limit_s: float


@compiled
def observe(
    sight: tuple[FloatArray, ...],
    setting: tuple[Any, ...],
    progress: tuple[Any, ...],
    robot: IntArray,
    strengths_v: FloatArray,
    azimuth_rad: FloatArray,
    good: BoolArray,
    spectrum_gain: FloatArray,
) -> NDArray[np.float32]:
    """Observations, an entry after the other as `PatrolEnv` lists them, within their bounds.

    The bearing of a robot's strongest pulse becomes the last one of its `progress`.

    Args:
        sight: A row for each robot: believed pose, (n_robots, 3); values of `robot_models.readings.Readings`; standard
            normal draws for the lidar, (n_robots, N_DRAWS + n_beams), of which the first do not count; and time since
            the start, (n_robots,).
        setting: Of all of them, a plain `ObservationParameters`.
        progress: Of the robots, a plain `Progress`.
        robot: Who heard each pulse of this step, shape (n_pulses,).
        strengths_v: Of the pulses, shape (n_pulses, n_elements).
        azimuth_rad: Their directions, array frame, shape (n_pulses,).
        good: Channels in order, shape (n_robots, n_elements).
        spectrum_gain: Of `dirmusic.pulse_spectrum`, shape (n_robots, n_elements, n_azimuths).

    Returns:
        Shape (n_entries, n_robots): a row is an entry, so that each part of the observation lies together.
    """
    pose, readings, normal, time_s = sight
    velocity, lidar_m = readings[:, VELOCITY], readings[:, LIDAR]
    stops_m, low, high, lidar_reach_m, lidar_std_m, noise_v, time_limit_s = setting
    _, visited, _, bearing, bearing_age_s = progress
    (n_robots, n_elements), n_beams = good.shape, lidar_m.shape[1]
    strengths, level = np.zeros((n_robots, n_elements)), np.zeros(n_robots)
    for k in range(robot.size):
        r, energy = robot[k], 0.0
        for e in range(n_elements):
            energy += good[r, e] * strengths_v[k, e] * strengths_v[k, e]
        strength_v = np.sqrt(energy)
        if strength_v <= level[r]:
            continue
        level[r] = strength_v
        for e in range(n_elements):
            strengths[r, e] = good[r, e] * strengths_v[k, e] / strength_v
        towards = azimuth_rad[k] + pose[r, 2]
        bearing[r, 0], bearing[r, 1] = np.cos(towards), np.sin(towards)
        bearing_age_s[r] = 0.0
    spectrum = pulse_spectra(strengths, spectrum_gain, LEAST_NULL)
    shown = np.zeros((low.size, n_robots), np.float32)
    for r in range(n_robots):
        shown[0, r], shown[1, r] = pose[r, 0], pose[r, 1]
        shown[2, r], shown[3, r] = np.cos(pose[r, 2]), np.sin(pose[r, 2])
        at = 4
        for beam in range(n_beams):
            range_m = lidar_m[r, beam]
            told_m = range_m + lidar_std_m * normal[r, N_DRAWS + beam]
            shown[at + beam, r] = told_m if range_m < lidar_reach_m else lidar_reach_m
        at += n_beams
        shown[at, r], shown[at + 1, r] = velocity[r, 0], velocity[r, 1]
        at += 2
        if level[r] > 0.0:
            shown[at, r] = 1.0
            shown[at + 1 + n_elements, r] = np.log10(level[r] / noise_v)
        for e in range(n_elements):
            shown[at + 1 + e, r] = strengths[r, e]
        at += 2 + n_elements
        highest = max(spectrum[r].max(), 1.0)
        for k in range(spectrum.shape[1]):
            shown[at + k, r] = spectrum[r, k] / highest
        at += spectrum.shape[1]
        shown[at, r], shown[at + 1, r] = bearing[r, 0], bearing[r, 1]
        shown[at + 2, r] = bearing_age_s[r]
        stop = 0
        while stop < len(stops_m) - 1 and visited[r, stop]:
            stop += 1
        shown[at + 3, r], shown[at + 4, r] = stops_m[stop, 0], stops_m[stop, 1]
        shown[at + 5, r] = time_limit_s - time_s[r]
        for k in range(low.size):
            shown[k, r] = min(max(shown[k, r], low[k]), high[k])
    return shown
