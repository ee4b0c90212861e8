"""What stands in a substation, one file a kind."""

from pdpatrol.robot_models.equipment.assembly import Assembly, Kind, Shape
from pdpatrol.robot_models.equipment.catalogue import CATALOGUE, KINDS, colour_of

__all__ = ["CATALOGUE", "KINDS", "Assembly", "Kind", "Shape", "colour_of"]
