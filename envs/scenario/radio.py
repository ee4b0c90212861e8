"""Radio propagation: settings, and the reflecting and obstructing surfaces of a yard."""

from __future__ import annotations

from pdpatrol.envs.scenario.base import Config
from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing import Surroundings, upright_solids


class RadioConfig(Config):
    """Settings of the propagation model."""

    second_order: bool = False
    """Also trace waves that are reflected by two walls in turn. They arrive late and weak, and take time to compute.
    Waves that are reflected by the ground and one wall are always traced."""


def surroundings_of(yard: Yard, *, second_order: bool = False) -> Surroundings:
    """Return the faces and solids of all equipment, each with the material of its kind.

    Args:
        yard: True yard, or yard as the map shows it.
        second_order: Whether to trace waves that are reflected by two walls in turn.
    """
    kinds = [item.kind for item in yard.equipment]
    return Surroundings.of_kinds(kinds, upright_solids(**vars(yard.solids)), second_order=second_order)
