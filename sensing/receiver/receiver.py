"""The receiver: noise, trigger level, gate and converter, as they follow from its settings; and who has one."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sensing.array.helical_array import HelicalArray
from sensing.nature.scene import Scene
from sensing.receiver.config import ReceiverConfig
from sensing.receiver.faults import Faults
from sensing.receiver.front_end import front_end
from sensing.receiver.trigger import threshold_over_noise


@dataclass(frozen=True, kw_only=True)
class Listener:
    """What is a robot's own where several with the same receiver listen.

    Attributes:
        array: The array as it was really built.
        scene: All that radiates, and what stands about.
        nature_rng: When the sources discharge, and how strongly.
        receiver_rng: Noise and triggers.
    """

    array: HelicalArray
    scene: Scene
    nature_rng: np.random.Generator
    receiver_rng: np.random.Generator


class Receiver:
    """One make of receiver: what follows from its settings.

    Args:
        config: The settings.
        n_elements: How many channels it has.

    Attributes:
        config: As given.
        n_elements: As given.
        front_end: The band-pass.
        faults: Faults of the channels.
    """

    def __init__(self, config: ReceiverConfig, n_elements: int) -> None:
        self.config = config
        self.n_elements = n_elements
        band_hz = None if config.band_hz == "all" else config.band_hz
        self.front_end = front_end(config.sample_rate_hz, band_hz, config.gate_samples)
        self.faults = Faults(config.faults, n_elements)

    @property
    def gate_lead_s(self) -> float:
        """From an arrival to a gate that no noise moves: it starts the pre-trigger before the half peak."""
        return (self.front_end.pulse_lag - self.config.pretrigger_samples) / self.config.sample_rate_hz

    @property
    def step_v(self) -> float:
        """What one count of the converter stands for."""
        return self.config.full_scale_v / (2 ** (self.config.bits - 1) - 1)

    @cached_property
    def filtered_noise_v(self) -> float:
        """Standard deviation of the noise behind the band-pass."""
        return self.config.noise_v * float(np.sqrt(self.front_end.noise_power))

    @cached_property
    def noise_variance_v2(self) -> float:
        """Variance of one sample without a pulse: filtered noise, and the converter's rounding (within one count)."""
        rounding = self.step_v**2 / 12 if self.config.fidelity == "waveform" else 0.0
        return self.filtered_noise_v**2 + rounding

    @cached_property
    def threshold_v(self) -> float:
        """Trigger level that noise alone crosses `false_alarm_rate_hz` times a second in all channels together."""
        config = self.config
        correlation = float(self.front_end.correlation[1]) if config.gate_samples > 1 else 0.0
        samples_hz = self.n_elements * config.sample_rate_hz
        return self.filtered_noise_v * threshold_over_noise(config.false_alarm_rate_hz, samples_hz, correlation)
