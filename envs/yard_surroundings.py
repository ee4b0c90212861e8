"""What a yard is to radio waves."""

from __future__ import annotations

from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing import Faces, Solids, Surroundings


def surroundings_of(yard: Yard, *, second_order: bool = False) -> Surroundings:
    """Faces and solids of all equipment, each of the material of its kind.

    Args:
        yard: What stands there, or what a map shows.
        second_order: Whether waves count that two walls mirror, one after the other.
    """
    return Surroundings.of_kinds(
        [item.kind for item in yard.equipment],
        Faces(**yard.faces()._asdict()),
        Solids(**yard.obstacles()._asdict()),
    )._replace(by_two_walls=second_order)
