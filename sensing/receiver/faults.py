"""What goes wrong in a channel of the receiver."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, model_validator

from pdpatrol.sensing.array.config import MOST_ELEMENTS
from pdpatrol.sensing.quantities import FaultDecibel, MissionSecond, Volt

FloatArray = NDArray[np.float64]

FaultKind = Literal["dead", "gain_drift", "saturation", "swapped", "stuck"]

STUCK_AT = 0.25
"""Share of full scale that a stuck converter keeps saying (assumed)."""


class ChannelFault(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """One fault of one channel, from `start_s` on.

    `dead`: no signal comes through, its noise does. `gain_drift`: the signal changes by `gain_db`, `ramp_s` long.
    `saturation`: the amplifier gives no more than `level_v`. `swapped`: with channel `other`, as by a plug in the wrong
    socket. `stuck`: the converter says one number for ever.
    """

    channel: int = Field(ge=1, le=MOST_ELEMENTS)
    kind: FaultKind
    start_s: MissionSecond = 0.0
    gain_db: FaultDecibel | None = None
    ramp_s: MissionSecond = 0.0
    level_v: Volt | None = None
    other: int | None = Field(default=None, ge=1, le=MOST_ELEMENTS)

    @model_validator(mode="after")
    def _has_what_its_kind_needs(self) -> ChannelFault:
        needs = {"gain_drift": "gain_db", "saturation": "level_v", "swapped": "other"}
        for kind, key in needs.items():
            given = getattr(self, key) is not None
            if given and self.kind != kind:
                raise ValueError(f"{key}: given for a channel that is {self.kind}; allowed is for {kind}")
            if not given and self.kind == kind:
                raise ValueError(f"{key}: missing; {kind} needs it")
        if self.other == self.channel:
            raise ValueError(f"other: got {self.other}, the channel itself; allowed is another one")
        return self


class Faults:
    """All faults of a receiver.

    Args:
        faults: One for each channel at most.
        n_elements: Channels of the receiver.
    """

    def __init__(self, faults: tuple[ChannelFault, ...], n_elements: int) -> None:
        self.faults = faults
        self.n_elements = n_elements

    def signal_factors(self, time_s: FloatArray) -> FloatArray:
        """What is left of the signal ahead of the noise, shape (*time_s.shape, n_elements)."""
        factors = np.ones((*time_s.shape, self.n_elements))
        for fault in self.faults:
            since_s = time_s - fault.start_s
            if fault.kind == "dead":
                factors[..., fault.channel - 1] = np.where(since_s >= 0, 0.0, 1.0)
            elif fault.kind == "gain_drift" and fault.gain_db is not None:
                share = np.clip(since_s / fault.ramp_s, 0.0, 1.0) if fault.ramp_s > 0 else since_s >= 0
                factors[..., fault.channel - 1] = 10 ** (fault.gain_db * share / 20)
        return factors

    def channels(self, time_s: float, full_scale_v: float) -> tuple[FloatArray, NDArray[np.intp], FloatArray]:
        """`limit_v`, `source` and `stuck_v` of `detection.Channels` at a time."""
        limit_v, stuck_v = np.full(self.n_elements, np.inf), np.full(self.n_elements, np.nan)
        source = np.arange(self.n_elements, dtype=np.intp)
        for fault in self.faults:
            if time_s < fault.start_s:
                continue
            channel = fault.channel - 1
            if fault.kind == "saturation" and fault.level_v is not None:
                limit_v[channel] = fault.level_v
            elif fault.kind == "stuck":
                stuck_v[channel] = STUCK_AT * full_scale_v
            elif fault.kind == "swapped" and fault.other is not None:
                pair = [channel, fault.other - 1]
                source[pair] = source[pair[::-1]]
        return limit_v, source, stuck_v
