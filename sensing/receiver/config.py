"""Settings of the receiver."""

from __future__ import annotations

from math import ceil
from typing import Annotated, Literal, Self

from pydantic import BaseModel, Discriminator, Field, Tag, model_validator

from pdpatrol.sensing.array.config import MOST_ELEMENTS
from pdpatrol.sensing.nature.pulse_shape import DECAY_S
from pdpatrol.sensing.quantities import EchoSecond, FalseAlarmRate, Hertz, MainsHertz, SampleRate, Volt
from pdpatrol.sensing.receiver.faults import ChannelFault

NARROWEST = 1e-3
"""Of the sampling rate: how wide a band is at least, and how far from 0 and from half the rate it ends. What is
narrower rings for longer than ten thousand samples."""

LONGEST_DIVIDED_GATE = 1000
"""Samples of a gate that is read in sub-bands: what they share of the noise takes a decomposition of a matrix of so
many rows, 2 s for this and a minute for four times as many."""


def _is_word(value: object) -> str:
    return "[word]" if isinstance(value, str) else "[given]"


Band = Annotated[
    Annotated[tuple[Hertz, Hertz], Tag("[given]")] | Annotated[Literal["all"], Tag("[word]")],
    Discriminator(_is_word),
]
"""From and to, or "all" without a band-pass."""


class ReceiverConfig(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """A channel for each element and a common trigger. The defaults are assumed, about those of a fast oscilloscope.

    Once a channel has crossed the threshold, the gate starts `pretrigger_samples` before the loudest one comes to half
    its peak: the crossing itself comes the earlier the louder the pulse.

    A signal that is still there long after any echo can be is a burst, and is rejected.
    """

    sample_rate_hz: SampleRate = 20e9
    band_hz: Band = (1.4e9, 2.2e9)
    """Where the band-pass is 3 dB down. The default holds the energy of the pulses, mainly 1.5 to 2 GHz, and is 54 dB
    down at the 948 MHz of the Dir-MUSIC paper's interferer; "all" leaves the noise white."""
    noise_v: Volt = 1e-3
    """Standard deviation of a sample of white noise, before the band-pass."""
    pretrigger_samples: int = Field(default=20, ge=1, le=10_000)
    gate_samples: int = Field(default=90, ge=1, le=10_000)
    longest_echo_s: EchoSecond = 60e-9
    """How long after a pulse its last echo may come: 18 m of detour. What lasts three times as long is a burst."""
    false_alarm_rate_hz: FalseAlarmRate = 0.1
    mains_hz: MainsHertz = 50.0
    bits: int = Field(default=12, ge=2, le=24)
    full_scale_v: Volt = 0.5
    """Largest voltage that the converter can represent, of either sign; beyond it a pulse is clipped, and flagged. With
    the defaults one count is 0.86 of the noise behind the band-pass; where it is more than two, rounding is not
    noise."""
    n_bands: int = Field(default=0, ge=0, le=8)
    """Sub-bands of one width in which strengths are read as well, for the estimator `sub_bands`. They share their noise
    where they are narrower than the sampling rate over the gate's length, 222 MHz with the defaults."""
    faults: tuple[ChannelFault, ...] = Field(default=(), max_length=MOST_ELEMENTS)

    @property
    def band_edges_hz(self) -> tuple[float, ...]:
        """Of the sub-bands, n_bands + 1 of them; none where none are read."""
        if self.n_bands == 0 or self.band_hz == "all":
            return ()
        low_hz, high_hz = self.band_hz
        return tuple(low_hz + (high_hz - low_hz) * k / self.n_bands for k in range(self.n_bands + 1))

    @model_validator(mode="after")
    def _sub_bands_are_parts_of_a_band(self) -> Self:
        if self.n_bands > 0 and self.band_hz == "all":
            raise ValueError(
                f'n_bands: got {self.n_bands} with band_hz = "all"; allowed is 0, or a band that they divide'
            )
        if self.n_bands > 0 and self.gate_samples > LONGEST_DIVIDED_GATE:
            raise ValueError(
                f"gate_samples: got {self.gate_samples} with n_bands {self.n_bands}; allowed are at most "
                f"{LONGEST_DIVIDED_GATE} where sub-bands are read"
            )
        return self

    @model_validator(mode="after")
    def _gate_reaches_beyond_the_trigger(self) -> Self:
        if self.pretrigger_samples >= self.gate_samples:
            raise ValueError(
                f"pretrigger_samples: got {self.pretrigger_samples}; allowed is less than gate_samples, "
                f"{self.gate_samples}, or the gate ends before the pulse begins"
            )
        after_s = (self.gate_samples - self.pretrigger_samples) / self.sample_rate_hz
        if after_s < DECAY_S:
            least = self.pretrigger_samples + ceil(DECAY_S * self.sample_rate_hz)
            raise ValueError(
                f"gate_samples: got {self.gate_samples}, which ends {after_s:.2g} s after the trigger; allowed is "
                f"{least} or more at this sample_rate_hz and pretrigger_samples, for a pulse decays in {DECAY_S:g} s"
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
        least_hz = NARROWEST * self.sample_rate_hz
        if self.band_hz != "all":
            low_hz, high_hz = self.band_hz
            if min(low_hz, high_hz - low_hz, nyquist_hz - high_hz) < least_hz:
                raise ValueError(
                    f"band_hz: got ({low_hz:g}, {high_hz:g}); allowed is a band at least {least_hz:g} wide and as far "
                    f"from 0 and {nyquist_hz:g}, {NARROWEST:g} of sample_rate_hz, or the filter rings for too long"
                )
        return self
