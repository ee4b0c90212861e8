"""What all parts of a scenario file share."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, Field

Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]


class Config(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """Frozen, strict, closed to unknown keys and to NaN."""
