"""Radio propagation: settings, and the reflecting and obstructing surfaces of a yard."""

from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing import Surroundings, upright_solids
from pdpatrol.sensing.quantities import Config
from pdpatrol.sensing.radio.materials import GROUNDS, GroundName


class RadioConfig(Config):
    """Settings of the propagation model."""

    second_order: bool = False
    """Also trace waves that are reflected by two walls in turn. They arrive late and weak, and take time to compute.
    Waves that are reflected by the ground and one wall are always traced."""
    ground: GroundName = "gravel"
    """True material of the ground. The robot does not know it: its map, planner
    and Locator do not change with it."""


BELIEVED = RadioConfig()
"""Settings that the robot assumes."""


def surroundings_of(yard: Yard, radio: RadioConfig = BELIEVED) -> Surroundings:
    """Return the faces and solids of all equipment, each with the material of its kind.

    Args:
        yard: True yard, or yard as the map shows it.
        radio: Settings of the propagation model.
    """
    kinds = [item.kind for item in yard.equipment]
    return Surroundings.of_kinds(
        kinds, upright_solids(**vars(yard.solids)), ground=GROUNDS[radio.ground], second_order=radio.second_order
    )
