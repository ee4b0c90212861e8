"""The receiver: band-pass, noise, trigger level, converter. It decides on its own data what was heard."""

from __future__ import annotations

from functools import cached_property
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, PositiveFloat, PositiveInt, model_validator

from sensing.array import HelicalArray
from sensing.nature.scene import Scene
from sensing.receiver.detections import Detections
from sensing.receiver.faults import ChannelFault, Faults
from sensing.receiver.front_end import front_end

FloatArray = NDArray[np.float64]


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


class Receiver:
    """Turns what radiates into strengths.

    Args:
        config: Receiver settings.
        array: The array as it was really built.

    Attributes:
        front_end: Its band-pass.
        n_elements: How many channels it has.
        faults: Of its channels.
    """

    def __init__(self, config: ReceiverConfig, array: HelicalArray) -> None:
        self.config = config
        self.array = array
        band_hz = None if config.band_hz == "all" else config.band_hz
        self.front_end = front_end(config.sample_rate_hz, band_hz, config.gate_samples)
        self.n_elements = array.boresights_rad.size
        self.faults = Faults(config.faults, self.n_elements)

    @property
    def gate_lead_s(self) -> float:
        """From an arrival to a gate that no noise moves: it starts the pre-trigger before the half peak."""
        return (self.front_end.pulse_lag - self.config.pretrigger_samples) / self.config.sample_rate_hz

    @property
    def step_v(self) -> float:
        """What one count of the converter stands for."""
        return self.config.full_scale_v / (2 ** (self.config.bits - 1) - 1)

    @cached_property
    def noise_variance_v2(self) -> float:
        """Variance of one sample without a pulse: filtered noise, and the converter's rounding (within one count)."""
        rounding = self.step_v**2 / 12 if self.config.fidelity == "waveform" else 0.0
        return self.filtered_v**2 + rounding

    @cached_property
    def filtered_v(self) -> float:
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
        crossings = 4 * self.n_elements * self.config.sample_rate_hz

        def too_often(sigmas: float) -> float:
            rate_hz = crossings * float(owens_t(sigmas, slope))
            return float(np.log(max(rate_hz, 1e-300) / self.config.false_alarm_rate_hz))

        return self.filtered_v * float(brentq(too_often, 0.0, 30.0))  # pyright: ignore[reportArgumentType]

    def listen(
        self,
        world_from_array: FloatArray,
        scene: Scene,
        rng: np.random.Generator,
        *,
        start_s: float,
        duration_s: float,
    ) -> Detections:
        """Listen from one pose for `duration_s` from `start_s` on.

        Args:
            world_from_array: Where the array really is, shape (4, 4).
            scene: All that radiates, and what stands about.
            rng: All randomness.
            start_s: Simulated time at the start of the interval.
            duration_s: Length of the interval.
        """
        from sensing.receiver.bank import Receivers  # here, so that a command line help need not wait for the compiler

        one = Receivers(self.config, [self.array], [scene], [rng], [rng])
        return one.listen(world_from_array[np.newaxis], np.array([start_s]), duration_s)

    def false_gate(self, rng: np.random.Generator) -> FloatArray:
        """What a gate holds that noise alone triggered, shape (n_elements, gate_samples).

        One sample of one channel lies in the tail beyond the threshold, and its channel follows it as its correlation
        says; all other channels are as ever.
        """
        from scipy.special import ndtr, ndtri

        config, front_end = self.config, self.front_end
        gate = (
            self.filtered_v
            / np.sqrt(front_end.noise_power)
            * front_end.noise(rng, (self.n_elements, config.gate_samples))
        )
        at, channel = config.pretrigger_samples, int(rng.integers(self.n_elements))
        tail = -ndtri((1.0 - rng.random()) * ndtr(-self.threshold_v / self.filtered_v))
        crossing = float(rng.choice((-1.0, 1.0))) * tail * self.filtered_v
        follows = front_end.correlation[np.abs(np.arange(config.gate_samples) - at)]
        gate[channel] += (crossing - gate[channel, at]) * follows
        return gate
