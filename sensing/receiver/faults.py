"""True receiver, where it differs from the assumed one: channel faults, drift, and the mains frequency."""

from collections.abc import Sequence
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from dirmusic.arrays import FloatArray
from pdpatrol.sensing.array.helical_array import MOST_ELEMENTS
from pdpatrol.sensing.quantities import Config, FaultDecibel, MissionSecond, Volt
from pdpatrol.sensing.receiver.sampling import Channels

KEYS_OF_KIND = {
    "gain_drift": ("gain_db",),
    "intermittent": ("gain_db", "bad_s", "good_s"),
    "saturation": ("level_v",),
    "swapped": ("other",),
}
"""Keys that some kinds of faults need."""

Drift = Annotated[float, Field(ge=-20.0, le=20.0)]
"""Drift of a gain, decibels per minute."""

Duration = Annotated[float, Field(ge=0.1, le=86_400.0)]
"""Duration of one state, not shorter than a control step."""


class ChannelFault(Config):
    """Fault of one channel, from `start_s` on. A channel may have several.

    `dead`: the signal is lost, but the noise remains. `gain_drift`: the gain changes by `gain_db` within `ramp_s`.
    `intermittent`: a loose contact; the gain changes by `gain_db` for `bad_s`, is restored for `good_s`, and so on.
    `saturation`: the output of the amplifier is limited to `level_v`. `swapped`: the plugs of this channel and of
    channel `other` are swapped. `stuck`: the output of the ADC is constant.
    """

    channel: int = Field(ge=1, le=MOST_ELEMENTS)
    """Number of the channel, from 1."""
    kind: Literal["dead", "gain_drift", "intermittent", "saturation", "swapped", "stuck"]
    """Kind of fault."""
    start_s: MissionSecond = 0.0
    """Time at which the fault begins."""
    gain_db: FaultDecibel | None = None
    """Change of the gain, for `gain_drift` and `intermittent`."""
    ramp_s: MissionSecond = 0.0
    """Time in which the gain changes, for `gain_drift`."""
    bad_s: Duration | None = None
    """Duration of the changed gain, for `intermittent`."""
    good_s: Duration | None = None
    """Duration of the normal gain between, for `intermittent`."""
    level_v: Volt | None = None
    """Largest output of the amplifier, of either sign, for `saturation`."""
    other: int | None = Field(default=None, ge=1, le=MOST_ELEMENTS)
    """Channel with which this one is exchanged, for `swapped`."""

    @model_validator(mode="after")
    def _check_keys_of_kind(self) -> Self:
        for key in dict.fromkeys(key for keys in KEYS_OF_KIND.values() for key in keys):
            kinds = [kind for kind, keys in KEYS_OF_KIND.items() if key in keys]
            is_given = getattr(self, key) is not None
            if is_given and self.kind not in kinds:
                raise ValueError(f"{key}: must be given for kind {' or '.join(kinds)} only, got kind {self.kind}")
            if not is_given and self.kind in kinds:
                raise ValueError(f"{key}: must be given for kind {self.kind}")
        if self.other == self.channel:
            raise ValueError(f"other: must be another channel, got {self.other}")
        return self

    def gain_factor(self, time_s: float) -> float:
        """Return the factor by which the fault scales the signal, before noise, at a given time."""
        since_s = time_s - self.start_s
        if since_s < 0.0:
            return 1.0
        if self.kind == "dead":
            return 0.0
        share = 0.0
        if self.kind == "gain_drift":
            share = min(since_s / self.ramp_s, 1.0) if self.ramp_s > 0 else 1.0
        elif self.bad_s is not None and self.good_s is not None:
            share = float(since_s % (self.bad_s + self.good_s) < self.bad_s)
        return 10 ** ((self.gain_db or 0.0) * share / 20)


class TrueReceiverConfig(Config):
    """True receiver, where it differs from the believed one."""

    faults: tuple[ChannelFault, ...] = Field(default=(), max_length=2 * MOST_ELEMENTS)
    """Faults of single channels."""
    temperature_drift_db_per_min: Drift = 0.0
    """Drift of the gain that all channels share, as of amplifiers that warm up. It scales signals and not the noise."""
    temperature_spread_db_per_min: Annotated[float, Field(ge=0.0, le=20.0)] = 0.0
    """Standard deviation of the additional drift of each channel, drawn once per mission."""
    mains_offset_hz: Annotated[float, Field(ge=-5.0, le=5.0)] = 0.0
    """True mains frequency minus `receiver.mains_hz`, to which the receiver relates pulses. Phases drift by 360 degrees
    times this per second. Public grids stay within 0.05 Hz most of the time."""

    def draw_drift(self, n_elements: int, rng: np.random.Generator) -> FloatArray | None:
        """Draw the drift of each channel in dB per minute, shape (n_elements,); None without drift."""
        common, spread = self.temperature_drift_db_per_min, self.temperature_spread_db_per_min
        return common + spread * rng.standard_normal(n_elements) if common or spread else None


def signal_factors(
    faults: Sequence[ChannelFault], drift_db_per_min: FloatArray | None, n_elements: int, time_s: float
) -> FloatArray:
    """Return the factors by which faults and drift scale the signals, before noise, at a time, shape (n_elements,)."""
    factors = np.ones(n_elements)
    if drift_db_per_min is not None:
        factors = 10 ** (drift_db_per_min * time_s / 1200.0)
    for fault in faults:
        factors[fault.channel - 1] *= fault.gain_factor(time_s)
    return factors


def add_faults(channels: Channels, faults: Sequence[ChannelFault], time_s: float, stuck_v: float) -> None:
    """Add the faults that have begun to the state of the channels.

    Args:
        channels: State of the channels; updated.
        faults: All faults. Of several swaps, each one swaps the plugs as the earlier ones left them.
        time_s: Simulated time.
        stuck_v: Voltage of a stuck channel.
    """
    for fault in faults:
        channel = fault.channel - 1
        if time_s < fault.start_s:
            continue
        if fault.kind == "saturation" and fault.level_v is not None:
            channels.limit_v[channel] = min(channels.limit_v[channel], fault.level_v)
        elif fault.kind == "stuck":
            channels.stuck_v[channel] = stuck_v
        elif fault.kind == "swapped" and fault.other is not None:
            pair = [channel, fault.other - 1]
            channels.source[pair] = channels.source[pair[::-1]]
