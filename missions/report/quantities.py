"""Numbers of report.json: exact in memory, in the file with as many digits as mean something."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, PlainSerializer


def _decimals(n: int) -> PlainSerializer:
    """Written with n decimals at most; never as minus zero."""
    return PlainSerializer(lambda value: round(value, n) + 0.0, return_type=float, when_used="json")


def significant(value: float) -> float:
    """Four digits that mean something; never minus zero."""
    return float(f"{value:.4g}") + 0.0


FINITE: Any = Field(allow_inf_nan=False)

Metre = Annotated[float, FINITE, _decimals(3)]
Length = Annotated[float, Field(ge=0.0, allow_inf_nan=False), _decimals(3)]
SquareMetre = Annotated[float, FINITE, PlainSerializer(significant, return_type=float, when_used="json")]
Second = Annotated[float, Field(ge=0.0, allow_inf_nan=False), _decimals(2)]
Time = Annotated[float, FINITE, _decimals(2)]
Probability = Annotated[float, Field(ge=0.0, le=1.0), _decimals(3)]
Radian = Annotated[float, FINITE, _decimals(4)]
Degree = Annotated[float, FINITE, _decimals(1)]
Decibel = Annotated[float, FINITE, _decimals(1)]
Rate = Annotated[float, Field(ge=0.0, allow_inf_nan=False), _decimals(2)]
Count = Annotated[int, Field(ge=0)]
Point = tuple[Metre, Metre, Metre]
