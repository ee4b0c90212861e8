"""Configuration of the receiver."""

from math import ceil
from typing import Annotated, Literal, Self

from pydantic import Discriminator, Field, Tag, model_validator

from pdpatrol.sensing.nature.pulses import DECAY_S
from pdpatrol.sensing.quantities import (
    Config,
    EchoSecond,
    FalseAlarmRate,
    Hertz,
    MainsHertz,
    SampleRate,
    Volt,
)

NARROWEST = 1e-3
"""Smallest width of the band, and smallest distance of its edges from 0 and half the sampling rate, as a fraction of
the sampling rate. A narrower filter rings for more than ten thousand samples."""

LONGEST_DIVIDED_GATE = 1000
"""Largest number of samples of a gate with sub-bands. Their noise requires the decomposition of a square matrix of this
size, which takes 2 s; four times this size takes a minute."""

Band = Annotated[
    Annotated[tuple[Hertz, Hertz], Tag("[given]")] | Annotated[Literal["all"], Tag("[word]")],
    Discriminator(lambda value: "[word]" if isinstance(value, str) else "[given]"),
]
"""Lower and upper edge of the band, or "all" for no band-pass filter."""


class ReceiverConfig(Config):
    """Receiver with a channel for each element and a common trigger, as the robot believes it.

    The defaults are assumed, close to those of a fast oscilloscope. When a channel crosses the threshold, the gate
    starts `pretrigger_samples` before the strongest channel reaches half its peak. A signal that lasts longer than any
    multipath is a burst and is rejected.
    """

    sample_rate_hz: SampleRate = 20e9
    """Samples per second of each channel."""
    band_hz: Band = (1.4e9, 2.2e9)
    """Edges of the band-pass filter, where its loss is 3 dB. The default passes the energy of the pulses, mainly at 1.5
    to 2 GHz, and attenuates the 948 MHz interferer of the Dir-MUSIC paper by 54 dB. With "all" the noise stays white.
    """
    noise_v: Volt = 1e-3
    """Standard deviation of a sample of white noise, before the band-pass filter."""
    pretrigger_samples: int = Field(default=20, ge=1, le=10_000)
    """Samples of the gate before the strongest channel reaches half its peak."""
    gate_samples: int = Field(default=90, ge=1, le=10_000)
    """Length of the gate from which the strength of a pulse is computed."""
    longest_echo_s: EchoSecond = 60e-9
    """Largest delay of multipath; the default is a detour of 18 m. A signal three times as long is a burst."""
    false_alarm_rate_hz: FalseAlarmRate = 0.1
    """False alarms per second due to noise; it sets the threshold of the trigger."""
    mains_hz: MainsHertz = 50.0
    """Mains frequency to which the phases of pulses are related."""
    bits: int = Field(default=12, ge=2, le=24)
    """Resolution of the ADC."""
    full_scale_v: Volt = 0.5
    """Largest voltage of the ADC, of either sign; larger pulses are clipped and flagged. With the defaults one count is
    0.86 standard deviations of the noise after the band-pass filter. Above two, rounding errors no longer act like
    noise."""
    n_bands: int = Field(default=0, ge=0, le=8)
    """Number of sub-bands of equal width in which strengths are also read, for the estimator `sub_bands`. Their noise
    is correlated if they are narrower than the sampling rate divided by the number of samples of the gate, 222 MHz with
    the defaults."""

    @property
    def band_edges_hz(self) -> tuple[float, ...]:
        """Edges of the sub-bands, n_bands + 1 values; empty if no sub-bands are read."""
        if self.n_bands == 0 or self.band_hz == "all":
            return ()
        low_hz, high_hz = self.band_hz
        return tuple(low_hz + (high_hz - low_hz) * k / self.n_bands for k in range(self.n_bands + 1))

    @model_validator(mode="after")
    def _check_consistency(self) -> Self:
        if self.n_bands > 0 and self.band_hz == "all":
            raise ValueError(f'n_bands: must be 0 with band_hz = "all", got {self.n_bands}')
        if self.n_bands > 0 and self.gate_samples > LONGEST_DIVIDED_GATE:
            raise ValueError(
                f"gate_samples: must be at most {LONGEST_DIVIDED_GATE} if sub-bands are read, got {self.gate_samples} "
                f"with n_bands {self.n_bands}"
            )
        if self.pretrigger_samples >= self.gate_samples:
            raise ValueError(
                f"pretrigger_samples: must be less than gate_samples {self.gate_samples}, got {self.pretrigger_samples}"
            )
        after_s = (self.gate_samples - self.pretrigger_samples) / self.sample_rate_hz
        if after_s < DECAY_S:
            least = self.pretrigger_samples + ceil(DECAY_S * self.sample_rate_hz)
            raise ValueError(
                f"gate_samples: must be {least} or more at this sample_rate_hz and pretrigger_samples, because a pulse "
                f"decays in {DECAY_S:g} s, got {self.gate_samples}, which ends {after_s:.2g} s after the trigger"
            )
        if self.band_hz != "all":
            (low_hz, high_hz), nyquist_hz = self.band_hz, 0.5 * self.sample_rate_hz
            least_hz = NARROWEST * self.sample_rate_hz
            if min(low_hz, high_hz - low_hz, nyquist_hz - high_hz) < least_hz:
                raise ValueError(
                    f"band_hz: must be a rising band between 0 and half of sample_rate_hz ({nyquist_hz:g}), at least "
                    f'{least_hz:g} wide and as far from both ends, or "all", got ({low_hz:g}, {high_hz:g})'
                )
        return self
