"""Detections by the law of the energies of gates: many times faster than samples, the same strengths."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import plain
from dirmusic.pulses.batch import PulseBatch
from sensing.radio.incoming import EmittedPulses
from sensing.receiver.detections import Detections
from sensing.receiver.energy_kernels import (
    EnergyDetections,
    EnergyParameters,
    GateNoise,
    NoiseDraws,
    detect_energies,
)
from sensing.receiver.faults import STUCK_AT
from sensing.receiver.gates import GateParameters, read_gates
from sensing.receiver.receiver import Listener, Receiver

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


class EnergyLaw:
    """Draws the energies of gates from their exact law.

    Args:
        receiver: The receiver of every listener.
    """

    def __init__(self, receiver: Receiver) -> None:
        front_end, config, n_elements = receiver.front_end, receiver.config, receiver.n_elements
        self._receiver = receiver
        self._background_v2 = np.full((1, n_elements), receiver.noise_variance_v2)
        self._gate = plain(
            GateParameters(config.gate_samples, front_end.energy_spread, front_end.noise_on_pulse, config.mains_hz)
        )
        self._residual_v2: FloatArray | None = None  # in white noise it is drawn: any direction is a mode
        n_modes, modes = 1, (np.empty(0), np.empty((config.gate_samples, 0)))
        if front_end.modes is not None:
            modes = front_end.modes
            n_modes, in_modes = modes[0].size, float(modes[0].sum())
            residual_v2 = receiver.filtered_noise_v**2 * (config.gate_samples - in_modes)
            self._residual_v2 = np.full((1, n_elements), residual_v2)
        self._n_draws = 1 + n_elements * n_modes
        self._parameters: tuple[Any, ...] = plain(
            EnergyParameters(
                pulse=front_end.pulse_table,
                pulse_peak=front_end.pulse_peak,
                threshold_v=receiver.threshold_v,
                gate_lead_s=receiver.gate_lead_s,
                noise=GateNoise(receiver.filtered_noise_v, *modes),
                background_v2=self._background_v2,
                gate=self._gate,
            )
        )

    def detect(
        self, emitted: EmittedPulses, propagation: tuple[Any, ...], listeners: Sequence[Listener]
    ) -> list[Detections]:
        """Detections of emitted pulses; arguments as of `bank.DetectionLaw`."""
        draws = NoiseDraws(self._normal(emitted.robot, listeners), self._residual(emitted.robot, listeners))
        n_pulses, n_elements = emitted.robot.size, self._receiver.n_elements
        found = EnergyDetections.room(n_pulses, n_elements)
        n_detected, n_rejected = detect_energies(
            tuple(emitted),
            propagation,
            self._parameters,
            tuple(draws),
            (found.robot, found.energy_v2, tuple(found.pulses)),
        )
        if n_detected < n_pulses:
            found = found.first(n_detected)
        if self._receiver.config.faults:
            return [self._read(found.robot, found.pulses.time_s, found.energy_v2, n_rejected)]
        return [Detections(found.robot, found.pulses, np.empty((n_detected, n_elements, 0)), n_rejected)]

    def detect_noise(
        self, robot: int, time_s: FloatArray, gates_v: FloatArray, listener: Listener, world_from_array: FloatArray
    ) -> Detections:
        """Detections of gates that noise alone triggered; arguments as of `bank.DetectionLaw`."""
        return self._read(np.full(time_s.size, robot), time_s, np.square(gates_v).sum(axis=-1), 0)

    def _read(self, robot: IntArray, time_s: FloatArray, energy_v2: FloatArray, n_rejected: int) -> Detections:
        """Readings of gates by their energies, (n_gates, n_elements), which faulty channels change."""
        receiver = self._receiver
        stuck_v2 = receiver.config.gate_samples * (STUCK_AT * receiver.config.full_scale_v) ** 2
        energy_v2 = receiver.faults.in_readings(energy_v2, time_s, stuck_v2)
        pulses = PulseBatch.room(*energy_v2.shape)
        read_gates(energy_v2, self._background_v2, time_s, self._gate, tuple(pulses))
        return Detections(robot, pulses, np.empty((*energy_v2.shape, 0)), n_rejected)

    def _normal(self, robot: IntArray, listeners: Sequence[Listener]) -> FloatArray:
        """Standard normal draws for each pulse from its own robot's generator, shape (n_pulses, n_draws)."""
        if len(listeners) == 1:
            return listeners[0].receiver_rng.standard_normal((robot.size, self._n_draws))
        counts = np.bincount(robot, minlength=len(listeners)).tolist()
        each = zip(listeners, counts, strict=True)
        return np.concatenate([one.receiver_rng.standard_normal((k, self._n_draws)) for one, k in each if k])

    def _residual(self, robot: IntArray, listeners: Sequence[Listener]) -> FloatArray:
        """Noise energy that no mode holds: its mean, (1, n_elements); in white noise a draw, (n_pulses, n_elements)."""
        if self._residual_v2 is not None:
            return self._residual_v2
        receiver, none = self._receiver, np.zeros(self._receiver.n_elements)
        rows: list[int] = robot.tolist()
        residual_v2 = np.empty((robot.size, receiver.n_elements))
        for k, row in enumerate(rows):
            drawn = listeners[row].receiver_rng.noncentral_chisquare(receiver.config.gate_samples - 1, none)
            residual_v2[k] = receiver.filtered_noise_v**2 * drawn
        return residual_v2
