"""Receivers of one make that listen side by side: what radiates, along its paths, to the strengths of pulses."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import plain
from dirmusic.pulses.batch import PulseBatch
from sensing.array import ArrayTable, HelicalArray
from sensing.nature.scene import Emissions, Scene
from sensing.radio.incoming import EmittedPulses, incoming_pulses
from sensing.receiver.detections import Detections
from sensing.receiver.energy_law import Channel, GateNoise, hear_energies, told
from sensing.receiver.faults import STUCK_AT
from sensing.receiver.receiver import Receiver, ReceiverConfig
from sensing.receiver.waveform_law import Recorder

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


NOT_DRAWN = -1.0
"""Time of a false alarm that is still to be drawn."""


class Receivers:
    """Several robots, each with its own array, scene and generator, in yards with the same surroundings.

    What one of them hears does not depend, to the bit, on how many listen beside it.

    Args:
        config: Of every receiver.
        arrays: As they were really built, of one size and pattern.
        scenes: What each of them hears, with equally many sources.
        rngs: Noise and triggers of each receiver.
        nature_rngs: When the sources of each of them discharge, and how strongly.
    """

    def __init__(
        self,
        config: ReceiverConfig,
        arrays: Sequence[HelicalArray],
        scenes: Sequence[Scene],
        rngs: Sequence[np.random.Generator],
        nature_rngs: Sequence[np.random.Generator],
    ) -> None:
        self.config = config
        self._receivers = [Receiver(config, array) for array in arrays]
        self._one = self._receivers[0]
        self._arrays = ArrayTable.of(arrays)
        self._scenes, self._rngs, self._nature_rngs = list(scenes), list(rngs), list(nature_rngs)
        n_sources = len(scenes[0].sources)
        self._sources_m = np.empty((len(arrays), n_sources, 3))
        self._burst_s = np.empty((len(arrays), n_sources))
        self._false_s = [NOT_DRAWN] * len(arrays)
        self._surroundings = plain(scenes[0].surroundings)
        for row, scene in enumerate(scenes):
            self.replace(row, arrays[row], scene, rngs[row], nature_rngs[row])

    def replace(
        self,
        row: int,
        array: HelicalArray,
        scene: Scene,
        rng: np.random.Generator,
        nature_rng: np.random.Generator,
    ) -> None:
        """Another array, scene and generators for one robot, whose time starts anew."""
        self._receivers[row] = Receiver(self.config, array)
        self._arrays.replace(row, array)
        self._scenes[row], self._rngs[row], self._nature_rngs[row] = scene, rng, nature_rng
        self._sources_m[row], self._burst_s[row] = scene.positions_m, scene.burst_s
        self._false_s[row] = NOT_DRAWN

    def listen(
        self, world_from_array: FloatArray, start_s: FloatArray, duration_s: float, rows: IntArray | None = None
    ) -> Detections:
        """Listen for `duration_s`; the intervals of one robot are to follow one another.

        Args:
            world_from_array: Where the arrays really are, shape (n_robots, 4, 4).
            start_s: Simulated time of each robot at the start of the interval, shape (n_robots,).
            duration_s: Length of the interval.
            rows: Which robots listen; None for all.
        """
        listening: list[int] = list(range(len(self._rngs))) if rows is None else rows.tolist()
        starts: list[float] = start_s.tolist()
        emissions = [self._scenes[row].emissions(starts[row], duration_s, self._nature_rngs[row]) for row in listening]
        emitted, parts = (
            _flat(listening, emissions),
            self._false_alarms(listening, world_from_array, starts, duration_s),
        )
        if emitted.time_s.size:
            arrays = self._arrays
            if self.config.faults:
                left = self._one.faults.signal_factors(start_s)
                factors, offsets = arrays.gain_factors * left, arrays.gain_offsets * left
                arrays = arrays._replace(gain_factors=factors, gain_offsets=offsets)
            if self.config.fidelity == "energy":
                parts.append(self._energies(emitted, world_from_array, arrays))
            else:
                parts += self._waveforms(emitted, world_from_array, arrays)
        if len(parts) == 1:
            return parts[0]
        return Detections.join(parts) if parts else self._nothing

    def _energies(self, emitted: EmittedPulses, world_from_array: FloatArray, arrays: ArrayTable) -> Detections:
        """From the law of the gates' energies."""
        robot, time_s, energy, strengths_v, variance_v2, mains_phase_rad, n_rejected = hear_energies(
            tuple(emitted),
            self._sources_m,
            self._burst_s,
            world_from_array,
            tuple(arrays),
            self._surroundings,
            self._channel,
            self._draw(emitted.robot),
            self._beside_the_modes(emitted.robot),
            self._background_v2,
            self._telling,
        )
        if self.config.faults:
            return self._of_energies(robot, time_s, energy, n_rejected)
        pulses = PulseBatch.detected(time_s, strengths_v, variance_v2, mains_phase_rad)
        return Detections(robot, pulses, np.empty((*energy.shape, 0)), n_rejected)

    def _of_energies(self, robot: IntArray, time_s: FloatArray, energy: FloatArray, n_rejected: int) -> Detections:
        """What is told of gates by their energies, (n_pulses, n_elements); faulty channels say something else."""
        stuck_v2 = self.config.gate_samples * (STUCK_AT * self.config.full_scale_v) ** 2
        energy = self._one.faults.in_readings(energy, time_s, stuck_v2)
        strengths_v, variance_v2, mains_phase_rad = told(energy, self._background_v2, time_s, self._telling)
        pulses = PulseBatch.detected(time_s, strengths_v, variance_v2, mains_phase_rad)
        return Detections(robot, pulses, np.empty((*energy.shape, 0)), n_rejected)

    def _of_waveforms(
        self, recorder: Recorder, row: int, time_s: FloatArray, gates_v: FloatArray, n_rejected: int
    ) -> Detections:
        """What is told of the gates (n_pulses, n_elements, gate_samples) of one robot, behind its converter."""
        waveforms_v = recorder.convert(gates_v, time_s)
        energy = np.einsum("nek,nek->ne", waveforms_v, waveforms_v)
        strengths_v, variance_v2, mains_phase_rad = told(
            energy, recorder.background_v2[np.newaxis], time_s, self._telling
        )
        highest_v = (2 ** (self.config.bits - 1) - 1.5) * self._one.step_v
        return Detections(
            robot=np.full(time_s.size, row),
            pulses=PulseBatch.detected(
                time_s, strengths_v, variance_v2, mains_phase_rad, (np.abs(waveforms_v) >= highest_v).any(axis=-1)
            ),
            waveforms_v=waveforms_v,
            n_rejected=n_rejected,
        )

    @cached_property
    def _telling(self) -> tuple[int, float, float, float]:
        front_end, config = self._one.front_end, self.config
        return config.gate_samples, front_end.energy_spread, front_end.noise_on_pulse, config.mains_hz

    @cached_property
    def _channel(self) -> tuple[Any, ...]:
        one, front_end = self._one, self._one.front_end
        modes = front_end.modes or (np.empty(0), np.empty((self.config.gate_samples, 0)))
        noise = GateNoise(one.filtered_v, *modes)
        return plain(Channel(front_end.pulse_table, front_end.pulse_peak, one.threshold_v, one.gate_lead_s, noise))

    @cached_property
    def _background_v2(self) -> FloatArray:
        """Power of a sample without a pulse, shape (1, n_elements)."""
        return np.full((1, self._one.n_elements), self._one.noise_variance_v2)

    @cached_property
    def _beside_v2(self) -> FloatArray | None:
        """Mean noise energy that no mode holds, shape (1, n_elements); None in white noise, which has no modes."""
        one, modes = self._one, self._one.front_end.modes
        if modes is None:
            return None
        return np.full((1, one.n_elements), one.filtered_v**2 * (self.config.gate_samples - float(modes[0].sum())))

    def _beside_the_modes(self, robot: IntArray) -> FloatArray:
        """Noise energy that no mode holds: its mean, (1, n_elements); in white noise a draw, (n_pulses, n_elements)."""
        if self._beside_v2 is not None:
            return self._beside_v2
        one, none = self._one, np.zeros(self._one.n_elements)
        beside_v2 = np.empty((robot.size, one.n_elements))
        rows: list[int] = robot.tolist()
        for k, row in enumerate(rows):
            beside_v2[k] = one.filtered_v**2 * self._rngs[row].noncentral_chisquare(self.config.gate_samples - 1, none)
        return beside_v2

    @cached_property
    def _n_draws(self) -> int:
        """Standard normal draws for each pulse."""
        modes = self._one.front_end.modes
        return 1 + self._one.n_elements * (1 if modes is None else modes[0].size)

    def _draw(self, robot: IntArray) -> FloatArray:
        """Standard normal draws for each pulse from its own robot's generator, shape (robot.size, n_draws)."""
        if len(self._rngs) == 1:
            return self._rngs[0].standard_normal((robot.size, self._n_draws))
        counts = np.bincount(robot, minlength=len(self._rngs)).tolist()
        return np.concatenate(
            [rng.standard_normal((k, self._n_draws)) for rng, k in zip(self._rngs, counts, strict=True) if k]
        )

    def _waveforms(self, emitted: EmittedPulses, world_from_array: FloatArray, arrays: ArrayTable) -> list[Detections]:
        """From whole gates, sample by sample, robot by robot."""
        surroundings = self._scenes[0].surroundings
        incoming = incoming_pulses(emitted, self._sources_m, world_from_array, arrays, surroundings)
        parts, rows = list[Detections](), emitted.robot.tolist()
        for row in sorted({int(row) for row in rows}):
            own = emitted.robot == row
            recorder = Recorder(self._receivers[row], self._scenes[row], world_from_array[row], self._rngs[row])
            emissions = Emissions(emitted.source[own], emitted.time_s[own], emitted.peak_v[own])
            heard_s, gates, n_rejected = recorder.record(emissions, incoming.take(own))
            parts.append(self._of_waveforms(recorder, row, heard_s, gates, n_rejected))
        return parts

    def _false_alarms(
        self, listening: list[int], world_from_array: FloatArray, starts_s: list[float], duration_s: float
    ) -> list[Detections]:
        """What noise alone triggers: a Poisson process for each robot."""
        parts: list[Detections] = []
        for row in [row for row in listening if self._false_s[row] < starts_s[row] + duration_s]:
            rng, time_s = self._rngs[row], list[float]()
            mean_s = 1.0 / self.config.false_alarm_rate_hz
            if self._false_s[row] < 0.0:
                self._false_s[row] = starts_s[row] + rng.exponential(mean_s)
            while self._false_s[row] < starts_s[row] + duration_s:
                time_s.append(self._false_s[row])
                self._false_s[row] += rng.exponential(mean_s)
            if time_s:
                parts.append(self._false_gates(row, world_from_array[row], np.array(time_s)))
        return parts

    def _false_gates(self, row: int, world_from_array: FloatArray, time_s: FloatArray) -> Detections:
        receiver, rng = self._receivers[row], self._rngs[row]
        gates = np.array([receiver.false_gate(rng) for _ in range(time_s.size)])
        if self.config.fidelity == "waveform":
            recorder = Recorder(receiver, self._scenes[row], world_from_array, rng)
            return self._of_waveforms(recorder, row, time_s, gates + recorder.carriers(gates.shape), 0)
        return self._of_energies(np.full(time_s.size, row), time_s, np.square(gates).sum(axis=-1), 0)

    @cached_property
    def _nothing(self) -> Detections:
        """What most intervals give."""
        n_samples = self.config.gate_samples if self.config.fidelity == "waveform" else 0
        nobody, pulses = np.empty(0, dtype=np.intp), PulseBatch.none(self._one.n_elements)
        return Detections(nobody, pulses, np.empty((0, self._one.n_elements, n_samples)), 0)


def _flat(rows: list[int], emissions: Sequence[Emissions]) -> EmittedPulses:
    """Emissions of robots one after the other."""
    if len(emissions) == 1:
        source, time_s, peak_v = emissions[0]
        robot = np.zeros(time_s.size, dtype=np.intp)
        if rows[0]:
            robot += rows[0]
        return EmittedPulses(robot, source, peak_v, time_s)
    robot = np.repeat(np.array(rows, dtype=np.intp), [part.time_s.size for part in emissions])
    if not emissions:
        return EmittedPulses(robot, robot, np.empty(0), np.empty(0))
    source, time_s, peak_v = (np.concatenate(column) for column in zip(*emissions, strict=True))
    return EmittedPulses(robot, source, peak_v, time_s)
