"""The receiver: band-pass, noise, trigger, gate, converter. It decides on its own data what was heard."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, PositiveFloat, PositiveInt, model_validator

from dirmusic import pulse_strengths, strength_variance
from dirmusic.gain_delay import SPEED_OF_LIGHT_MPS
from sensing.array import HelicalArray
from sensing.energy import draw_energies
from sensing.faults import STUCK_AT, ChannelFault, Faults
from sensing.front_end import front_end
from sensing.pulses import DECAY_S, FREQUENCY_HZ
from sensing.scene import Emissions, Scene

FloatArray = NDArray[np.float64]

BLOCK = 256
"""Waveforms that are in memory at once."""

LOOKS, BURST_SHARE = 2, 0.25
"""What does not look like a pulse (assumed): after the gate come two looks, each half a gate long; if the loudest
channel has more than a quarter of the gate's mean power in both of them, it was a burst. Echoes fill one."""

AUDIBLE_SIGMAS = 6.0
"""A pulse that stays this far below the threshold is not recorded: noise does not lift it."""


class ReceiverConfig(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """A channel for each element and a common trigger. The defaults are assumed, about those of a fast oscilloscope.

    Once a channel has crossed the threshold, the gate starts `pretrigger_samples` before the loudest one comes to half
    its peak: the crossing itself comes the earlier the louder the pulse.

    `waveform` draws every sample of every gate. `energy` draws the energies of the gates from their exact law, many
    times faster: the same strengths but for what needs samples (converter, carriers, saturation, trigger jitter).
    """

    fidelity: Literal["waveform", "energy"] = "waveform"
    sample_rate_hz: float = Field(default=20e9, ge=1e8, le=1e12)
    band_hz: tuple[PositiveFloat, PositiveFloat] | Literal["all"] = (1.4e9, 2.2e9)
    """Where the band-pass is 3 dB down. The default holds the energy of the pulses, mainly 1.5 to 2 GHz, and is 54 dB
    down at the 948 MHz of the Dir-MUSIC paper's interferer; "all" leaves the noise white."""
    noise_v: PositiveFloat = 1e-3
    """Standard deviation of a sample of white noise, before the band-pass."""
    pretrigger_samples: PositiveInt = 20
    gate_samples: int = Field(default=90, ge=1, le=10_000)
    trigger_jitter: bool = True
    """Whether noise, and where between two samples a pulse arrives, move the gate; `energy` never has it."""
    false_alarm_rate_hz: float = Field(default=0.1, gt=0.0, le=1e4)
    mains_hz: PositiveFloat = 50.0
    bits: int = Field(default=12, ge=2, le=24)
    full_scale_v: PositiveFloat = 0.5
    """Largest voltage that the converter can tell, of either sign; beyond it a pulse is clipped, and flagged. With the
    defaults one count is 0.86 of the noise behind the band-pass; where it is more than two, rounding is not noise."""
    faults: tuple[ChannelFault, ...] = ()

    @model_validator(mode="after")
    def _gate_reaches_beyond_the_trigger(self) -> Self:
        if self.pretrigger_samples >= self.gate_samples:
            raise ValueError(
                f"pretrigger_samples: got {self.pretrigger_samples}; allowed is less than gate_samples, "
                f"{self.gate_samples}, or the gate ends before the pulse begins"
            )
        return self

    @model_validator(mode="after")
    def _band_lies_below_nyquist(self) -> Self:
        nyquist_hz = 0.5 * self.sample_rate_hz
        if self.band_hz != "all" and not self.band_hz[0] < self.band_hz[1] < nyquist_hz:
            raise ValueError(
                f"band_hz: got ({self.band_hz[0]:g}, {self.band_hz[1]:g}); allowed is a band that rises and ends below "
                f'half of sample_rate_hz, {nyquist_hz:g}, or "all"'
            )
        return self


@dataclass(frozen=True, kw_only=True)
class Heard:
    """What one interval of listening gave: nothing is an answer, with n_pulses = 0.

    Attributes:
        time_s: When each trigger fell, shape (n_pulses,), ascending.
        strengths_v: Shape (n_pulses, n_elements), volts.
        variance_v2: Variance of the strengths, shape (n_pulses, n_elements), V^2.
        mains_phase_rad: Phase of the receiver's own mains supply at the trigger, shape (n_pulses,), in [0, 2 pi).
        is_clipped: Whether a channel met the end of the converter's scale, shape (n_pulses, n_elements).
        waveforms_v: The gates, shape (n_pulses, n_elements, gate_samples), volts; no samples with fidelity `energy`.
        n_rejected: What triggered and did not look like a pulse.
    """

    time_s: FloatArray
    strengths_v: FloatArray
    variance_v2: FloatArray
    mains_phase_rad: FloatArray
    is_clipped: NDArray[np.bool_]
    waveforms_v: FloatArray = field(repr=False)
    n_rejected: int


class _Arrivals(NamedTuple):
    """All that reaches the elements from sources on the air; a row is a path.

    Attributes:
        source: Number of the source, shape (n_paths,).
        delay_s: Shape (n_paths, n_elements).
        amplitude: For a peak of 1 V, shape (n_paths, n_elements).
    """

    source: NDArray[np.intp]
    delay_s: FloatArray
    amplitude: FloatArray


class Receiver:
    """Turns what radiates into strengths.

    Args:
        config: Receiver settings.
        array: The array as it was really built.
    """

    def __init__(self, config: ReceiverConfig, array: HelicalArray) -> None:
        self.config = config
        self.array = array
        band_hz = None if config.band_hz == "all" else config.band_hz
        self.front_end = front_end(config.sample_rate_hz, band_hz, config.gate_samples)
        self._n_elements = array.boresights_rad.size
        self._faults = Faults(config.faults, self._n_elements)

    @property
    def step_v(self) -> float:
        """What one count of the converter stands for."""
        return self.config.full_scale_v / (2 ** (self.config.bits - 1) - 1)

    @cached_property
    def noise_variance_v2(self) -> float:
        """Variance of one sample without a pulse: filtered noise, and the converter's rounding (within one count)."""
        rounding = self.step_v**2 / 12 if self.config.fidelity == "waveform" else 0.0
        return self._filtered_v**2 + rounding

    @cached_property
    def _filtered_v(self) -> float:
        """Standard deviation of the noise behind the band-pass."""
        return self.config.noise_v * float(np.sqrt(self.front_end.noise_power))

    @cached_property
    def threshold_v(self) -> float:
        r"""Trigger level that noise alone crosses `false_alarm_rate_hz` times a second in all channels together.

        A Gaussian sequence with correlation :math:`\rho` from sample to sample rises through T, and falls through -T,
        with the probability :math:`2 \, T_O(T / \sigma, \sqrt{(1 - \rho) / (1 + \rho)})` each per sample, by Owen's
        function :math:`T_O`. Crossings that follow one another within a gate count each.
        """
        from scipy.optimize import brentq
        from scipy.special import owens_t

        correlation = float(self.front_end.correlation[1]) if self.config.gate_samples > 1 else 0.0
        slope = float(np.sqrt((1.0 - correlation) / (1.0 + correlation)))
        crossings = 4 * self._n_elements * self.config.sample_rate_hz

        def too_often(sigmas: float) -> float:
            rate_hz = crossings * float(owens_t(sigmas, slope))
            return float(np.log(max(rate_hz, 1e-300) / self.config.false_alarm_rate_hz))

        return self._filtered_v * float(brentq(too_often, 0.0, 30.0))  # pyright: ignore[reportArgumentType]

    def listen(
        self,
        world_from_array: FloatArray,
        scene: Scene,
        rng: np.random.Generator,
        *,
        start_s: float,
        duration_s: float,
    ) -> Heard:
        """Listen from one pose for `duration_s` from `start_s` on.

        Args:
            world_from_array: Where the array really is, shape (4, 4).
            scene: All that radiates, and what stands about.
            rng: All randomness.
            start_s: Simulated time at the start of the interval.
            duration_s: Length of the interval.
        """
        emitted = scene.emissions(start_s, duration_s, rng)
        false_s, false_gates = self._noise_triggers(rng, start_s, duration_s)
        if emitted.time_s.size == false_s.size == 0:
            return self._nothing
        arrivals = self._arrivals(scene, emitted, world_from_array, start_s)
        if self.config.fidelity == "energy":
            return self._hear_energies(scene, emitted, arrivals, false_s, false_gates, rng)
        return self._hear_waveforms(scene, emitted, arrivals, false_s, false_gates, world_from_array, rng)

    def _arrivals(self, scene: Scene, emitted: Emissions, world_from_array: FloatArray, start_s: float) -> _Arrivals:
        on_air = np.zeros(len(scene.sources), dtype=np.bool_)
        on_air[emitted.source] = True
        paths = scene.trace(on_air, self.array.positions_m, world_from_array)
        rays = paths.rays
        amplitude = self.array.gain_towards(rays.sight_m) * (paths.factor[:, np.newaxis] * rays.spreading)
        if self.config.faults:
            amplitude *= self._faults.signal_factors(np.array(start_s))
        return _Arrivals(paths.source, rays.delay_s, amplitude)

    @cached_property
    def _aperture_m(self) -> float:
        """Largest distance between two elements, at most."""
        return 2 * float(np.linalg.norm(self.array.positions_m[:, :2], axis=-1).max())

    def _triggers(
        self, arrivals: _Arrivals, emitted: Emissions, threshold_v: float, rng: np.random.Generator
    ) -> tuple[NDArray[np.intp], FloatArray, FloatArray]:
        """By which of its paths each pulse triggers: the first that is loud enough in its loudest channel.

        Returns:
            That path, or where none is loud enough the loudest, shape (n_pulses,); when each path reaches its loudest
            channel, shape (n_paths,); and the greatest voltage of each pulse, with noise on it, shape (n_pulses,).
        """
        loudness = np.abs(arrivals.amplitude)
        channel: NDArray[np.intp] = loudness.argmax(axis=-1)
        paths = np.arange(len(loudness))
        path_s = arrivals.delay_s[paths, channel]
        loudest_v = self.front_end.pulse_peak * loudness[paths, channel]
        is_own = arrivals.source == emitted.source[:, np.newaxis]
        level_v = np.where(is_own, np.abs(emitted.peak_v)[:, np.newaxis] * loudest_v, -1.0)
        peak_v = level_v.max(axis=-1)
        is_loud = level_v >= np.minimum(threshold_v, peak_v)[:, np.newaxis]
        first: NDArray[np.intp] = np.where(is_loud, path_s, np.inf).argmin(axis=-1)
        noise_v: FloatArray = self._filtered_v * rng.standard_normal(len(peak_v))
        return first, path_s, peak_v + noise_v

    def _signals(
        self,
        arrivals: _Arrivals,
        source: NDArray[np.intp],
        start_s: FloatArray,
        n_samples: int,
        burst_s: FloatArray | None = None,
    ) -> FloatArray:
        """Noise-free records for a peak of 1 V; overlapping paths are one waveform.

        Args:
            arrivals: What reaches the elements.
            source: Whose pulse each record holds, shape (n,), n > 0.
            start_s: When each record starts, after the pulse was radiated, shape (n,).
            n_samples: Length of the records.
            burst_s: Where records hold bursts of a carrier, how long they last; 0 for a pulse. None if all are pulses.

        Returns:
            Shape (n, n_elements, n_samples).
        """
        rate_hz = self.config.sample_rate_hz
        record, path = np.nonzero(arrivals.source == source[:, np.newaxis])
        since = (start_s[record, np.newaxis] - arrivals.delay_s[path]) * rate_hz
        sample = since[..., np.newaxis] + np.arange(n_samples)
        shape = self.front_end.pulse(sample)
        if burst_s is not None:
            is_on = (sample >= 0) & (sample < (burst_s[record] * rate_hz)[:, np.newaxis, np.newaxis])
            burst = is_on * np.sin(2 * np.pi * FREQUENCY_HZ / rate_hz * sample)
            shape = np.where((burst_s[record] > 0)[:, np.newaxis, np.newaxis], burst, shape)
        shape *= arrivals.amplitude[path][..., np.newaxis]
        return np.add.reduceat(shape, np.searchsorted(record, np.arange(source.size)), axis=0)

    def _gate_start_s(self, delay_s: FloatArray) -> FloatArray:
        """Where a gate starts that no noise moves: the pre-trigger before an arrival comes to half its peak."""
        return delay_s + (self.front_end.pulse_lag - self.config.pretrigger_samples) / self.config.sample_rate_hz

    def _hear_energies(
        self,
        scene: Scene,
        emitted: Emissions,
        arrivals: _Arrivals,
        false_s: FloatArray,
        false_gates: FloatArray,
        rng: np.random.Generator,
    ) -> Heard:
        """Strengths from the law of the gates' energies. Bursts do not look like pulses and are rejected."""
        n_samples, n_rejected = self.config.gate_samples, 0
        time_s, energy = false_s, np.square(false_gates).sum(axis=-1)
        if emitted.time_s.size:
            first, path_s, voltage = self._triggers(arrivals, emitted, self.threshold_v, rng)
            heard = np.flatnonzero(voltage > self.threshold_v)
            if heard.size:
                pulses = heard[scene.burst_s[emitted.source[heard]] == 0]
                n_rejected = heard.size - pulses.size
                drawn = self._draw(arrivals, first[pulses], path_s, emitted.peak_v[pulses], rng)
                time_s, energy = _by_time((time_s, emitted.time_s[pulses]), (energy, drawn))
        if time_s.size == 0 and n_rejected == 0:
            return self._nothing
        energy = self._faults.in_readings(energy, time_s, n_samples * (STUCK_AT * self.config.full_scale_v) ** 2)
        strengths = np.sqrt(np.maximum(energy - n_samples * self.noise_variance_v2, 0.0))
        nothing = np.empty((*strengths.shape, 0))
        return self._heard(time_s, strengths, self.noise_variance_v2, nothing, n_rejected)

    def _draw(
        self,
        arrivals: _Arrivals,
        trigger: NDArray[np.intp],
        path_s: FloatArray,
        peak_v: FloatArray,
        rng: np.random.Generator,
    ) -> FloatArray:
        """Energies of the gates of pulses with given peaks, each triggered by a path; shape (n_pulses, n_elements)."""
        is_trigger = np.zeros(path_s.size, dtype=np.bool_)
        is_trigger[trigger] = True
        path, signal = np.flatnonzero(is_trigger), is_trigger.cumsum()[trigger] - 1
        start_s = self._gate_start_s(path_s[path])
        signals = self._signals(arrivals, arrivals.source[path], start_s, self.config.gate_samples)
        return draw_energies(signals, signal, peak_v, self._filtered_v, self.front_end.modes, rng)

    def _hear_waveforms(
        self,
        scene: Scene,
        emitted: Emissions,
        arrivals: _Arrivals,
        false_s: FloatArray,
        false_gates: FloatArray,
        world_from_array: FloatArray,
        rng: np.random.Generator,
    ) -> Heard:
        """Strengths from whole gates, sample by sample."""
        tones = self._tones(scene, world_from_array)
        background_v2 = self.noise_variance_v2 + 0.5 * np.square(np.abs(tones)).sum(axis=0)
        threshold_v = self.threshold_v + float(np.max(np.abs(tones).sum(axis=0)))
        false_gates += self._carriers(scene, tones, false_gates.shape, rng)
        times, gates, n_rejected = [false_s], [false_gates], 0
        for first in range(0, emitted.time_s.size, BLOCK):
            part = slice(first, first + BLOCK)
            block = emitted.take(part)
            heard, gate, is_pulse = self._record(scene, block, arrivals, tones, background_v2, threshold_v, rng)
            times.append(block.time_s[heard][is_pulse])
            gates.append(gate[is_pulse])
            n_rejected += int((~is_pulse).sum())
        time_s, analogue = _by_time(times, gates)
        analogue = self._faults.in_waveforms(analogue, time_s)
        waveforms = self._faults.in_readings(self._convert(analogue), time_s, STUCK_AT * self.config.full_scale_v)
        strengths = np.nan_to_num(pulse_strengths(waveforms, background_v2))  # not a count in all the gate: silent
        return self._heard(time_s, strengths, background_v2, waveforms, n_rejected)

    @cached_property
    def _nothing(self) -> Heard:
        """What most intervals give."""
        n_samples = self.config.gate_samples if self.config.fidelity == "waveform" else 0
        silence = np.empty((0, self._n_elements))
        return self._heard(np.empty(0), silence, self.noise_variance_v2, np.empty((*silence.shape, n_samples)), 0)

    def _heard(
        self,
        time_s: FloatArray,
        strengths_v: FloatArray,
        background_v2: FloatArray | float,
        waveforms_v: FloatArray,
        n_rejected: int,
    ) -> Heard:
        highest = 2 ** (self.config.bits - 1) - 1
        return Heard(
            time_s=time_s,
            strengths_v=strengths_v,
            variance_v2=strength_variance(
                strengths_v,
                background_v2,
                self.config.gate_samples,
                energy_spread=self.front_end.energy_spread,
                noise_on_pulse=self.front_end.noise_on_pulse,
            ),
            mains_phase_rad=np.mod(2 * np.pi * self.config.mains_hz * time_s, 2 * np.pi),
            is_clipped=(np.abs(waveforms_v) >= (highest - 0.5) * self.step_v).any(axis=-1),
            waveforms_v=waveforms_v,
            n_rejected=n_rejected,
        )

    def _record(
        self,
        scene: Scene,
        emitted: Emissions,
        arrivals: _Arrivals,
        tones: NDArray[np.complex128],
        background_v2: FloatArray,
        threshold_v: float,
        rng: np.random.Generator,
    ) -> tuple[NDArray[np.bool_], FloatArray, NDArray[np.bool_]]:
        """Record some pulses.

        Returns:
            Which triggered, shape (n_pulses,); their gates, shape (n_heard, n_elements, gate_samples); and which of
            those look like a pulse, shape (n_heard,).
        """
        config = self.config
        path, path_s, voltage = self._triggers(arrivals, emitted, threshold_v, rng)
        heard = voltage > threshold_v - config.trigger_jitter * AUDIBLE_SIGMAS * self._filtered_v
        delay_s, peak_v, source = path_s[path[heard]], emitted.peak_v[heard], emitted.source[heard]
        if source.size == 0:
            return heard, np.empty((0, self._n_elements, config.gate_samples)), np.empty(0, dtype=np.bool_)
        n, n_looks = peak_v.size, LOOKS * (config.gate_samples // 2)
        n_before = config.pretrigger_samples
        if config.trigger_jitter:
            lead = round(
                self._aperture_m / SPEED_OF_LIGHT_MPS * config.sample_rate_hz
            )  # what arrives a little before may trigger too
            n_search = 2 * lead + round(self.front_end.pulse_lag + 2 * DECAY_S * config.sample_rate_hz)
            start_s = delay_s - (n_before + lead + rng.random(n)) / config.sample_rate_hz
        else:
            n_search = 0
            start_s = self._gate_start_s(delay_s)
        n_samples = n_search + config.gate_samples + n_looks
        burst_s = scene.burst_s[source]
        signals = self._signals(arrivals, source, start_s, n_samples, burst_s if burst_s.any() else None)
        record = peak_v[:, np.newaxis, np.newaxis] * signals
        record += config.noise_v * self.front_end.noise(rng, record.shape)
        record += self._carriers(scene, tones, record.shape, rng)
        first = np.zeros(n, dtype=np.intp)
        if config.trigger_jitter:
            level = np.abs(record[:, :, n_before : n_before + n_search])
            peak = level.max(axis=-1)
            triggered = peak.max(axis=-1) > threshold_v
            heard[heard] = triggered
            record, level, peak = record[triggered], level[triggered], peak[triggered]
            rows, loudest = np.arange(len(record)), peak.argmax(axis=-1)
            first = np.argmax(level[rows, loudest] >= 0.5 * peak[rows, loudest, np.newaxis], axis=-1)
        window = first[:, np.newaxis, np.newaxis] + np.arange(config.gate_samples + n_looks)
        record = np.take_along_axis(record, window, axis=-1)
        return heard, record[:, :, : config.gate_samples], self._looks_like_a_pulse(record, background_v2)

    def _looks_like_a_pulse(self, record: FloatArray, background_v2: FloatArray) -> NDArray[np.bool_]:
        """Whether what fills gates died out after them; records (n, n_elements, gate and looks), answer (n,).

        The power that is there without a pulse, `background_v2` (n_elements,), does not count.
        """
        n_gate, n_look = self.config.gate_samples, self.config.gate_samples // 2
        if n_look == 0:
            return np.ones(len(record), dtype=np.bool_)
        power = np.square(record)
        in_gate = power[:, :, :n_gate].mean(axis=-1) - background_v2
        looks = power[:, :, n_gate:].reshape(*record.shape[:2], LOOKS, n_look).mean(axis=-1)
        looks -= background_v2[:, np.newaxis]
        loudest = in_gate.argmax(axis=1)
        rows = np.arange(len(record))
        return looks[rows, loudest].min(axis=-1) <= BURST_SHARE * in_gate[rows, loudest]

    def _tones(self, scene: Scene, world_from_array: FloatArray) -> NDArray[np.complex128]:
        """What the band-pass leaves of carriers, amplitude and phase by channel, shape (n_carriers, n_elements)."""
        tones = np.zeros((len(scene.carriers), self._n_elements), dtype=np.complex128)
        heading = np.arctan2(world_from_array[1, 0], world_from_array[0, 0])
        for row, carrier in enumerate(scene.carriers):
            azimuth = np.full(self._n_elements, carrier.bearing_rad - heading)
            sight = np.array([np.cos(azimuth[0]), np.sin(azimuth[0])])
            turn = 2 * np.pi * carrier.frequency_hz / SPEED_OF_LIGHT_MPS * self.array.positions_m[:, :2] @ sight
            gain = self.array.gain(azimuth, np.zeros(self._n_elements))
            tones[row] = carrier.amplitude_v * self.front_end.response(carrier.frequency_hz) * gain * np.exp(1j * turn)
        return tones

    def _carriers(
        self, scene: Scene, tones: NDArray[np.complex128], shape: tuple[int, ...], rng: np.random.Generator
    ) -> FloatArray:
        """What carriers add to records of a shape (n, n_elements, n_samples), each record at a phase of its own."""
        added = np.zeros(shape)
        for carrier, tone in zip(scene.carriers, tones, strict=True):
            turn = 2 * np.pi * carrier.frequency_hz / self.config.sample_rate_hz * np.arange(shape[-1])
            start = np.exp(2j * np.pi * rng.random((shape[0], 1, 1)))
            added += (start * tone[:, np.newaxis] * np.exp(1j * turn)).real
        return added

    def _convert(self, waveforms_v: FloatArray) -> FloatArray:
        """What the converter makes of gates: whole counts, and none beyond its scale."""
        highest = 2 ** (self.config.bits - 1) - 1
        return np.clip(np.round(waveforms_v / self.step_v), -highest, highest) * self.step_v

    def _noise_triggers(
        self, rng: np.random.Generator, start_s: float, duration_s: float
    ) -> tuple[FloatArray, FloatArray]:
        """Times (n,) and gates (n, n_elements, n_samples) of triggers by noise alone.

        One sample of one channel lies in the tail beyond the threshold, and its channel follows it as its correlation
        says; all other channels are as ever.
        """
        config = self.config
        n = rng.poisson(config.false_alarm_rate_hz * duration_s)
        if n == 0:
            return np.empty(0), np.empty((0, self._n_elements, config.gate_samples))
        from scipy.special import ndtr, ndtri

        gates = self._filtered_v * self.front_end.noise(rng, (n, self._n_elements, config.gate_samples))
        gates /= np.sqrt(self.front_end.noise_power)
        time_s = start_s + duration_s * rng.random(n)
        at, channel = config.pretrigger_samples, rng.integers(self._n_elements, size=n)
        tail = -ndtri((1.0 - rng.random(n)) * ndtr(-self.threshold_v / self._filtered_v))
        crossing = rng.choice((-1.0, 1.0), n) * tail * self._filtered_v
        follows = self.front_end.correlation[np.abs(np.arange(config.gate_samples) - at)]
        rows = np.arange(n)
        gates[rows, channel] += (crossing - gates[rows, channel, at])[:, np.newaxis] * follows
        return time_s, gates


def _by_time(times: Sequence[FloatArray], rows: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Times, each (n_k,), one after the other, and what belongs to them, each (n_k, ...)."""
    time_s = np.concatenate(times)
    order = np.argsort(time_s, kind="stable")
    return time_s[order], np.concatenate(rows)[order]
