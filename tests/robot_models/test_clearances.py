"""Distances between solids, and reports of the check of clearances."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dirmusic.arrays import FloatArray
from pdpatrol.robot_models.yard.clearances import clearance_errors, pair_distances
from pdpatrol.robot_models.yard.pieces import BoxEquipment, CatalogueEquipment, CylinderEquipment, placed_solids
from pdpatrol.robot_models.yard.solids import YardSolids
from pdpatrol.robot_models.yard.yard import Yard

place = st.tuples(st.floats(0.0, 6.0), st.floats(0.0, 6.0))
side = st.floats(0.2, 4.0)
box = st.builds(
    lambda where, size, yaw_deg: BoxEquipment(
        name="it", kind="wall", shape="box", position_m=where, footprint_m=size, yaw_deg=yaw_deg, height_m=1.0
    ),
    place,
    st.tuples(side, side),
    st.floats(0.0, 180.0),
)
cylinder = st.builds(
    lambda where, radius_m: CylinderEquipment(
        name="it", kind="wall", shape="cylinder", position_m=where, radius_m=radius_m, height_m=1.0
    ),
    place,
    st.floats(0.1, 2.0),
)


def points_of(solids: YardSolids) -> FloatArray:
    """Return points on the footprint of a single solid, a few centimetres apart, at a middle height."""
    share = np.linspace(-1.0, 1.0, 101)
    x, y = (each.ravel() for each in np.meshgrid(share, share))
    if solids.radius_m[0] > 0.0:
        across_m = 0.5 * (1.0 + x) * solids.radius_m[0]
        own_m = np.stack([across_m * np.cos(np.pi * y), across_m * np.sin(np.pi * y)], axis=-1)
    else:
        own_m = np.stack([x, y], axis=-1) * solids.half_size_m[0]
    cos, sin = np.cos(solids.yaw_rad[0]), np.sin(solids.yaw_rad[0])
    places_m = solids.centre_m[0] + own_m @ np.array([[cos, sin], [-sin, cos]])
    return np.column_stack([places_m, np.full(len(places_m), 0.5)])


@settings(max_examples=200, deadline=None)
@given(one=box | cylinder, other=box | cylinder)
def test_distance_of_two_solids_is_that_of_their_points(
    one: BoxEquipment | CylinderEquipment, other: BoxEquipment | CylinderEquipment
) -> None:
    """Boxes that cross each other like two bars overlap, although each has all corners outside the other."""
    solids, others = placed_solids([one]), placed_solids([other])
    nearest_m = max(float(others.distance(points_of(solids)).min()), 0.0)
    (distance_m,) = pair_distances(solids, others)
    assert distance_m == pytest.approx(nearest_m, abs=0.06)
    assert pair_distances(others, solids)[0] == pytest.approx(distance_m, abs=1e-9)


def test_crossing_tube_is_as_far_away_as_it_is_higher() -> None:
    """A busbar across disconnectors keeps the difference of heights; one that is too low is reported."""
    pieces = [
        CatalogueEquipment(name="bar", kind="busbar", kv=110, position_m=(30.0, 30.0), length_m=19.0),
        CatalogueEquipment(name="qb", kind="disconnector_double_break", kv=110, position_m=(34.5, 30.0)),
    ]
    yard = Yard(size_m=(60.0, 60.0), equipment=tuple(pieces))
    assert clearance_errors(yard, 110) == []
    lines = clearance_errors(Yard(size_m=(60.0, 60.0), equipment=(pieces[0], *_higher(pieces[1]))), 110)
    assert "bar/tube_2, qb/blade_2: are 1.08 m apart, two phases need 1.10 m" in lines


def _higher(piece: CatalogueEquipment) -> tuple[CatalogueEquipment, ...]:
    """Return the same disconnector of 220 kV, whose blades are 1.1 m higher."""
    return (CatalogueEquipment.model_validate({**piece.model_dump(), "kv": 220}),)


def test_fire_wall_must_stand_between() -> None:
    tanks = [
        CatalogueEquipment(name=f"ta{k}", kind="power_transformer", kv=110, position_m=(20.0 + 9.0 * k, 20.0))
        for k in range(2)
    ]
    wall = CatalogueEquipment(name="w", kind="fire_wall", kv=110, position_m=(24.5, 20.0), yaw_deg=90.0)
    aside = CatalogueEquipment(name="w", kind="fire_wall", kv=110, position_m=(24.5, 35.0), yaw_deg=90.0)
    size_m = (50.0, 50.0)
    (line,) = clearance_errors(Yard(size_m=size_m, equipment=tuple(tanks)), 110)
    assert line.startswith("ta0, ta1: are 2.")
    assert line.endswith("need 10.00 m or a fire wall")
    assert clearance_errors(Yard(size_m=size_m, equipment=(*tanks, wall)), 110) == []
    assert clearance_errors(Yard(size_m=size_m, equipment=(*tanks, aside)), 110) == [line]


def test_live_part_near_the_fence_is_reported() -> None:
    for x, is_reported in ((2.4, True), (2.8, False)):
        arrester = CatalogueEquipment(name="fa", kind="surge_arrester", kv=110, position_m=(x, 20.0))
        lines = clearance_errors(Yard(size_m=(40.0, 40.0), equipment=(arrester,)), 110)
        assert bool(lines) == is_reported
