"""Bounded quantities for configurations, in SI units.

The ranges are wider than those of any real receiver, antenna or yard, and narrow enough to avoid numerical overflow.
All are assumed; they only serve to reject mistakes.
"""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field


class Config(BaseModel):
    """Base class of all configurations: frozen and strict; rejects unknown keys, infinity and NaN."""

    model_config = ConfigDict(frozen=True, strict=True, extra="forbid", allow_inf_nan=False)


SPEED_OF_LIGHT_MPS = 299_792_458.0

Volt = Annotated[float, Field(ge=1e-9, le=1e3)]
"""Voltage, from far below thermal noise (14 uV at 50 ohms in 1 GHz) to a level that destroys a receiver."""

PeakVolt = Annotated[float, Field(ge=1e-9, le=1e4)]
"""Peak of a pulse 1 m from its source; 0.27 V is typical of a discharge, and no receiver is built for 10 kV."""

Hertz = Annotated[float, Field(ge=1e6, le=1e12)]
"""Frequency of a wave, from medium-wave radio to the far infrared."""

SampleRate = Annotated[float, Field(ge=4e9, le=3e11)]
"""Samples per second; pulses oscillate at 1.75 GHz, and the fastest oscilloscopes take 2.56e11 samples per second."""

MainsHertz = Annotated[float, Field(ge=10.0, le=1000.0)]
"""Mains frequency; railways use 16.7 Hz, aircraft 400 Hz."""

FalseAlarmRate = Annotated[float, Field(ge=1e-9, le=1e4)]
"""False alarms per second, from one in thirty years to more than any usable receiver has."""

EchoSecond = Annotated[float, Field(ge=1e-9, le=2e-6)]
"""Excess delay of multipath; 2 us correspond to 600 m, twice the diagonal of the largest yard."""

MissionSecond = Annotated[float, Field(ge=0.0, le=86_400.0)]
"""Time within a mission, which lasts at most a day."""

FaultDecibel = Annotated[float, Field(ge=-60.0, le=60.0)]

Degree = Annotated[float, Field(ge=-360.0, le=360.0)]
Elevation = Annotated[float, Field(ge=-90.0, le=90.0)]
AngleError = Annotated[float, Field(ge=0.0, le=90.0)]
"""Standard deviation of an angle, degrees; beyond 90 degrees, antennas would point in any direction."""

Share = Annotated[float, Field(ge=0.0, le=1.0)]
"""Standard deviation relative to the quantity itself; above 1, a data sheet would be useless."""

ArrayMetre = Annotated[float, Field(ge=0.01, le=2.0)]
"""Dimension of an array that a robot carries; helices do not fit into less than 1 cm."""

ArrayCoordinate = Annotated[float, Field(ge=-2.0, le=2.0)]
MountingHeight = Annotated[float, Field(gt=0.0, le=5.0)]
"""Height of an element above the ground."""

PlacementError = Annotated[float, Field(ge=0.0, le=0.1)]
"""Standard deviation of the position of an element, metres; 10 cm is the radius of a typical array."""

PATH_PATTERN = r"^[^\x00-\x1f\x7f]*$"
FilePath = Annotated[str, Field(max_length=1024, pattern=PATH_PATTERN)]
"""Path of a file, or the name of a shipped one: one line of text."""
