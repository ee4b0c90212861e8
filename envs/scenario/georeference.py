"""Where on Earth a yard lies, for exports to maps; nothing in a mission depends on it."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from envs.scenario.base import Config


class GeoreferenceConfig(Config, frozen=True):
    """The yard's frame on the WGS 84 ellipsoid.

    Attributes:
        latitude_deg: Of the yard's origin, its south-west corner; below 85 degrees, where the meridians do not yet
            converge within a yard.
        longitude_deg: Of the same, east positive.
        heading_deg: Of the yard's y axis, clockwise from true north: 0 where the yard lies as its map says.
    """

    latitude_deg: Annotated[float, Field(ge=-85.0, le=85.0)]
    longitude_deg: Annotated[float, Field(ge=-180.0, le=180.0)]
    heading_deg: Annotated[float, Field(ge=-360.0, le=360.0)] = 0.0
