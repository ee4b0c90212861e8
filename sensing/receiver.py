"""The receiver: noise, trigger, gate. It decides on its own data what was heard."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, PositiveFloat, PositiveInt, model_validator

from dirmusic import pulse_strengths, strength_variance
from sensing.array import HelicalArray
from sensing.propagation import SPEED_OF_LIGHT_MPS, direct_paths
from sensing.pulses import DECAY_S, damped_pulse
from sensing.sources import DischargeSource

FloatArray = NDArray[np.float64]
LineOfSight = Callable[[FloatArray, FloatArray], NDArray[np.bool_]]
"""(points (n, 3), target (3,)) -> whether nothing stands between, (n,). Handed in: sensing knows no physics engine."""


class ReceiverConfig(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """A channel for each element and a common trigger. The defaults are assumed, about those of a fast oscilloscope."""

    sample_rate_hz: float = Field(default=20e9, ge=1e8, le=1e12)
    noise_v: PositiveFloat = 1e-3
    pretrigger_samples: PositiveInt = 20
    gate_samples: int = Field(default=90, ge=1, le=10_000)
    false_alarm_rate_hz: float = Field(default=0.1, gt=0.0, le=1e4)
    mains_hz: PositiveFloat = 50.0
    bits: int = Field(default=12, ge=2, le=24)
    full_scale_v: PositiveFloat = 1.0
    """Largest voltage that the converter can tell, of either sign; beyond it a pulse is clipped, and flagged."""

    @model_validator(mode="after")
    def _gate_reaches_beyond_the_trigger(self) -> Self:
        if self.pretrigger_samples >= self.gate_samples:
            raise ValueError(
                f"pretrigger_samples: got {self.pretrigger_samples}; allowed is less than gate_samples, "
                f"{self.gate_samples}, or the gate ends before the pulse begins"
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
        waveforms_v: The gates, shape (n_pulses, n_elements, gate_samples), volts.
        is_clipped: Whether any sample of a gate met the end of the converter's scale, shape (n_pulses,).
    """

    time_s: FloatArray
    strengths_v: FloatArray
    variance_v2: FloatArray
    mains_phase_rad: FloatArray
    waveforms_v: FloatArray
    is_clipped: NDArray[np.bool_]


class Receiver:
    """Turns what radiates into strengths.

    Args:
        config: Receiver settings.
        array: The array as it was really built.
    """

    def __init__(self, config: ReceiverConfig, array: HelicalArray) -> None:
        self.config = config
        self.array = array
        self._n_elements = array.boresights_rad.size

    @property
    def step_v(self) -> float:
        """What one count of the converter stands for."""
        return self.config.full_scale_v / (2 ** (self.config.bits - 1) - 1)

    @property
    def noise_variance_v2(self) -> float:
        """Variance of one sample without a pulse: noise, and the converter's rounding (even within one count)."""
        return self.config.noise_v**2 + self.step_v**2 / 12

    @property
    def threshold_v(self) -> float:
        r"""Trigger level that white noise alone crosses `false_alarm_rate_hz` times a second in all channels together.

        .. math:: 2 Q(T / \sigma) \, n_\text{elements} f_s = \text{rate}
        """
        return -self.config.noise_v * NormalDist().inv_cdf(self._tail_probability)

    @property
    def _tail_probability(self) -> float:
        """Probability that one noise sample lies above the threshold; as many lie below minus the threshold."""
        return self.config.false_alarm_rate_hz / (2 * self._n_elements * self.config.sample_rate_hz)

    def listen(
        self,
        pose: FloatArray,
        sources: Sequence[DischargeSource],
        line_of_sight: LineOfSight,
        rng: np.random.Generator,
        *,
        start_s: float,
        duration_s: float,
    ) -> Heard:
        """Listen from one pose for `duration_s` from `start_s` on.

        Args:
            pose: Where the robot really is: x m, y m, yaw rad, world frame, shape (3,).
            sources: All that radiates.
            line_of_sight: Which elements see a source.
            rng: All randomness.
            start_s: Simulated time at the start of the interval.
            duration_s: Length of the interval.
        """
        elements_m = self.array.elements_in_world(pose)
        times: list[FloatArray] = []
        gates: list[FloatArray] = []
        for source in sources:
            emitted_s, peak_v = source.emissions(start_s, duration_s, rng)
            if emitted_s.size == 0:
                continue
            visible = line_of_sight(elements_m, source.position_m)
            if not visible.any():
                continue
            heard, gate = self._record(pose, elements_m, source.position_m, peak_v, visible, rng)
            times.append(emitted_s[heard])
            gates.append(gate)
        false_s, false_gates = self._noise_triggers(rng, start_s, duration_s)
        time_s = np.concatenate([*times, false_s])
        order = np.argsort(time_s, kind="stable")
        time_s = time_s[order]
        waveforms, is_clipped = self._convert(np.concatenate([*gates, false_gates])[order])
        strengths = pulse_strengths(waveforms, self.noise_variance_v2)
        return Heard(
            time_s=time_s,
            strengths_v=strengths,
            variance_v2=strength_variance(strengths, self.noise_variance_v2, self.config.gate_samples),
            mains_phase_rad=np.mod(2 * np.pi * self.config.mains_hz * time_s, 2 * np.pi),
            waveforms_v=waveforms,
            is_clipped=is_clipped,
        )

    def _record(
        self,
        pose: FloatArray,
        elements_m: FloatArray,
        source_m: FloatArray,
        peak_v: FloatArray,
        visible: NDArray[np.bool_],
        rng: np.random.Generator,
    ) -> tuple[NDArray[np.bool_], FloatArray]:
        """Record one source: which pulses triggered (n_pulses,), and their gates (n_heard, n_elements, n_samples)."""
        config, n_pulses = self.config, peak_v.size
        paths = direct_paths(elements_m, source_m)
        gain = visible * self.array.gain(paths.azimuth_rad - pose[2], paths.elevation_rad) * paths.spreading
        aperture_s = 4 * float(np.linalg.norm(self.array.positions_m[:, :2], axis=-1).max()) / SPEED_OF_LIGHT_MPS
        lead = config.pretrigger_samples
        n_search = lead + int((aperture_s + 2 * DECAY_S) * config.sample_rate_hz)
        n_samples = n_search + config.gate_samples
        jitter = rng.random((n_pulses, 1, 1))  # where between two samples the pulse arrives
        noise = config.noise_v * rng.standard_normal((n_pulses, elements_m.shape[0], n_samples))
        time_s = (np.arange(n_samples) - lead - jitter) / config.sample_rate_hz
        delay_s = (paths.delay_s - paths.delay_s.min())[:, np.newaxis]
        amplitude = peak_v[:, np.newaxis, np.newaxis] * gain[:, np.newaxis]
        waveform = amplitude * damped_pulse(time_s - delay_s) + noise
        crossed: NDArray[np.bool_] = np.max(np.abs(waveform[:, :, lead:n_search]), axis=1) > self.threshold_v
        heard: NDArray[np.bool_] = crossed.max(axis=-1)
        first = crossed[heard].argmax(axis=-1)  # gate starts `pretrigger_samples` before the sample that triggered
        gate = first[:, np.newaxis, np.newaxis] + np.arange(config.gate_samples)
        return heard, np.take_along_axis(waveform[heard], gate, axis=-1)

    def _convert(self, waveforms_v: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
        """What the converter makes of gates (n, n_elements, n_samples), and which of them it clips, (n,)."""
        highest = 2 ** (self.config.bits - 1) - 1
        counts = np.round(waveforms_v / self.step_v)
        is_clipped = np.any(np.abs(counts) >= highest, axis=(-1, -2))
        return np.clip(counts, -highest, highest) * self.step_v, is_clipped

    def _noise_triggers(
        self, rng: np.random.Generator, start_s: float, duration_s: float
    ) -> tuple[FloatArray, FloatArray]:
        """Times (n,) and gates (n, n_elements, n_samples) of triggers by noise alone.

        Exact for white noise and rare triggers: one sample of one channel lies in the tail beyond the threshold, all
        others are as ever.
        """
        config = self.config
        n = rng.poisson(config.false_alarm_rate_hz * duration_s)
        gates = config.noise_v * rng.standard_normal((n, self._n_elements, config.gate_samples))
        time_s = start_s + duration_s * rng.random(n)
        for gate in gates:
            tail = -NormalDist().inv_cdf((1.0 - rng.random()) * self._tail_probability)
            gate[rng.integers(self._n_elements), config.pretrigger_samples] = (
                config.noise_v * rng.choice((-1, 1)) * tail
            )
        return time_s, gates
