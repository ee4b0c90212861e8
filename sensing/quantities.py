"""Quantities of settings: SI units, and what they may sensibly be. -0.0 is 0, and nothing is infinite.

A bound is wide of what any receiver, antenna or yard has, and short of where arithmetic ends. All are assumed.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field


def _without_sign_of_zero(value: float) -> float:
    return value + 0.0


PLAIN_ZERO = AfterValidator(_without_sign_of_zero)
"""-0.0 is 0: a standard deviation of -0.0 is none, but a generator refuses it."""

Volt = Annotated[float, Field(ge=1e-9, le=1e3), PLAIN_ZERO]
"""From far below thermal noise (a microvolt in 1 GHz at 50 ohms is 9 dB above it) to what burns a receiver."""

PeakVolt = Annotated[float, Field(ge=1e-9, le=1e4), PLAIN_ZERO]
"""Of a pulse 1 m away: 0.27 V is a usual discharge here, 10 kV no longer one that the receiver is built for."""

Hertz = Annotated[float, Field(ge=1e6, le=1e12), PLAIN_ZERO]
"""Of a wave, from short waves to where optics begins."""

SampleRate = Annotated[float, Field(ge=4e9, le=3e11), PLAIN_ZERO]
"""Pulses oscillate at 1.75 GHz: less than 3.5e9 samples per second tell nothing of them. The fastest oscilloscopes
take 2.56e11."""

MainsHertz = Annotated[float, Field(ge=10.0, le=1000.0), PLAIN_ZERO]
"""Railways have 16.7, aircraft 400."""

FalseAlarmRate = Annotated[float, Field(ge=1e-9, le=1e4), PLAIN_ZERO]
"""From once in thirty years to more than a receiver could be used with."""

EchoSecond = Annotated[float, Field(ge=1e-9, le=2e-6), PLAIN_ZERO]
"""2 us are 600 m of detour: twice the diagonal of the largest yard."""

MissionSecond = Annotated[float, Field(ge=0.0, le=86_400.0), PLAIN_ZERO]
"""Within the longest mission, a day."""

FaultDecibel = Annotated[float, Field(ge=-60.0, le=60.0), PLAIN_ZERO]

Degree = Annotated[float, Field(ge=-360.0, le=360.0), PLAIN_ZERO]
Elevation = Annotated[float, Field(ge=-90.0, le=90.0), PLAIN_ZERO]
AngleError = Annotated[float, Field(ge=0.0, le=90.0), PLAIN_ZERO]
"""Standard deviation, degrees: with more, antennas point anywhere."""

Share = Annotated[float, Field(ge=0.0, le=1.0), PLAIN_ZERO]
"""Standard deviation over what it is one of: with more than 1 the data sheet says nothing."""

ArrayMetre = Annotated[float, Field(ge=0.01, le=2.0), PLAIN_ZERO]
"""Of an array that a robot carries; closer than 1 cm no two helices fit."""

ArrayCoordinate = Annotated[float, Field(ge=-2.0, le=2.0), PLAIN_ZERO]
MountingHeight = Annotated[float, Field(ge=-2.0, le=5.0), PLAIN_ZERO]
"""Of an element; that it is above the ground is said by a check of its own."""

PlacementError = Annotated[float, Field(ge=0.0, le=0.1), PLAIN_ZERO]
"""Standard deviation of where an element sits, metres: 10 cm are the radius of a usual array."""

PATH_PATTERN = r"^[^\x00-\x1f\x7f]*$"
FilePath = Annotated[str, Field(max_length=1024, pattern=PATH_PATTERN)]
"""Path of a file, or a name that stands for one: one line of text."""
