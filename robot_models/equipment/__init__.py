"""Equipment of substations: shapes and colours by kind."""

from pdpatrol.robot_models.equipment.catalogue import CATALOGUE, KIND_COLOURS, colour_of
from pdpatrol.robot_models.equipment.kinds import Assembly

__all__ = ["CATALOGUE", "KIND_COLOURS", "Assembly", "colour_of"]
