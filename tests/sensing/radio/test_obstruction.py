"""Obstacles on straight lines: solids of a yard, compared with geometry and with MuJoCo's rays."""
# pyright: reportAttributeAccessIssue=false

from collections.abc import Callable
from functools import partial

import mujoco
import numpy as np
import pytest

from pdpatrol.envs.random_yard import random_yard
from pdpatrol.envs.scenario.radio import surroundings_of
from pdpatrol.robot_models.description.robot_file import load_robot
from pdpatrol.robot_models.world import build_spec
from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing.radio.materials import KIND_MATERIALS, PORCELAIN, ROUND_MATERIALS
from pdpatrol.sensing.radio.transmission import Sight, direct_transmissions
from tests.robot_models.one_robot import YARD
from tests.sensing.radio.crossing import cross, solids_of


def crossed_in(yard: Yard) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    return partial(cross, solids=solids_of(yard), n_pieces=len(yard.equipment))


TANK_AND_BUSHING = crossed_in(YARD)


def line(*points: float) -> np.ndarray:
    return np.array([points])


@pytest.mark.parametrize(
    ("start", "end", "expected"),
    [
        ((21.02, 10.0, 1.5), (15.0, 10.0, 1.0), [True, False]),  # from a source on the tank through it
        ((21.02, 10.0, 1.5), (25.0, 10.0, 1.0), [False, False]),  # on the same side as the source
        ((21.02, 10.0, 1.5), (21.02, 10.0, 1.5), [False, False]),  # at the source itself
        ((5.0, 10.0, 1.0), (19.0, 10.0, 1.0), [False, False]),  # up to a face
        ((19.0, 5.0, 1.0), (19.0, 15.0, 1.0), [False, False]),  # along a face
        ((5.0, 10.0, 1.0), (21.0, 10.0, 1.0), [True, False]),  # up to the face behind
        ((10.1, 20.0, 0.1), (10.1, 20.0, 5.0), [False, True]),  # upright through the bushing
        ((10.4, 20.0, 0.1), (10.4, 20.0, 5.0), [False, False]),  # upright next to it
    ],
)
def test_line_crosses_pieces_between_its_ends(
    start: tuple[float, ...], end: tuple[float, ...], expected: list[bool]
) -> None:
    assert TANK_AND_BUSHING(line(*start), line(*end)).tolist() == [expected]
    assert TANK_AND_BUSHING(line(*end), line(*start)).tolist() == [expected]


@pytest.mark.parametrize("seed", range(4))
def test_crossed_pieces_match_mujoco_rays(seed: int) -> None:
    """The same solids from an independent model: every piece along each line, in yards of the catalogue."""
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
def test_sight_is_zero_behind_metal_and_clear_elsewhere(seed: int) -> None:
    yard, rng = random_yard(seed, 8).yard, np.random.default_rng(seed)
    sight = Sight(surroundings_of(yard))
    places = rng.uniform([0.0, 0.0, 0.6], [40.0, 30.0, 0.6], (500, 3))
    for target in rng.uniform([0.0, 0.0, 0.3], [40.0, 30.0, 4.0], (8, 3)):
        shares = sight(places, target)
        crossed = cross(places, np.tile(target, (500, 1)), solids_of(yard), len(yard.equipment))
        passes = [1.0 if transmits(item.kind) else 0.0 for item in yard.equipment]
        assert (shares[(crossed & (np.array(passes) == 0.0)).any(axis=1)] == 0.0).all()  # behind metal, nothing
        assert (shares[~crossed.any(axis=1)] > 0.3).all()  # past all pieces, only rims of lossy ones


def transmits(kind: str) -> bool:
    """Return True where any part of a kind of equipment transmits."""
    return {KIND_MATERIALS[kind].transmission, ROUND_MATERIALS.get(kind, KIND_MATERIALS[kind]).transmission} != {0.0}


def test_target_within_surface_is_seen_from_outside_only() -> None:
    sight = Sight(surroundings_of(YARD))
    inside, before, behind = np.array([19.2, 10.0, 1.0]), line(15.0, 10.0, 0.6), line(25.0, 10.0, 0.6)  # 20 cm within
    assert sight(before, inside).item() == 0.0
    assert sight(before, inside, 0.5).item() == 1.0
    assert sight(behind, inside, 0.5).item() == 0.0
    over = np.array([20.0, 10.0, 3.8])  # above the tank, as a bushing is
    assert sight(line(17.0, 10.0, 0.6), over).item() == 0.0  # too near to look over the edge
    assert sight(line(9.0, 10.0, 0.6), over).item() == 1.0
    past_the_edge = np.array([19.1, 10.0, 3.8])
    assert sight(line(17.0, 10.0, 0.6), past_the_edge).item() == 1.0


def test_porcelain_transmits_its_share() -> None:
    sight = Sight(surroundings_of(YARD))
    left = sight(line(5.0, 20.0, 0.6), np.array([15.0, 20.0, 1.0])).item()
    assert left == pytest.approx(PORCELAIN.transmission, rel=0.001)


@pytest.mark.parametrize("seed", range(4))
def test_transmission_turns_with_the_yard(seed: int) -> None:
    """Only solids near a line are examined; the boxes around pieces, along the world axes, leave out no others."""
    yard, rng = random_yard(seed, 12).yard, np.random.default_rng(seed)
    still, turn_rad = surroundings_of(yard).obstacles, rng.uniform(0.2, 1.3)
    cos, sin = np.cos(turn_rad), np.sin(turn_rad)
    rotation, turned = np.array([[cos, -sin], [sin, cos]]), still.copy()
    for first, second in (("x", "y"), ("cos", "sin")):
        turned[first], turned[second] = rotation @ np.array([still[first], still[second]])
    places_m, targets_m = (
        rng.uniform(0.0, [*yard.size_m, 4.0], (100, 3)),
        rng.uniform(0.0, [*yard.size_m, 6.0], (20, 3)),
    )
    in_space = np.eye(3)
    in_space[:2, :2] = rotation
    before = [direct_transmissions(places_m, target_m, 0.0, still) for target_m in targets_m]
    after = [direct_transmissions(places_m @ in_space.T, in_space @ target_m, 0.0, turned) for target_m in targets_m]
    assert 0.2 < np.mean(np.array(before) < 1.0) < 0.95
    np.testing.assert_allclose(after, before, atol=1e-6)
