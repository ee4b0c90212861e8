"""Scenario table of zones with a speed limit."""

from functools import cached_property
from typing import Annotated

from pydantic import Field

from pdpatrol.robot_models.yard.polygon import Polygon, PolygonCorners
from pdpatrol.robot_models.yard.quantities import Name
from pdpatrol.sensing.quantities import Config


class ZoneConfig(Config):
    """Part of the yard in which the robot drives slowly, such as a walkway or a place with loose gravel."""

    name: Name
    """Name of the zone, used once."""
    polygon_m: PolygonCorners
    """Corners in order, world frame; sides must not cross."""
    limit_mps: Annotated[float, Field(ge=0.05, le=10.0)]
    """Highest speed in the zone."""

    @cached_property
    def polygon(self) -> Polygon:
        """The area."""
        return Polygon(self.polygon_m)
