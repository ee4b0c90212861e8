"""How well a tour locates what it hears: the bound of the joint fix, from views along the way."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic import ArrayModel, PulseBatch, strength_variance
from dirmusic.locating.finding import ellipse95
from dirmusic.locating.joint_fit import expected_covariances
from pdpatrol.envs import Scenario
from pdpatrol.missions.driving.site_map import MIN_TRANSMISSION, SiteMap
from pdpatrol.missions.planning.hearing import Hearing, trigger_peak
from pdpatrol.missions.planning.tour import Tour
from pdpatrol.sensing.receiver.receiver import Receiver

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

VIEW_SPACING_M = 0.5
"""Length of way over which pulses are pooled into one view (assumed): as far as a place counts as another one."""

PULSE_RATE_HZ = 20.0
"""Of a discharge (assumed): the default of scenarios."""

STOP_S = 2.0
"""What a stop costs in time, the dock at the end included (measured on patrols of six random yards: 1.1 to 2.4 s at 0.8
m/s, turns of the way between stops in it)."""


class Views(NamedTuple):
    """From where the yard is heard along a tour.

    Attributes:
        column: Of `Hearing`, shape (n_views,).
        pose: x m, y m, yaw rad of the robot, world frame, shape (n_views, 3).
        time_s: Since the start, shape (n_views,).
        n_pulses: Pulses of one discharge that each of them pools.
    """

    column: IntArray
    pose: FloatArray
    time_s: FloatArray
    n_pulses: float


class Deviation(NamedTuple):
    """What the position of a discharge is expected to be known to.

    Attributes:
        semi_major_m: Of the 95 % ellipse on plan.
        height_m: Standard deviation of the height.
    """

    semi_major_m: float
    height_m: float


def driving_time(length_m: float, n_stops: int, top_speed_mps: float) -> float:
    """Seconds that a tour takes."""
    return length_m / top_speed_mps + STOP_S * (n_stops + 1) * (length_m > 0.0)


def views_along(tour: Tour, hearing: Hearing, top_speed_mps: float) -> Views:
    """A view every `VIEW_SPACING_M` of the tour, the robot heading along it."""
    column = hearing.columns(tour.cells)
    way_m = hearing.places_m[column]
    steps_m = np.diff(way_m, axis=0)
    along_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(steps_m, axis=-1))])
    at = np.unique(np.searchsorted(along_m, np.arange(0.0, along_m[-1] + 1e-9, VIEW_SPACING_M)))
    ahead_m = way_m[np.minimum(at + 1, len(way_m) - 1)] - way_m[np.maximum(at - 1, 0)]
    pose = np.column_stack([way_m[at], np.arctan2(ahead_m[:, 1], ahead_m[:, 0])])
    passed = np.concatenate([[0], np.cumsum(np.isin(tour.cells, tour.stops))])[at]
    return Views(
        column[at], pose, along_m[at] / top_speed_mps + STOP_S * passed, PULSE_RATE_HZ * VIEW_SPACING_M / top_speed_mps
    )


class Forecast:
    """Expected deviations of targets.

    Args:
        scenario: Array, receiver and pose sensor.
        site_map: Of that scenario.
        amplitude_v: Peak of the discharge in a unit-gain channel 1 m away.
    """

    def __init__(self, scenario: Scenario, site_map: SiteMap, amplitude_v: float) -> None:
        self._array = scenario.known_array
        self._receiver = Receiver(scenario.receiver, scenario.array.n_channels)
        self._pose_error = scenario.pose_sensor.pose_error
        self._map = site_map
        self._amplitude_v = amplitude_v

    def hears(self, target_m: FloatArray, views: Views) -> NDArray[np.bool_]:
        """Views that hear a discharge at a place (3,) in sight, from however far; shape (n_views,).

        The tour is chosen by what is heard from near and for certain; what else it hears on its way helps as well.
        """
        share = self._sight(target_m, views.pose)
        peak_v = self._amplitude_v * share * received(self._array, views.pose, target_m).max(axis=-1)
        return (share >= MIN_TRANSMISSION) & (peak_v >= trigger_peak(self._receiver))

    def deviation(self, target_m: FloatArray, views: Views, is_heard: NDArray[np.bool_]) -> Deviation:
        """What a discharge at a place (3,) would be known to from the views that hear it, marked of all (n_views,)."""
        pose, time_s = views.pose[is_heard], views.time_s[is_heard]
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
        of_one = np.zeros(len(pose), dtype=np.intp)
        (covariance,) = expected_covariances(pulses, pose, of_one, target_m[np.newaxis], self._array, self._pose_error)
        return Deviation(ellipse95(covariance[:2, :2]).semi_major_m, float(np.sqrt(covariance[2, 2])))

    def _strengths(self, target_m: FloatArray, pose: FloatArray) -> FloatArray:
        """Strengths of a pulse that comes straight, shape (n, n_elements), volts."""
        share = self._sight(target_m, pose)
        front_end, config = self._receiver.front_end, self._receiver.config
        gate = np.arange(config.gate_samples, dtype=np.float64) - config.pretrigger_samples + front_end.pulse_lag
        in_gate = float(np.linalg.norm(front_end.pulse(gate)))
        return self._amplitude_v * in_gate * share[:, np.newaxis] * received(self._array, pose, target_m)

    def _sight(self, target_m: FloatArray, pose: FloatArray) -> FloatArray:
        """Share of a wave that is left on the straight path, shape (n,)."""
        return self._map.sight(np.column_stack([pose[:, :2], np.full(len(pose), self._array.height_m)]), target_m)


def received(array: ArrayModel, pose: FloatArray, target_m: FloatArray) -> FloatArray:
    """Gain of each element towards a place (3,) over its distance, from poses (n, 3); shape (n, n_elements), 1/m."""
    away_m = target_m[:2] - pose[:, :2]
    cos, sin = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    forward = (cos * away_m[:, 0] + sin * away_m[:, 1])[:, np.newaxis] - array.positions_m[:, 0]
    left = (cos * away_m[:, 1] - sin * away_m[:, 0])[:, np.newaxis] - array.positions_m[:, 1]
    up, level = target_m[2] - array.positions_m[:, 2], np.hypot(forward, left)
    off_rad = np.arctan2(left, forward) - array.manifold.boresights_rad
    return array.manifold.response_in_space(off_rad, np.arctan2(up, level)).gain / np.hypot(level, up)
