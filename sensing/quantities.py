"""Quantities of configurations: SI units and sensible ranges.

The ranges are wider than those of any receiver, antenna or yard, and narrow enough for arithmetic. All are assumed;
they only refuse mistakes. -0.0 becomes 0.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field

SPEED_OF_LIGHT_MPS = 299_792_458.0

PLAIN_ZERO = AfterValidator(lambda value: value + 0.0)
"""Turns -0.0 into 0, because random generators refuse a standard deviation of -0.0."""

Volt = Annotated[float, Field(ge=1e-9, le=1e3), PLAIN_ZERO]
"""Voltage: from far below thermal noise (14 uV at 50 ohms in 1 GHz) to what destroys a receiver."""

PeakVolt = Annotated[float, Field(ge=1e-9, le=1e4), PLAIN_ZERO]
"""Peak of a pulse 1 m away; 0.27 V is a usual discharge, and no receiver is built for 10 kV."""

Hertz = Annotated[float, Field(ge=1e6, le=1e12), PLAIN_ZERO]
"""Frequency of a wave, from short waves to the beginning of optics."""

SampleRate = Annotated[float, Field(ge=4e9, le=3e11), PLAIN_ZERO]
"""Samples per second; pulses oscillate at 1.75 GHz, and the fastest oscilloscopes take 2.56e11."""

MainsHertz = Annotated[float, Field(ge=10.0, le=1000.0), PLAIN_ZERO]
"""Frequency of the mains; railways have 16.7 Hz, aircraft 400 Hz."""

FalseAlarmRate = Annotated[float, Field(ge=1e-9, le=1e4), PLAIN_ZERO]
"""False alarms per second, from one in thirty years to more than a receiver is useful with."""

EchoSecond = Annotated[float, Field(ge=1e-9, le=2e-6), PLAIN_ZERO]
"""Delay of an echo; 2 us are 600 m, twice the diagonal of the largest yard."""

MissionSecond = Annotated[float, Field(ge=0.0, le=86_400.0), PLAIN_ZERO]
"""Time within the longest mission, a day."""

FaultDecibel = Annotated[float, Field(ge=-60.0, le=60.0), PLAIN_ZERO]

Degree = Annotated[float, Field(ge=-360.0, le=360.0), PLAIN_ZERO]
Elevation = Annotated[float, Field(ge=-90.0, le=90.0), PLAIN_ZERO]
AngleError = Annotated[float, Field(ge=0.0, le=90.0), PLAIN_ZERO]
"""Standard deviation of an angle, degrees; with more, antennas point anywhere."""

Share = Annotated[float, Field(ge=0.0, le=1.0), PLAIN_ZERO]
"""Standard deviation relative to the quantity; with more than 1 a data sheet is useless."""

ArrayMetre = Annotated[float, Field(ge=0.01, le=2.0), PLAIN_ZERO]
"""Dimension of an array that a robot carries; helices do not fit closer than 1 cm."""

ArrayCoordinate = Annotated[float, Field(ge=-2.0, le=2.0), PLAIN_ZERO]
MountingHeight = Annotated[float, Field(gt=0.0, le=5.0), PLAIN_ZERO]
"""Height of an element above the ground."""

PlacementError = Annotated[float, Field(ge=0.0, le=0.1), PLAIN_ZERO]
"""Standard deviation of the position of an element, metres; 10 cm are the radius of a usual array."""

PATH_PATTERN = r"^[^\x00-\x1f\x7f]*$"
FilePath = Annotated[str, Field(max_length=1024, pattern=PATH_PATTERN)]
"""Path of a file, or a name that stands for one: one line of text."""
