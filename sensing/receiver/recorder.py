"""One robot's gates, sample by sample: signals, noise and carriers, the trigger in them, and the converter behind."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.bearing.gain_delay import SPEED_OF_LIGHT_MPS
from sensing.nature.pulse_shape import DECAY_S, FREQUENCY_HZ
from sensing.nature.scene import Emissions
from sensing.radio.incoming import Incoming
from sensing.receiver.faults import STUCK_AT
from sensing.receiver.gates import signals
from sensing.receiver.receiver import Listener, Receiver
from sensing.receiver.trigger import find_triggers

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

BLOCK = 256
"""Waveforms that are in memory at once."""

TAIL_WINDOWS, BURST_SHARE = 2, 0.25
"""What does not look like a pulse (assumed): after the gate come two windows, each half a gate long; if the loudest
channel has more than a quarter of the gate's mean power in both windows, it was a burst. A reflection fills one."""

AUDIBLE_SIGMAS = 6.0
"""A pulse that stays this far below the threshold is not recorded: noise does not lift it."""


class Gates(NamedTuple):
    """Gates of one robot as the converter gets them.

    Attributes:
        time_s: Times of the triggers, shape (n_gates,).
        gates_v: Shape (n_gates, n_elements, gate_samples), volts.
        n_rejected: How many triggered and did not look like a pulse.
    """

    time_s: FloatArray
    gates_v: FloatArray
    n_rejected: int


class Recorder:
    """One robot's receiver at one place.

    Args:
        receiver: Settings and what follows from them.
        listener: The robot's array, scene and randomness.
        world_from_array: Where the array really is, shape (4, 4).

    Attributes:
        background_v2: Power of a sample without a pulse, noise and carriers, shape (n_elements,).
    """

    def __init__(self, receiver: Receiver, listener: Listener, world_from_array: FloatArray) -> None:
        self._receiver, self._array = receiver, listener.array
        self._scene, self._rng = listener.scene, listener.receiver_rng
        self._world_from_array = world_from_array
        self._carried = self._tones()
        magnitude = np.abs(self._carried)
        self.background_v2 = receiver.noise_variance_v2 + 0.5 * np.square(magnitude).sum(axis=0)
        self._threshold_v = receiver.threshold_v + float(magnitude.sum(axis=0).max())

    def record(self, emitted: Emissions, incoming: Incoming) -> Gates:
        """Gates of the pulses that trigger and look like a pulse."""
        times, gates, n_rejected = list[FloatArray](), list[FloatArray](), 0
        for first in range(0, emitted.time_s.size, BLOCK):
            part = slice(first, first + BLOCK)
            block = self._record_block(emitted.take(part), incoming.take(part))
            times.append(emitted.time_s[part][block.is_triggered][block.is_pulse])
            gates.append(block.gates_v[block.is_pulse])
            n_rejected += int((~block.is_pulse).sum())
        return Gates(np.concatenate(times), np.concatenate(gates), n_rejected)

    def convert(self, gates_v: FloatArray, time_s: FloatArray) -> FloatArray:
        """What converter and faulty channels make of gates (n, n_elements, n_samples) at times (n,): whole counts."""
        receiver = self._receiver
        gates_v = receiver.faults.in_waveforms(gates_v, time_s)
        highest = 2 ** (receiver.config.bits - 1) - 1
        counted = np.clip(np.round(gates_v / receiver.step_v), -highest, highest) * receiver.step_v
        return receiver.faults.in_readings(counted, time_s, STUCK_AT * receiver.config.full_scale_v)

    def carriers(self, shape: tuple[int, ...]) -> FloatArray:
        """What carriers add to records of a shape (n, n_elements, n_samples), each record at a phase of its own."""
        added = np.zeros(shape)
        for carrier, tone in zip(self._scene.carriers, self._carried, strict=True):
            turn = 2 * np.pi * carrier.frequency_hz / self._receiver.config.sample_rate_hz * np.arange(shape[-1])
            start = np.exp(2j * np.pi * self._rng.random((shape[0], 1, 1)))
            added += (start * tone[:, np.newaxis] * np.exp(1j * turn)).real
        return added

    def _record_block(self, emitted: Emissions, incoming: Incoming) -> _Block:
        """Record some pulses."""
        receiver, config, rng = self._receiver, self._receiver.config, self._rng
        front_end, arrivals = receiver.front_end, incoming.arrivals
        path, voltage_v = find_triggers(incoming, front_end.pulse_peak, self._threshold_v)
        voltage_v = voltage_v + receiver.filtered_noise_v * rng.standard_normal(voltage_v.size)
        is_triggered = (
            voltage_v > self._threshold_v - config.trigger_jitter * AUDIBLE_SIGMAS * receiver.filtered_noise_v
        )
        n, n_tail = int(is_triggered.sum()), TAIL_WINDOWS * (config.gate_samples // 2)
        if n == 0:
            no_gates = np.empty((0, receiver.n_elements, config.gate_samples))
            return _Block(is_triggered, no_gates, np.empty(0, dtype=np.bool_))
        n_before, n_search = config.pretrigger_samples, 0
        start_s = arrivals.loudest_s[path[is_triggered]] + receiver.gate_lead_s
        if config.trigger_jitter:  # what arrives a little before may trigger too
            lead = round(self._aperture_m / SPEED_OF_LIGHT_MPS * config.sample_rate_hz)
            n_search = 2 * lead + round(front_end.pulse_lag + 2 * DECAY_S * config.sample_rate_hz)
            start_s = arrivals.loudest_s[path[is_triggered]] - (n_before + lead + rng.random(n)) / config.sample_rate_hz
        n_samples = n_search + config.gate_samples + n_tail
        burst_s = self._scene.burst_s[emitted.source[is_triggered]]
        record = self._signals(incoming.take(is_triggered), start_s, n_samples, burst_s)
        record *= emitted.peak_v[is_triggered][:, np.newaxis, np.newaxis]
        record += config.noise_v * front_end.noise(rng, record.shape)
        record += self.carriers(record.shape)
        first = np.zeros(n, dtype=np.intp)
        if config.trigger_jitter:
            level = np.abs(record[:, :, n_before : n_before + n_search])
            peak = level.max(axis=-1)
            is_above = peak.max(axis=-1) > self._threshold_v
            is_triggered[is_triggered] = is_above
            record, level, peak = record[is_above], level[is_above], peak[is_above]
            rows, loudest = np.arange(len(record)), peak.argmax(axis=-1)
            first = np.argmax(level[rows, loudest] >= 0.5 * peak[rows, loudest, np.newaxis], axis=-1)
        window = first[:, np.newaxis, np.newaxis] + np.arange(config.gate_samples + n_tail)
        record = np.take_along_axis(record, window, axis=-1)
        is_pulse = dies_out(record, self.background_v2, config.gate_samples)
        return _Block(is_triggered, record[:, :, : config.gate_samples], is_pulse)

    @property
    def _aperture_m(self) -> float:
        """Extent of the elements, the larger of breadth and height: how far apart in space arrivals may begin."""
        breadth_m = 2 * float(np.linalg.norm(self._array.positions_m[:, :2], axis=-1).max())
        return max(breadth_m, float(np.ptp(self._array.positions_m[:, 2])))

    def _signals(self, incoming: Incoming, start_s: FloatArray, n_samples: int, burst_s: FloatArray) -> FloatArray:
        """Noise-free records for a peak of 1 V, shape (n, n_elements, n_samples); bursts where they last at all."""
        front_end, arrivals = self._receiver.front_end, incoming.arrivals
        made = signals(incoming, start_s, n_samples, front_end.pulse_table)
        for k in np.flatnonzero(burst_s).tolist():
            paths = slice(incoming.first[k], incoming.first[k] + incoming.n_paths[k])
            since_s = (
                start_s[k] - arrivals.delay_s[paths, :, np.newaxis] + np.arange(n_samples) / front_end.sample_rate_hz
            )
            is_on = (since_s >= 0) & (since_s < burst_s[k])
            tone = is_on * np.sin(2 * np.pi * FREQUENCY_HZ * since_s)
            made[k] = (arrivals.amplitude[paths, :, np.newaxis] * tone).sum(axis=0)
        return made

    def _tones(self) -> NDArray[np.complex128]:
        """What the band-pass leaves of carriers, amplitude and phase by channel, shape (n_carriers, n_elements)."""
        receiver, transform = self._receiver, self._world_from_array
        tones = np.zeros((len(self._scene.carriers), receiver.n_elements), dtype=np.complex128)
        heading = np.arctan2(transform[1, 0], transform[0, 0])
        for row, carrier in enumerate(self._scene.carriers):
            azimuth = np.full(receiver.n_elements, carrier.bearing_rad - heading)
            sight = np.array([np.cos(azimuth[0]), np.sin(azimuth[0])])
            turn = 2 * np.pi * carrier.frequency_hz / SPEED_OF_LIGHT_MPS * self._array.positions_m[:, :2] @ sight
            gain = self._array.gain(azimuth, np.zeros(receiver.n_elements))
            response = receiver.front_end.response(carrier.frequency_hz)
            tones[row] = carrier.amplitude_v * response * gain * np.exp(1j * turn)
        return tones


class _Block(NamedTuple):
    """Some pulses, recorded.

    Attributes:
        is_triggered: Which pulses triggered, shape (n_pulses,).
        gates_v: Gates of the pulses that triggered, shape (n_triggered, n_elements, gate_samples).
        is_pulse: Which gates look like those of a pulse, shape (n_triggered,).
    """

    is_triggered: BoolArray
    gates_v: FloatArray
    is_pulse: BoolArray


def dies_out(record_v: FloatArray, background_v2: FloatArray, n_gate: int) -> BoolArray:
    """Whether what fills gates dies out after them, as a pulse does and a burst does not.

    Args:
        record_v: Gates with the windows after them, shape (n, n_elements, n_gate + TAIL_WINDOWS * (n_gate // 2)).
        background_v2: Power that is there without a pulse and does not count, shape (n_elements,).
        n_gate: Samples of the gate.

    Returns:
        Shape (n,).
    """
    n_window = n_gate // 2
    if n_window == 0:
        return np.ones(len(record_v), dtype=np.bool_)
    power = np.square(record_v)
    in_gate = power[:, :, :n_gate].mean(axis=-1) - background_v2
    in_windows = power[:, :, n_gate:].reshape(*record_v.shape[:2], TAIL_WINDOWS, n_window).mean(axis=-1)
    in_windows -= background_v2[:, np.newaxis]
    loudest = in_gate.argmax(axis=1)
    rows = np.arange(len(record_v))
    return in_windows[rows, loudest].min(axis=-1) <= BURST_SHARE * in_gate[rows, loudest]
