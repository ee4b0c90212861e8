"""Forecast: how accurately a tour locates discharges, by the Cramér-Rao bound of the joint fit over views along it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic import ArrayModel, PulseBatch, strength_variance
from dirmusic.locating.joint_fit import expected_covariances
from pdpatrol.envs import Scenario
from pdpatrol.missions.driving.path_follower import distances_along
from pdpatrol.missions.driving.site_map import MIN_TRANSMISSION, SiteMap
from pdpatrol.missions.planning.detectability import Detectability, trigger_peak
from pdpatrol.missions.planning.tour import Tour
from pdpatrol.sensing.receiver.receiver import Receiver

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

VIEW_SPACING_M = 0.5
"""Path length over which pulses are pooled into one view. Assumed; as in the policies."""

PULSE_RATE_HZ = 20.0
"""Pulses per second of a discharge. Assumed; the default of scenarios."""

STOP_S = 2.0
"""Time that a stop costs, and the dock at the end. Measured on patrols of six random yards: 1.1 to 2.4 s at 0.8 m/s,
with the turns between stops."""


class Views(NamedTuple):
    """Views of the yard along a tour.

    Attributes:
        column: Columns of `Detectability`, shape (n_views,).
        pose: x m, y m, yaw rad of the robot, world frame, shape (n_views, 3).
        time_s: Time since the start, shape (n_views,).
        n_pulses: Number of pulses of one discharge that each view pools.
    """

    column: IntArray
    pose: FloatArray
    time_s: FloatArray
    n_pulses: float


def driving_time(length_m: float, n_stops: int, top_speed_mps: float) -> float:
    """Return the seconds that a tour takes."""
    return length_m / top_speed_mps + STOP_S * (n_stops + 1) * (length_m > 0.0)


def views_along(tour: Tour, detectability: Detectability, top_speed_mps: float) -> Views:
    """Return a view every `VIEW_SPACING_M` of the tour, with the robot heading along it."""
    column = detectability.columns(tour.cells)
    path_m = detectability.places_m[column]
    along_m = distances_along(path_m)
    at = np.unique(np.searchsorted(along_m, np.arange(0.0, along_m[-1] + 1e-9, VIEW_SPACING_M)))
    ahead_m = path_m[np.minimum(at + 1, len(path_m) - 1)] - path_m[np.maximum(at - 1, 0)]
    pose = np.column_stack([path_m[at], np.arctan2(ahead_m[:, 1], ahead_m[:, 0])])
    passed = np.concatenate([[0], np.cumsum(np.isin(tour.cells, tour.stops))])[at]
    time_s = along_m[at] / top_speed_mps + STOP_S * passed
    return Views(column[at], pose, time_s, PULSE_RATE_HZ * VIEW_SPACING_M / top_speed_mps)


class Forecast:
    """Expected accuracy of located discharges.

    Args:
        scenario: Array, receiver and pose sensor.
        site_map: Map of that scenario.
        amplitude_v: Peak of the discharge in a unit-gain channel 1 m away.
    """

    def __init__(self, scenario: Scenario, site_map: SiteMap, amplitude_v: float) -> None:
        self._array = scenario.known_array
        self._receiver = Receiver(scenario.receiver, scenario.array.n_channels)
        self._pose_error = scenario.pose_sensor.pose_error
        self._map = site_map
        self._amplitude_v = amplitude_v

    def detects(self, target_m: FloatArray, views: Views) -> NDArray[np.bool_]:
        """Return the views that detect a discharge at a place (3,) in sight, at any distance; shape (n_views,).

        A tour is chosen by reliable detection from near; views from farther away help as well.
        """
        transmission = self._transmission(target_m, views.pose)
        peak_v = self._amplitude_v * transmission * received(self._array, views.pose, target_m).max(axis=-1)
        return (transmission >= MIN_TRANSMISSION) & (peak_v >= trigger_peak(self._receiver))

    def covariance(self, target_m: FloatArray, views: Views, is_used: NDArray[np.bool_]) -> FloatArray:
        """Return the expected covariance of the position of a discharge at a place (3,), shape (3, 3), m^2.

        Args:
            target_m: Position of the discharge.
            views: All views.
            is_used: Mask of the views that detect it, shape (n_views,).
        """
        pose, time_s = views.pose[is_used], views.time_s[is_used]
        strengths_v = self._strengths(target_m, pose)
        front_end, config = self._receiver.front_end, self._receiver.config
        variance = strength_variance(
            strengths_v,
            self._receiver.noise_variance_v2,
            config.gate_samples,
            energy_spread=front_end.energy_spread,
            noise_on_pulse=front_end.noise_on_pulse,
        )
        pulses = PulseBatch.detected(time_s, strengths_v, variance / views.n_pulses)
        source = np.zeros(len(pose), dtype=np.intp)
        return expected_covariances(pulses, pose, source, target_m[np.newaxis], self._array, self._pose_error)[0]

    def _strengths(self, target_m: FloatArray, pose: FloatArray) -> FloatArray:
        """Return the strengths of a pulse along the direct path, shape (n, n_elements), volts."""
        transmission = self._transmission(target_m, pose)
        front_end, config = self._receiver.front_end, self._receiver.config
        gate = np.arange(config.gate_samples, dtype=np.float64) - config.pretrigger_samples + front_end.pulse_lag
        in_gate = float(np.linalg.norm(front_end.pulse(gate)))
        return self._amplitude_v * in_gate * transmission[:, np.newaxis] * received(self._array, pose, target_m)

    def _transmission(self, target_m: FloatArray, pose: FloatArray) -> FloatArray:
        """Return the transmitted amplitude along the direct path, shape (n,)."""
        return self._map.sight(np.column_stack([pose[:, :2], np.full(len(pose), self._array.height_m)]), target_m)


def received(array: ArrayModel, pose: FloatArray, target_m: FloatArray) -> FloatArray:
    """Return each element's gain to a place (3,) over its distance, from poses (n, 3); shape (n, n_elements), 1/m."""
    away_m = target_m[:2] - pose[:, :2]
    cos, sin = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    forward = (cos * away_m[:, 0] + sin * away_m[:, 1])[:, np.newaxis] - array.positions_m[:, 0]
    left = (cos * away_m[:, 1] - sin * away_m[:, 0])[:, np.newaxis] - array.positions_m[:, 1]
    up, level = target_m[2] - array.positions_m[:, 2], np.hypot(forward, left)
    off_rad = np.arctan2(left, forward) - array.manifold.boresights_rad
    return array.manifold.response_in_space(off_rad, np.arctan2(up, level)).gain / np.hypot(level, up)
