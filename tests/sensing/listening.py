"""Receivers with the shipped array, as in the data sheet, for the tests of this folder."""

from typing import Any

import numpy as np

from dirmusic.array.pattern import tabulate
from dirmusic.arrays import FloatArray
from pdpatrol.sensing import (
    ArrayConfig,
    Carrier,
    DetectedPulses,
    DischargeSource,
    HelicalArray,
    ReceiverConfig,
    Scene,
    Surroundings,
)
from pdpatrol.sensing.array.array_table import ArrayTable
from pdpatrol.sensing.radio.arrivals import Arrivals, Propagation, propagate
from pdpatrol.sensing.receiver.bank import Listener, listen_once
from pdpatrol.sensing.receiver.faults import ChannelFault
from pdpatrol.sensing.receiver.front_end import FrontEnd
from pdpatrol.sensing.receiver.receiver import Receiver
from pdpatrol.sensing.receiver.sampling import add_noise, settle

NOMINAL = HelicalArray.nominal(ArrayConfig())
AT_ORIGIN = np.eye(4)


def source_at(
    x: float, y: float, z: float = 0.6, amplitude_v: float = 0.27, rate_hz: float = 1000.0
) -> DischargeSource:
    """Make a source that is polarised horizontally, across the line of sight from the origin."""
    at_m, axis = np.array([x, y, z]), np.array([-y, x, 0.0]) / np.hypot(x, y)
    return DischargeSource(name="s", position_m=at_m, amplitude_v=amplitude_v, pulse_rate_hz=rate_hz, axis=axis)


def listen(
    *sources: DischargeSource,
    seed: int = 0,
    start_s: float = 0.0,
    duration_s: float = 1.0,
    surroundings: Surroundings | None = None,
    carriers: tuple[Carrier, ...] = (),
    array: HelicalArray = NOMINAL,
    world_from_array: FloatArray = AT_ORIGIN,
    faults: tuple[ChannelFault, ...] = (),
    **config: Any,  # noqa: ANN401 - settings are of many types
) -> DetectedPulses:
    """Return the pulses that one receiver detects, by default at the origin."""
    scene, rng = Scene(list(sources), surroundings, carriers=carriers), np.random.default_rng(seed)
    return listen_once(
        ReceiverConfig(**config),
        array,
        scene,
        rng,
        world_from_array=world_from_array,
        start_s=start_s,
        duration_s=duration_s,
        faults=faults,
    )


def listener(*sources: DischargeSource, seed: int = 0) -> Listener:
    """Make a receiver that listens in free space, with a generator for the sources and one for its noise."""
    nature, noise = np.random.default_rng([seed, 0]), np.random.default_rng([seed, 1])
    return Listener(array=NOMINAL, scene=Scene(list(sources)), nature_rng=nature, receiver_rng=noise)


def table_of(array: HelicalArray) -> ArrayTable:
    """Return the table of an array for the default receiver."""
    return ArrayTable.of(array, tabulate(array.cut()), *Receiver(ReceiverConfig(), 6).grid(array))


def arrivals_of(scene: Scene, array: HelicalArray, world_from_array: np.ndarray) -> Arrivals:
    """Return the arrivals of the first source of a scene by all paths."""
    sources = scene.positions_m[:1], scene.axes[:1], scene.burst_s[:1]
    around = Propagation(*sources, table_of(array), scene.surroundings)
    return propagate(np.zeros(1), world_from_array, around)[1]


def noise_of(front_end: FrontEnd, n: int, n_samples: int, std_v: float = 1.0) -> FloatArray:
    """Draw noise after the filter, shape (n, n_samples); rows are independent."""
    noise, rng, drawn = front_end.noise_filter(std_v), np.random.default_rng(0), np.zeros((n, n_samples))
    state = np.empty((len(noise.settled), n))
    settle(noise, rng, state)
    add_noise(noise, rng, state, drawn, 0, n_samples)
    return drawn
