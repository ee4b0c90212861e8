"""One source and one receiver with the shipped array, as in the data sheet."""

from typing import Any

import numpy as np

from pdpatrol.sensing import (
    ArrayConfig,
    DetectedPulses,
    DischargeSource,
    HelicalArray,
    ReceiverConfig,
    Scene,
    Surroundings,
)
from pdpatrol.sensing.array.array_table import ArrayTable
from pdpatrol.sensing.radio.arrivals import Arrivals, Propagation, propagate
from pdpatrol.sensing.receiver.bank import listen_once

NOMINAL = HelicalArray.nominal(ArrayConfig())
AT_ORIGIN = np.eye(4)


def source_at(
    x: float, y: float, z: float = 0.6, amplitude_v: float = 0.27, rate_hz: float = 1000.0
) -> DischargeSource:
    """Make a source that is polarised horizontally, across the line of sight from the origin."""
    at_m, axis = np.array([x, y, z]), np.array([-y, x, 0.0]) / np.hypot(x, y)
    return DischargeSource(name="s", position_m=at_m, amplitude_v=amplitude_v, pulse_rate_hz=rate_hz, axis=axis)


def listen(
    source: DischargeSource | None,
    seed: int = 0,
    duration_s: float = 1.0,
    surroundings: Surroundings | None = None,
    **config: Any,  # noqa: ANN401
) -> DetectedPulses:
    """Return the pulses that a receiver at the origin detects of one source."""
    scene, rng = Scene([] if source is None else [source], surroundings), np.random.default_rng(seed)
    return listen_once(ReceiverConfig(**config), NOMINAL, scene, rng, world_from_array=AT_ORIGIN, duration_s=duration_s)


def arrivals_of(scene: Scene, array: HelicalArray, world_from_array: np.ndarray) -> Arrivals:
    """Return the arrivals of the first source of a scene by all paths."""
    sources = scene.positions_m[:1], scene.axes[:1], scene.burst_s[:1]
    around = Propagation(*sources, ArrayTable.of(array), scene.surroundings)
    return propagate(np.zeros(1), world_from_array, around)[1]
