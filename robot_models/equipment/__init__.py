"""Equipment of substations: shapes, materials and colours by kind."""

from pdpatrol.robot_models.equipment.catalogue import CATALOGUE, KINDS, CatalogueShape, EquipmentKind, colour_of
from pdpatrol.robot_models.equipment.kinds import Assembly

__all__ = ["CATALOGUE", "KINDS", "Assembly", "CatalogueShape", "EquipmentKind", "colour_of"]
