"""Paths: spreading and delay, mirrors, and what stands in between."""

import json
from pathlib import Path

import numpy as np
import pytest

from dirmusic.gain_delay import SPEED_OF_LIGHT_MPS
from robot_models.inspector import Inspector
from robot_models.world import build_model
from robot_models.yard import BoxEquipment, Yard
from sensing import Faces, Surroundings, level_transform
from sensing.materials import KIND_MATERIALS, METAL
from sensing.propagation import Mirrors, in_array_frame, rays_between

ONE_ELEMENT = np.array([[0.0, 0.0, 0.6]])
FIRST = np.ones(1, dtype=np.bool_)


def nothing_in_between(_: np.ndarray, ends: np.ndarray) -> np.ndarray:
    return np.zeros((len(ends), 1), dtype=np.bool_)


def ground_and_wall(wall_x: float = -2.0, half_length: float = 5.0) -> Faces:
    """The ground, and a wall that faces east."""
    return Faces(
        centre_m=np.array([[0.0, 0.0, 0.0], [wall_x, 0.0, 2.0]]),
        normal=np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
        axes=np.array([[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]]),
        half_size_m=np.array([[np.inf, np.inf], [half_length, 2.0]]),
        owner=np.array([-1, 0]),
    )


def test_free_space_spreads_with_range_and_takes_its_time_to_float_precision() -> None:
    rng = np.random.default_rng(0)
    elements, points = rng.uniform(-5, 5, (6, 3)), rng.uniform(-50, 50, (100, 3))
    rays = rays_between(elements, points)
    range_m = np.linalg.norm(points[:, np.newaxis] - elements, axis=-1)
    np.testing.assert_allclose(rays.spreading, 1 / range_m, rtol=1e-14)
    np.testing.assert_allclose(rays.delay_s, range_m / SPEED_OF_LIGHT_MPS, rtol=1e-14)


def test_directions_are_those_of_the_array_frame_with_tilt() -> None:
    yaw, pitch = 0.7, 0.1
    turn = level_transform(np.array([3.0, 4.0, yaw]))
    tilt = np.eye(4)
    tilt[:3, :3] = [[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]]
    ahead = (turn @ tilt @ np.array([5.0, 0.0, 0.0, 1.0]))[:3]
    assert ahead[2] < -0.4  # nose down
    rays = rays_between(np.zeros((1, 3)), in_array_frame(ahead, turn @ tilt))
    assert rays.azimuth_rad[0] == pytest.approx(0.0, abs=1e-12)
    assert rays.elevation_rad[0] == pytest.approx(0.0, abs=1e-12)
    level = rays_between(np.zeros((1, 3)), in_array_frame(ahead, turn))
    assert level.elevation_rad[0] == pytest.approx(-pitch)


def test_ground_and_wall_mirror_once_each_with_the_length_of_the_path_by_pythagoras() -> None:
    source = np.array([[6.0, 3.0, 1.5]])
    surroundings = Surroundings(ground_and_wall(), np.array([-0.3, -0.8]), np.ones(1), nothing_in_between)
    paths = Mirrors(surroundings, source).trace(FIRST, ONE_ELEMENT, np.eye(4))
    by_hand = [np.hypot(np.hypot(6, 3), 0.9), np.hypot(np.hypot(6, 3), 2.1), np.hypot(np.hypot(6 + 4, 3), 0.9)]
    np.testing.assert_allclose(paths.rays.range_m[:, 0], by_hand, rtol=1e-14)
    np.testing.assert_allclose(paths.factor, [1.0, -0.3, -0.8])
    assert paths.rays.elevation_rad[1, 0] == pytest.approx(-np.arctan2(2.1, np.hypot(6, 3)))  # from below
    assert paths.rays.azimuth_rad[2, 0] == pytest.approx(np.arctan2(3, -10))  # from the wall's side


def test_a_face_mirrors_only_what_it_reaches_and_only_to_its_front() -> None:
    surroundings = Surroundings(
        ground_and_wall(half_length=0.5), np.array([-0.3, -0.8]), np.ones(1), nothing_in_between
    )
    aside, ahead, behind = np.array([[6.0, 8.0, 1.5]]), np.array([[6.0, 0.5, 1.5]]), np.array([[-3.0, 0.0, 1.5]])
    n_paths = [
        Mirrors(surroundings, at).trace(FIRST, ONE_ELEMENT, np.eye(4)).source.size for at in (aside, ahead, behind)
    ]
    assert n_paths == [2, 3, 2]
    from_behind = Mirrors(surroundings, ahead).trace(FIRST, ONE_ELEMENT, level_transform(np.array([-3.0, 0.0, 0.0])))
    assert from_behind.source.size == 2


def test_a_face_right_behind_the_source_is_part_of_the_source() -> None:
    surroundings = Surroundings(ground_and_wall(), np.array([0.0, -0.8]), np.ones(1), nothing_in_between)
    on_it, off_it = (
        Mirrors(surroundings, np.array([[x, 1.0, 1.5]])).trace(FIRST, ONE_ELEMENT, np.eye(4)).source.size
        for x in (-1.98, -1.9)
    )
    assert (on_it, off_it) == (1, 2)


def test_equipment_weakens_what_crosses_it_on_every_leg() -> None:
    def those_of_the_ground(starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
        touches = (starts[:, 2] == 0.0) | (ends[:, 2] == 0.0)
        return np.column_stack([touches, np.zeros(len(ends), dtype=np.bool_)])

    surroundings = Surroundings(ground_and_wall(), np.array([-0.3, -0.8]), np.array([0.1, 0.5]), those_of_the_ground)
    paths = Mirrors(surroundings, np.array([[6.0, 3.0, 1.5]])).trace(FIRST, ONE_ELEMENT, np.eye(4))
    np.testing.assert_allclose(paths.factor, [1.0, -0.3 * 0.1 * 0.1, -0.8])  # from the source, and on to the array


def test_losses_of_pieces_in_a_row_add_up_in_decibels() -> None:
    surroundings = Surroundings.of_kinds(
        ["power_transformer", "current_transformer"],
        ground_and_wall(),
        lambda _, ends: np.ones((len(ends), 2), dtype=np.bool_),
    )
    passed = surroundings.passed(np.zeros((1, 3)), np.ones((1, 3)))
    total_db = KIND_MATERIALS["power_transformer"].loss_db + KIND_MATERIALS["current_transformer"].loss_db
    assert -20 * np.log10(passed[0]) == pytest.approx(total_db)
    assert surroundings.reflection.tolist() == [-0.3, METAL.reflection]


REFERENCE = json.loads((Path(__file__).parent / "sionna" / "reference.json").read_text(encoding="utf-8"))


def boxes_of_the_reference() -> Yard:
    return Yard(
        size_m=(30.0, 30.0),
        equipment=tuple(
            BoxEquipment(
                name=name,
                kind="wall",
                shape="box",
                position_m=(0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])),
                footprint_m=(high[0] - low[0], high[1] - low[1]),
                height_m=high[2],
            )
            for name, (low, high) in REFERENCE["boxes"].items()
        ),
    )


@pytest.mark.parametrize("row", REFERENCE["receivers"], ids=lambda row: str(row["position_m"]))
def test_paths_in_a_yard_are_those_that_sionna_rt_finds(row: dict[str, list[float]]) -> None:
    """Delays within 0.1 ns, amplitudes over the direct path's within 1 dB; what is hidden there is hidden here."""
    yard = boxes_of_the_reference()
    inspector = Inspector(build_model(yard, np.array([[0.0, 0.0, 0.6]]), np.zeros(1)))
    faces = Faces(*yard.faces())
    coefficient = np.full(faces.owner.size, REFERENCE["reflection"])
    surroundings = Surroundings(faces, coefficient, np.full(2, 1e-6), inspector.crossed)
    elements = np.array([row["position_m"]])
    paths = Mirrors(surroundings, np.array([REFERENCE["source_m"]])).trace(FIRST, elements, np.eye(4))
    amplitude = np.abs(paths.factor * paths.rays.spreading[:, 0])
    order = np.argsort(paths.rays.delay_s[:, 0])
    order = order[amplitude[order] > 1e-4]
    np.testing.assert_allclose(1e9 * paths.rays.delay_s[order, 0], row["delay_ns"], atol=0.1)
    by_first = amplitude[order] / amplitude[order[0]]
    theirs = np.array(row["amplitude_1m"]) / row["amplitude_1m"][0]
    np.testing.assert_allclose(20 * np.log10(by_first), 20 * np.log10(theirs), atol=1.0)


def test_the_reference_has_hidden_and_mirrored_paths() -> None:
    counts = [len(row["delay_ns"]) for row in REFERENCE["receivers"]]
    assert min(counts) < 3
    assert max(counts) >= 3
