"""Paths: spreading and delay, mirrors, and what stands in between."""

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import ArrayLike

from dirmusic import GainPattern
from dirmusic.bearing.gain_delay import SPEED_OF_LIGHT_MPS
from robot_models.yard.pieces import BoxEquipment
from robot_models.yard.yard import Yard
from sensing import Faces, HelicalArray, Obstacles, Surroundings, level_transform
from sensing.array.array_table import ArrayTable
from sensing.radio.arrivals import propagate
from sensing.radio.materials import KIND_MATERIALS, METAL
from sensing.radio.propagation import Propagation, SourceTable
from sensing.radio.surroundings import in_array_frame, rays_between

AT_ORIGIN = np.eye(4)


class Isotropic(GainPattern):
    """An element with the same gain everywhere."""

    def gain_and_slope(self, off_boresight_rad: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        return np.ones(np.shape(off_boresight_rad)), np.zeros(np.shape(off_boresight_rad))


class Paths(NamedTuple):
    """Of one source to one element: its images, path lengths, and what is left of the amplitude beside spreading."""

    from_m: np.ndarray
    range_m: np.ndarray
    factor: np.ndarray


def paths_between(
    surroundings: Surroundings,
    source_m: tuple[float, float, float],
    world_from_array: np.ndarray = AT_ORIGIN,
    element_m: tuple[float, float, float] = (0.0, 0.0, 0.6),
) -> Paths:
    one, zero, at = np.ones(1), np.zeros(1), np.array([element_m])
    element = HelicalArray(
        pattern=Isotropic(),
        boresights_rad=zero,
        boresight_elevations_rad=zero,
        positions_m=at,
        gain_factors=one,
        gain_offsets=zero,
    )
    sources = SourceTable(np.array([[source_m]]), np.zeros((1, 1)))
    around = Propagation(sources, ArrayTable.of([element]), surroundings)
    ray_paths, arrivals = propagate(0, np.ones(1, np.bool_), world_from_array[np.newaxis], around)
    range_m = SPEED_OF_LIGHT_MPS * arrivals.delay_s[:, 0]
    return Paths(ray_paths.from_m, range_m, arrivals.amplitude[:, 0] * range_m)


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
    surroundings = Surroundings(ground_and_wall(), np.array([-0.3, -0.8]), np.zeros(1), Obstacles.none())
    paths = paths_between(surroundings, (6.0, 3.0, 1.5))
    by_hand = [np.hypot(np.hypot(6, 3), 0.9), np.hypot(np.hypot(6, 3), 2.1), np.hypot(np.hypot(6 + 4, 3), 0.9)]
    np.testing.assert_allclose(paths.range_m, by_hand, rtol=1e-14)
    np.testing.assert_allclose(paths.factor, [1.0, -0.3, -0.8])
    np.testing.assert_allclose(paths.from_m, [[6, 3, 1.5], [6, 3, -1.5], [-10, 3, 1.5]])


def test_a_face_mirrors_only_what_it_reaches_and_only_to_its_front() -> None:
    surroundings = Surroundings(ground_and_wall(half_length=0.5), np.array([-0.3, -0.8]), np.zeros(1), Obstacles.none())
    aside, ahead, behind = (6.0, 8.0, 1.5), (6.0, 0.5, 1.5), (-3.0, 0.0, 1.5)
    assert [paths_between(surroundings, at).factor.size for at in (aside, ahead, behind)] == [2, 3, 2]
    behind_the_wall = level_transform(np.array([-3.0, 0.0, 0.0]))
    assert paths_between(surroundings, ahead, behind_the_wall).factor.size == 2


def test_a_face_right_behind_the_source_is_part_of_the_source() -> None:
    surroundings = Surroundings(ground_and_wall(), np.array([0.0, -0.8]), np.zeros(1), Obstacles.none())
    on_it, off_it = (paths_between(surroundings, (x, 1.0, 1.5)).factor.size for x in (-1.98, -1.9))
    assert (on_it, off_it) == (1, 2)


def test_equipment_weakens_what_crosses_it_on_every_segment() -> None:
    low = box_between(np.array([0.0, 0.0]), 20.0, 0.1, 0.2)  # all over the ground
    surroundings = Surroundings(ground_and_wall(), np.array([-0.3, -0.8]), np.log([0.1, 0.5]), low)
    paths = paths_between(surroundings, (6.0, 3.0, 1.5))
    np.testing.assert_allclose(paths.factor, [1.0, -0.3 * 0.1 * 0.1, -0.8])  # from the source, and on to the array


def box_between(centre_m: np.ndarray, half_m: float, bottom_m: float, top_m: float) -> Obstacles:
    one, none = np.ones(1), np.zeros(1)
    return Obstacles(
        centre_m[np.newaxis], none, np.full((1, 2), half_m), none, bottom_m * one, top_m * one, np.zeros(1, np.intp)
    )


def two_in_a_row() -> Obstacles:
    """Two cylinders on the x axis, at 2 and at 4 m."""
    none = np.zeros(2)
    return Obstacles(
        np.array([[2.0, 0.0], [4.0, 0.0]]), none, np.zeros((2, 2)), none + 0.3, none, none + 2, np.arange(2)
    )


def test_losses_of_pieces_in_a_row_add_up_in_decibels() -> None:
    surroundings = Surroundings.of_kinds(
        ["power_transformer", "current_transformer"], ground_and_wall(), two_in_a_row()
    )
    passed = paths_between(surroundings, (6.0, 0.0, 0.6)).factor
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
    faces = Faces(**yard.faces()._asdict())
    coefficient = np.full(faces.owner.size, REFERENCE["reflection"])
    surroundings = Surroundings(faces, coefficient, np.log(np.full(2, 1e-6)), Obstacles(**yard.obstacles()._asdict()))
    x, y, z = row["position_m"]
    paths = paths_between(surroundings, REFERENCE["source_m"], element_m=(x, y, z))
    amplitude = np.abs(paths.factor / paths.range_m)
    order = np.argsort(paths.range_m)
    order = order[amplitude[order] > 1e-4]
    np.testing.assert_allclose(1e9 * paths.range_m[order] / SPEED_OF_LIGHT_MPS, row["delay_ns"], atol=0.1)
    by_first = amplitude[order] / amplitude[order[0]]
    theirs = np.array(row["amplitude_1m"]) / row["amplitude_1m"][0]
    np.testing.assert_allclose(20 * np.log10(by_first), 20 * np.log10(theirs), atol=1.0)


def test_the_reference_has_hidden_and_mirrored_paths() -> None:
    counts = [len(row["delay_ns"]) for row in REFERENCE["receivers"]]
    assert min(counts) < 3
    assert max(counts) >= 3
