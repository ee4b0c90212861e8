"""What stands in a substation, one file a kind."""

from robot_models.equipment.assembly import Assembly, Kind
from robot_models.equipment.catalogue import CATALOGUE

__all__ = ["CATALOGUE", "Assembly", "Kind"]
