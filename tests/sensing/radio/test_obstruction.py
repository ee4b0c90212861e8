"""What straight lines cross: solids of a yard, against their own formulas and against MuJoCo's rays."""
# pyright: reportAttributeAccessIssue=false

from collections.abc import Callable
from functools import partial

import mujoco
import numpy as np
import pytest

from envs.random_yard import random_yard
from robot_models.description.library import load_robot
from robot_models.world import build_spec
from robot_models.yard.line_of_sight import is_clear
from robot_models.yard.pieces import BoxEquipment, CylinderEquipment
from robot_models.yard.yard import Yard
from sensing import Solids
from tests.sensing.radio.crossing import cross, solids_of


def crossed_in(yard: Yard) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    return partial(cross, solids=solids_of(yard), n_pieces=len(yard.equipment))


TANK = BoxEquipment(
    name="tank", kind="power_transformer", shape="box", position_m=(20.0, 10.0), footprint_m=(2.0, 4.0), height_m=3.0
)
BUSHING = CylinderEquipment(
    name="bushing", kind="bushing", shape="cylinder", position_m=(10.0, 20.0), radius_m=0.3, height_m=2.5
)
TANK_AND_BUSHING = crossed_in(Yard(size_m=(30.0, 30.0), equipment=(TANK, BUSHING)))


def line(*points: float) -> np.ndarray:
    return np.array([points])


@pytest.mark.parametrize(
    ("start", "expected"),
    [
        ((15.0, 10.0, 1.0), [True, False]),  # behind the tank
        ((25.0, 10.0, 1.0), [False, False]),  # on the source's own side
        ((15.0, 10.0, 14.0), [False, False]),  # over the top: at the tank's far edge the line is still above 3 m
        ((21.02, 10.0, 1.5), [False, False]),  # at the source itself
    ],
)
def test_equipment_in_between_is_crossed_whichever_way_one_looks(
    start: tuple[float, float, float], expected: list[bool]
) -> None:
    source = line(21.02, 10.0, 1.5 if start[2] < 5 else 3.02)
    assert TANK_AND_BUSHING(source, line(*start)).tolist() == [expected]
    assert TANK_AND_BUSHING(line(*start), source).tolist() == [expected]


def test_all_pieces_along_a_line_are_crossed_not_the_first_alone() -> None:
    ends = np.array([[25.0, 5.0, 1.0], [15.0, 15.0, 1.0], [8.0, 22.0, 1.0]])  # behind both, behind the bushing, neither
    assert TANK_AND_BUSHING(np.tile([5.0, 25.0, 1.0], (3, 1)), ends).tolist() == [
        [True, True],
        [False, True],
        [False, False],
    ]


def test_a_line_that_ends_on_a_face_does_not_cross_it_and_one_along_it_neither() -> None:
    assert not TANK_AND_BUSHING(line(5.0, 10.0, 1.0), line(19.0, 10.0, 1.0)).any()
    assert not TANK_AND_BUSHING(line(19.0, 5.0, 1.0), line(19.0, 15.0, 1.0)).any()
    assert TANK_AND_BUSHING(line(5.0, 10.0, 1.0), line(21.0, 10.0, 1.0)).tolist() == [[True, False]]


def test_straight_up_through_a_bushing_is_through_it_and_beside_it_is_not() -> None:
    assert TANK_AND_BUSHING(line(10.1, 20.0, 0.1), line(10.1, 20.0, 5.0)).tolist() == [[False, True]]
    assert not TANK_AND_BUSHING(line(10.4, 20.0, 0.1), line(10.4, 20.0, 5.0)).any()


@pytest.mark.parametrize("seed", range(4))
def test_what_a_line_crosses_is_what_the_rays_of_mujoco_meet(seed: int) -> None:
    """The same solids, built by another hand: every piece along each line, in yards of the catalogue."""
    yard, rng = random_yard(seed, 8).yard, np.random.default_rng(seed)
    model = build_spec(load_robot("inspector"), yard).compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    starts, ends = (rng.uniform(0.0, [*yard.size_m, 6.0], (400, 3)) for _ in range(2))
    outside = yard.solids.distance(starts).min(axis=-1) > 0.01
    starts, ends = starts[outside], ends[outside]
    crossed, groups = crossed_in(yard)(starts, ends), np.array([0, 1, 0, 0, 0, 0], dtype=np.uint8)
    names, met = [item.name for item in yard.equipment], np.zeros(1, dtype=np.int32)
    for start, end, row in zip(starts, ends, crossed, strict=True):
        seen, share = set[str](), 0.0
        while True:
            at = start + share * (end - start)
            further = mujoco.mj_ray(model, data, at, end - start, groups, True, -1, met, None)
            share += further + 1e-7
            if further < 0 or share >= 1.0:
                break
            seen.add(model.geom(int(met[0])).name.split("/")[1])
        assert seen == {name for name, is_crossed in zip(names, row, strict=True) if is_crossed}
    assert crossed.sum() > 40


@pytest.mark.parametrize("seed", range(4))
def test_level_lines_cross_the_same_solids_for_radio_and_for_driving(seed: int) -> None:
    """The two spellings of one geometry: `crosses` in three dimensions, `is_clear` over footprints."""
    solids, rng = random_yard(seed, 8).yard.solids, np.random.default_rng(seed)
    n_solids = solids.radius_m.size
    single = Solids(
        solids.centre_m,
        solids.yaw_rad,
        solids.half_size_m,
        solids.radius_m,
        np.zeros(n_solids),
        np.full(n_solids, 2.0),
        np.arange(n_solids),
    )
    starts, ends = rng.uniform(0.0, 40.0, (2000, 2)), rng.uniform(0.0, 40.0, (12, 2))
    n_met = np.zeros(n_solids, dtype=np.intp)
    for end in ends:
        level = [np.column_stack([points, np.ones(2000)]) for points in (starts, np.tile(end, (2000, 1)))]
        by_radio = cross(level[0], level[1], single, n_solids)
        n_met += by_radio.sum(axis=0)
        for k in range(n_solids):
            footprint = solids.take(np.arange(n_solids) == k).footprints()
            np.testing.assert_array_equal(by_radio[:, k], ~is_clear(starts, end, np.zeros(1), footprint))
        np.testing.assert_array_equal(
            ~by_radio.any(axis=1), is_clear(starts, end, np.zeros(n_solids), solids.footprints())
        )
    assert n_met.all()
