"""Detections from whole waveforms: every sample of every gate is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import plain
from dirmusic.pulses.batch import PulseBatch
from sensing.radio.incoming import EmittedPulses, incoming_pulses
from sensing.radio.propagation import Propagation
from sensing.receiver.detections import Detections
from sensing.receiver.gates import GateParameters, read_gates
from sensing.receiver.receiver import Listener, Receiver
from sensing.receiver.recorder import Gates, Recorder

FloatArray = NDArray[np.float64]


class WaveformLaw:
    """Draws gates sample by sample, robot by robot.

    Args:
        receiver: The receiver of every listener.
    """

    def __init__(self, receiver: Receiver) -> None:
        front_end, config = receiver.front_end, receiver.config
        self._receiver = receiver
        self._highest_v = (2 ** (config.bits - 1) - 1.5) * receiver.step_v
        self._gate = plain(
            GateParameters(config.gate_samples, front_end.energy_spread, front_end.noise_on_pulse, config.mains_hz)
        )

    def detect(
        self, emitted: EmittedPulses, propagation: tuple[Any, ...], listeners: Sequence[Listener]
    ) -> list[Detections]:
        """Detections of emitted pulses; arguments as of `bank.DetectionLaw`."""
        incoming = incoming_pulses(tuple(emitted), propagation)
        world_from_array, parts = Propagation(*propagation).world_from_array, list[Detections]()
        robots: list[int] = np.unique(emitted.robot).tolist()
        for robot in robots:
            own, emissions = emitted.of_robot(robot)
            recorder = Recorder(self._receiver, listeners[robot], world_from_array[robot])
            parts.append(self._read(recorder, robot, recorder.record(emissions, incoming.take(own))))
        return parts

    def detect_noise(
        self, robot: int, time_s: FloatArray, gates_v: FloatArray, listener: Listener, world_from_array: FloatArray
    ) -> Detections:
        """Detections of gates that noise alone triggered; arguments as of `bank.DetectionLaw`."""
        recorder = Recorder(self._receiver, listener, world_from_array)
        return self._read(recorder, robot, Gates(time_s, gates_v + recorder.carriers(gates_v.shape), 0))

    def _read(self, recorder: Recorder, robot: int, gates: Gates) -> Detections:
        """Readings of the gates of one robot, behind its converter."""
        time_s = gates.time_s
        waveforms_v = recorder.convert(gates.gates_v, time_s)
        energy_v2 = np.einsum("nek,nek->ne", waveforms_v, waveforms_v)
        pulses = PulseBatch.room(*energy_v2.shape)
        read_gates(energy_v2, recorder.background_v2[np.newaxis], time_s, self._gate, tuple(pulses))
        is_clipped = (np.abs(waveforms_v) >= self._highest_v).any(axis=-1)
        return Detections(
            robot=np.full(time_s.size, robot),
            pulses=pulses._replace(is_clipped=is_clipped),
            waveforms_v=waveforms_v,
            n_rejected=gates.n_rejected,
        )
