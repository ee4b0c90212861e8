"""Pulses on their way from sources to elements, in a compiled loop: what was emitted, and what comes in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from sensing.nature.scene import Emissions
from sensing.radio.arrivals import Arrivals, propagate
from sensing.radio.propagation import named_propagation

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]


class EmittedPulses(NamedTuple):
    """Pulses as they were radiated in the scenes of several robots, robot by robot.

    Attributes:
        robot: Number of the robot in whose scene the pulse was radiated, shape (n_pulses,).
        source: Number of the source among the robot's own, shape (n_pulses,).
        peak_v: Peak 1 m away in a unit-gain channel, before the band-pass, with its sign, shape (n_pulses,).
        time_s: Time of the emission, shape (n_pulses,).
    """

    robot: IntArray
    source: IntArray
    peak_v: FloatArray
    time_s: FloatArray

    @classmethod
    def join(cls, robots: Sequence[int], emissions: Sequence[Emissions]) -> Self:
        """The emissions in the scenes of some robots, one robot after the other."""
        if len(emissions) == 1:
            source, time_s, peak_v = emissions[0]
            robot = np.zeros(time_s.size, dtype=np.intp)
            if robots[0]:
                robot += robots[0]
            return cls(robot, source, peak_v, time_s)
        robot = np.repeat(np.array(robots, dtype=np.intp), [part.time_s.size for part in emissions])
        if not emissions:
            return cls(robot, robot, np.empty(0), np.empty(0))
        source, time_s, peak_v = (np.concatenate(column) for column in zip(*emissions, strict=True))
        return cls(robot, source, peak_v, time_s)

    def of_robot(self, robot: int) -> tuple[BoolArray, Emissions]:
        """Which pulses belong to one robot, shape (n_pulses,), and those pulses."""
        own = self.robot == robot
        return own, Emissions(self.source[own], self.time_s[own], self.peak_v[own])


class Incoming(NamedTuple):
    """Pulses and the ray paths they take.

    Attributes:
        first: First path of each pulse, shape (n_pulses,).
        n_paths: Number of paths of each pulse, shape (n_pulses,).
        peak_v: Of each pulse 1 m away in a unit-gain channel, before the band-pass, shape (n_pulses,).
        arrivals: What arrives by all paths.
    """

    first: IntArray
    n_paths: IntArray
    peak_v: FloatArray
    arrivals: Arrivals

    def take(self, chosen: IntArray | BoolArray | slice) -> Incoming:
        """Some of the pulses."""
        return Incoming(self.first[chosen], self.n_paths[chosen], self.peak_v[chosen], self.arrivals)


@compiled
def incoming_pulses(emitted: tuple[Any, ...], propagation: tuple[Any, ...]) -> Incoming:
    """Emitted pulses with the ray paths they take.

    Args:
        emitted: Plain `EmittedPulses`.
        propagation: A plain `Propagation`.
    """
    pulses, around = EmittedPulses(*emitted), named_propagation(propagation)
    is_emitting = np.zeros(around.sources.burst_s.shape, np.bool_)
    n_pulses = pulses.robot.size
    for k in range(n_pulses):
        is_emitting[pulses.robot[k], pulses.source[k]] = True
    ray_paths, arrivals = propagate(is_emitting, around)
    first, n_paths = np.empty(n_pulses, np.intp), np.empty(n_pulses, np.intp)
    for k in range(n_pulses):
        first[k] = ray_paths.first[pulses.robot[k], pulses.source[k]]
        n_paths[k] = ray_paths.n_paths[pulses.robot[k], pulses.source[k]]
    return Incoming(first, n_paths, pulses.peak_v, arrivals)
