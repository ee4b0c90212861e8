"""False alarms: when noise alone triggers, and what its gates hold."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sensing.receiver.receiver import Receiver

FloatArray = NDArray[np.float64]


class FalseAlarms:
    """When noise alone triggers: a Poisson process for each of several robots.

    Args:
        rate_hz: Mean number of false alarms per second, of one robot.
        n_robots: How many robots.
    """

    def __init__(self, rate_hz: float, n_robots: int) -> None:
        self._mean_s = 1.0 / rate_hz
        self._next_s: list[float | None] = [None] * n_robots

    def restart(self, robot: int) -> None:
        """Let the time of one robot start anew."""
        self._next_s[robot] = None

    def times_s(self, robot: int, start_s: float, duration_s: float, rng: np.random.Generator) -> list[float]:
        """Times of one robot's false alarms within an interval; the intervals are to follow one another."""
        next_s, end_s = self._next_s[robot], start_s + duration_s
        times_s: list[float] = []
        if next_s is None:
            next_s = start_s + rng.exponential(self._mean_s)
        while next_s < end_s:
            times_s.append(next_s)
            next_s += rng.exponential(self._mean_s)
        self._next_s[robot] = next_s
        return times_s


def false_alarm_gates(receiver: Receiver, n_gates: int, rng: np.random.Generator) -> FloatArray:
    """What gates hold that noise alone triggered, shape (n_gates, n_elements, gate_samples), volts.

    One sample of one channel lies in the tail beyond the threshold, and its channel follows it as its correlation says;
    all other channels are as ever.
    """
    from scipy.special import ndtr, ndtri  # here, so that a command line help need not wait for it

    config, front_end, noise_v = receiver.config, receiver.front_end, receiver.filtered_noise_v
    at = config.pretrigger_samples
    follows = front_end.correlation[np.abs(np.arange(config.gate_samples) - at)]
    gates = np.empty((n_gates, receiver.n_elements, config.gate_samples))
    for gate in gates:
        gate[:] = noise_v / np.sqrt(front_end.noise_power) * front_end.noise(rng, gate.shape)
        channel = int(rng.integers(receiver.n_elements))
        tail = -ndtri((1.0 - rng.random()) * ndtr(-receiver.threshold_v / noise_v))
        crossing = float(rng.choice((-1.0, 1.0))) * tail * noise_v
        gate[channel] += (crossing - gate[channel, at]) * follows
    return gates
