r"""Probability that a discharge at a site would be detected and confirmed from the poses of a path, planned or driven.

Pulses of level L and rate f are a Poisson process. From pose t, a pulse is detected with the probability

.. math:: q_t = \Phi\bigl((L + g_t - L_0) / \sigma\bigr)

with the gain :math:`g_t` of distance, map and antennas at the actual heading, the trigger level :math:`L_0`, and the
spread :math:`\sigma` of levels. Draws of the detected pulses give the share in which the Locator would confirm the
discharge:

- existence: each window of 5 s with a detection adds `EVIDENCE` to the log odds, and each window in which n detections
  were expected without one adds :math:`\ln(q + (1 - q) e^{-n})`, where q is `OFF`; the sum must reach `NEEDED`;
- aperture: the lines of sight span the angle that confirmation requires;
- position: one bearing for each window, because errors of array and pose are shared within it, gives a 95 % ellipse
  that is small enough to confirm. With the errors of the data sheet, 2.5 degrees by default, it agrees with the
  Locator, whose ellipses of 28 weak sources in nominal missions correspond to 2.6 degrees.

A discharge that meets the first two conditions but not the third remains a candidate.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import ndtr

from dirmusic.angles import azimuth_of, unit_vector
from dirmusic.arrays import BoolArray, FloatArray, IntArray
from dirmusic.locating.existence import OCCAM, WANDERING
from dirmusic.locating.finding import SQUARE_95
from pdpatrol.envs import Scenario
from pdpatrol.missions.driving.site_map import MIN_TRANSMISSION
from pdpatrol.sensing import HelicalArray
from pdpatrol.sensing.radio.transmission import Sight
from pdpatrol.sensing.receiver.receiver import Receiver

CERTAIN = 0.95
"""Probability from which a promise is made: of `plan` to confirm a discharge, of a report to exclude one."""

SPREAD_DB = 4.0
"""Standard deviation of the level of a pulse around that of the direct path: spread of the discharge, interference of
the ground wave, errors of the pattern. Assumed; matters only where levels are within 8 dB of the trigger."""

WINDOW_S = 5.0
"""Time for which errors are shared and an observation counts once, as in the Locator."""

EVIDENCE = float(np.log(WANDERING.bearing_rad / np.radians(2.6)) + np.log(WANDERING.level_db / SPREAD_DB)) - 1.0
NEEDED = OCCAM + 1.8 + 4.6
"""Log odds from a window with a detection, and their sum that confirms. From the Locator's model: a wandering wave
changes bearing and level by more than a discharge does, by 2.6 degrees and `SPREAD_DB`; two normal errors cost 1 on
average. The sum also makes up for the level, 1.8, and reaches the odds of 99 %, 4.6. Six windows are needed."""

OFF = 0.1
"""Share of windows in which a discharge may be off, as in the Locator."""

MOST_RANGE_M = 20.0
"""Horizontal distance beyond which views do not count. Assumed; reflections and errors of the map matter there."""

N_DRAWS, SEED = 200, 41
"""Number of draws, for a standard deviation of 0.016 at a probability of 0.95, and their seed."""


class Passes(NamedTuple):
    """Poses from which a receiver listens, in order of time.

    Attributes:
        time_s: Time of each pose, ascending, shape (n,).
        duration_s: Time spent at each pose, at most `WINDOW_S`, shape (n,).
        pose: x m, y m, yaw rad, world frame, shape (n, 3).
    """

    time_s: FloatArray
    duration_s: FloatArray
    pose: FloatArray

    @classmethod
    def along(cls, path_m: FloatArray, speed_mps: float, stops: IntArray, dwell_s: float) -> Passes:
        """Return the passes of a robot that drives along a path and stands at stops.

        Args:
            path_m: Points of the path, shape (n_points, 2), n_points at least 2.
            speed_mps: Its speed.
            stops: Indices of the points at which it stands.
            dwell_s: Time for which it stands at each.
        """
        step_m = np.diff(path_m, axis=0)
        pose = np.column_stack([path_m[:-1], azimuth_of(step_m)])
        n_parts = int(np.ceil(dwell_s / WINDOW_S))
        row = np.sort(np.concatenate([np.arange(len(pose)), np.repeat(np.minimum(stops, len(pose) - 1), n_parts)]))
        is_driving = np.append(row[1:] != row[:-1], True)  # the last of the rows of a stop
        driving_s = np.linalg.norm(step_m, axis=1)[row] / speed_mps
        duration_s = np.where(is_driving, driving_s, dwell_s / max(n_parts, 1))
        return cls(np.cumsum(duration_s) - duration_s, duration_s, pose[row])


class Views(NamedTuple):
    """Poses of a path that have one site in sight on the map, in order of time.

    Attributes:
        row: Rows of `Passes`, shape (n,).
        duration_s: Time spent at each pose, shape (n,).
        gain_db: Peak in the strongest channel relative to that in a unit-gain channel 1 m from the site, shape (n,).
        range_m: Horizontal distance from the site, shape (n,).
        aspect_rad: Direction from the site to the pose, world frame, shape (n,).
        window: Number of the window of each pose, from 0 without gaps, shape (n,).
    """

    row: IntArray
    duration_s: FloatArray
    gain_db: FloatArray
    range_m: FloatArray
    aspect_rad: FloatArray
    window: IntArray


class Traces(NamedTuple):
    """Pulses of a mission that may come from a site.

    Attributes:
        usable: Share of the detected pulses that are consistent with a plane wave.
        is_open: True for views in which pulses from the site are not mistaken for those of a finding, shape (n,).
        n_pulses: Number of pulses in each window that may come from the site and from no finding, shape (n_windows,).
    """

    usable: float
    is_open: BoolArray
    n_pulses: IntArray


class Chances(NamedTuple):
    """Probabilities of the effects of a discharge.

    Attributes:
        confirmed: That it would be confirmed.
        noticed: That it would be confirmed or remain a candidate, and leave more traces than there are.
    """

    confirmed: float
    noticed: float


class ConfirmationModel:
    """Model of detection and confirmation with the array, receiver and rules of a scenario, as the robot believes them.

    Args:
        scenario: The scenario; its sources are ignored.
        sight: Transmission of the mapped equipment.
        is_sound: Mask of the channels without a fault, shape (n_channels,); by default all.
        heading_rad: Standard deviation of the heading; by default as believed.

    Attributes:
        trigger_db: Trigger level, dB relative to 1 V before the band-pass filter.
        is_sound: The mask.
    """

    def __init__(
        self, scenario: Scenario, sight: Sight, is_sound: BoolArray | None = None, heading_rad: float | None = None
    ) -> None:
        n = scenario.array.n_channels
        self._array, self._sight = HelicalArray.nominal(scenario.array), sight
        self._height_m, self._rules = scenario.array.height_m, scenario.locating.rules()
        self.is_sound = np.ones(n, dtype=np.bool_) if is_sound is None else is_sound
        receiver = Receiver(scenario.receiver, n)
        self.trigger_db = float(20 * np.log10(receiver.threshold_v / receiver.front_end.pulse_peak))
        if heading_rad is None:
            heading_rad = scenario.pose_sensor.pose_error.heading_rad
        self._bearing_std_rad = float(np.hypot(scenario.known_array.bearing_std_rad, heading_rad))

    def views(self, passes: Passes, site_m: FloatArray) -> Views:
        """Return the poses that have a site (3,), world frame, in sight on the map."""
        away_m = passes.pose[:, :2] - site_m[:2]
        range_m, rise_m = np.hypot(*away_m.T), site_m[2] - self._height_m
        row = np.flatnonzero(range_m <= MOST_RANGE_M)
        transmission = self._sight(np.insert(passes.pose[row, :2], 2, self._height_m, axis=1), site_m)
        is_seen = transmission >= MIN_TRANSMISSION
        row, transmission = row[is_seen], transmission[is_seen]
        aspect_rad, range_m = azimuth_of(away_m[row]), np.maximum(range_m[row], 0.1)  # about the size of the array
        towards_rad = (aspect_rad + np.pi - passes.pose[row, 2])[:, np.newaxis]
        gain = self._array.gain(towards_rad, np.arctan2(rise_m, range_m)[:, np.newaxis])[:, self.is_sound]
        peak = transmission * gain.max(axis=1, initial=1e-9) / np.hypot(range_m, rise_m)
        of_pose = passes.time_s[row] // WINDOW_S
        window = np.cumsum(np.diff(of_pose, prepend=of_pose[:1]) > 0.0)
        return Views(row, passes.duration_s[row], 20 * np.log10(peak), range_m, aspect_rad, window)

    def chances(self, views: Views, level_dbv: float, rate_hz: float, traces: Traces | None = None) -> Chances:
        """Return the probabilities that a discharge would be confirmed, and that it would be noticed.

        A window has traces of the discharge if it has at least half of the pulses expected of it. The discharge would
        be noticed if its pulses were in more than twice as many open windows as have traces, plus two (assumed: errors
        of the model hide at most half of its windows).

        Args:
            views: Views of its site.
            level_dbv: Level of its pulses 1 m away, dB relative to 1 V.
            rate_hz: Pulses per second.
            traces: Pulses that may come from it; by default none, and all detected pulses are usable.
        """
        if views.row.size == 0:
            return Chances(0.0, 0.0)
        start = np.searchsorted(views.window, np.arange(views.window[-1] + 1))
        traces = traces or Traces(1.0, np.ones(views.row.size, dtype=np.bool_), np.zeros(start.size, dtype=np.intp))
        mean = rate_hz * views.duration_s * ndtr((level_dbv + views.gain_db - self.trigger_db) / SPREAD_DB)
        mean *= traces.usable
        is_detected = np.random.default_rng(SEED).random((N_DRAWS, mean.size)) < -np.expm1(-mean)

        def by_window(values: FloatArray | BoolArray) -> FloatArray:
            return np.add.reduceat(values, start, axis=-1, dtype=np.float64)

        n_detected, expected = by_window(is_detected), by_window(mean)
        silence = np.where(expected > 0.5, np.log(OFF + (1.0 - OFF) * np.exp(-expected)), 0.0)
        odds = np.where(n_detected > 0.0, EVIDENCE, silence).sum(axis=1)
        exists = (odds >= NEEDED) & (_apertures(is_detected, views.aspect_rad) >= self._rules.confirm_aperture_rad)
        across = unit_vector(views.aspect_rad + 0.5 * np.pi)
        weight = np.square(self._bearing_std_rad * views.range_m)
        products = (across[:, i] * across[:, j] / weight for i, j in ((0, 0), (0, 1), (1, 1)))
        xx, xy, yy = ((by_window(is_detected * each) / np.maximum(n_detected, 1.0)).sum(axis=1) for each in products)
        least = 0.5 * (xx + yy) - np.hypot(0.5 * (xx - yy), xy)  # information along the major axis
        is_located = least * self._rules.confirm_semi_major_m**2 >= SQUARE_95
        n_open = (by_window(is_detected & traces.is_open) > 0.0).sum(axis=1)
        n_traces = (traces.n_pulses >= np.maximum(1.0, 0.5 * by_window(mean * traces.is_open))).sum()
        is_noticed = exists & (n_open > 2 * (n_traces + 1))
        return Chances(float((exists & is_located).mean()), float(is_noticed.mean()))


def _apertures(is_detected: BoolArray, aspect_rad: FloatArray) -> FloatArray:
    """Return the aperture of the detected aspects of each draw; `is_detected` has shape (n_draws, n)."""
    order = np.argsort(aspect_rad)
    angle, detected = aspect_rad[order], is_detected[:, order]
    before = np.maximum.accumulate(np.where(detected, angle, -np.inf), axis=1)
    is_gap = detected[:, 1:] & np.isfinite(before[:, :-1])
    gap = np.where(is_gap, angle[1:] - before[:, :-1], 0.0).max(axis=1, initial=0.0)
    around = 2 * np.pi - (before[:, -1] - angle[detected.argmax(axis=1)])
    return np.where(detected.any(axis=1), 2 * np.pi - np.maximum(gap, around), 0.0)
