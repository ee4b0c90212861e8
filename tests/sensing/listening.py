"""One source and one receiver with the shipped array, as built."""

from typing import Any

import numpy as np

from pdpatrol.sensing import ArrayConfig, Detections, DischargeSource, HelicalArray, ReceiverConfig, Scene, Surroundings
from pdpatrol.sensing.receiver.bank import listen_once

NOMINAL = HelicalArray.nominal(ArrayConfig())
AT_ORIGIN = np.eye(4)


def source_at(
    x: float, y: float, z: float = 0.6, amplitude_v: float = 0.27, rate_hz: float = 1000.0
) -> DischargeSource:
    """Polarised level across the line of sight: what it sends directly comes as it was sent."""
    at_m, axis = np.array([x, y, z]), np.array([-y, x, 0.0]) / np.hypot(x, y)
    return DischargeSource(name="s", position_m=at_m, amplitude_v=amplitude_v, pulse_rate_hz=rate_hz, axis=axis)


def listen(
    source: DischargeSource | None,
    seed: int = 0,
    duration_s: float = 1.0,
    surroundings: Surroundings | None = None,
    **config: Any,  # noqa: ANN401 - settings are of many types
) -> Detections:
    scene, rng = Scene([] if source is None else [source], surroundings), np.random.default_rng(seed)
    return listen_once(ReceiverConfig(**config), NOMINAL, scene, rng, world_from_array=AT_ORIGIN, duration_s=duration_s)
