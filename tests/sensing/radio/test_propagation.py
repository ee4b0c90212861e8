"""Ray paths: spreading, delay, reflection and obstacles."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import ArrayLike

from dirmusic import GainPattern
from pdpatrol.sensing import ArrayConfig, HelicalArray, Surroundings, level_transform
from pdpatrol.sensing.quantities import SPEED_OF_LIGHT_MPS
from pdpatrol.sensing.radio.arrivals import Propagation, propagate
from pdpatrol.sensing.radio.materials import (
    FREQUENCY_GHZ,
    GROUNDS,
    KIND_MATERIALS,
    LOSS_FACTOR,
    WAVELENGTH_M,
    GroundName,
)
from pdpatrol.sensing.radio.surroundings import made_of
from tests.sensing.listening import NOMINAL, listen, source_at, table_of
from tests.sensing.scenes import lossy, origins_m, solids_at, wall_face

AT_ORIGIN = np.eye(4)


class Isotropic(GainPattern):
    """Element with the same gain in all directions."""

    def gain_and_slope(self, off_boresight_rad: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        return np.ones(np.shape(off_boresight_rad)), np.zeros(np.shape(off_boresight_rad))


class Paths(NamedTuple):
    """Paths of one source to one element: origins, lengths and factors."""

    from_m: np.ndarray
    range_m: np.ndarray
    factor: np.ndarray


def paths_between(
    surroundings: Surroundings,
    source_m: tuple[float, float, float],
    world_from_array: np.ndarray = AT_ORIGIN,
    element_m: tuple[float, float, float] = (0.0, 0.0, 0.6),
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0),
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
    table = table_of(element)
    around = Propagation(np.array([source_m]), np.array([axis]), np.zeros(1), table, surroundings)
    ray_paths, arrivals = propagate(np.zeros(1), world_from_array, around)
    range_m = SPEED_OF_LIGHT_MPS * arrivals.delay_s[:, 0]
    return Paths(origins_m(ray_paths), range_m, arrivals.amplitude[:, 0, 0] * range_m)


def ground_and_wall(half_length: float = 5.0, ground: float = 0.3) -> Surroundings:
    """Make the ground, and a wall that faces east; they reflect fixed fractions of every wave."""
    wall = wall_face((-2.0, 0.0, 2.0), (1.0, 0.0), (half_length, 2.0), lossy(0.0, 0.8))
    return Surroundings(wall, lossy(0.0, ground))


def test_free_space_response_follows_range_and_direction() -> None:
    """Amplitude 1 / r times the gain, delay r / c, for an array that is turned and tilted nose down."""
    yaw, pitch = 0.7, 0.1
    pose = level_transform(np.array([3.0, 4.0, yaw]))
    pose[:3, :3] = pose[:3, :3] @ [[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]]
    array, rng = HelicalArray.nominal(ArrayConfig()), np.random.default_rng(0)
    for local in rng.uniform(-5.0, 5.0, (20, 3)):
        amplitude, delay_s = array.free_space_response(pose[:3, :3] @ local + pose[:3, 3], pose)
        sight = local - array.positions_m
        range_m = np.sqrt((sight**2).sum(axis=1))
        azimuth, elevation = np.arctan2(sight[:, 1], sight[:, 0]), np.arctan2(sight[:, 2], np.hypot(*sight.T[:2]))
        np.testing.assert_allclose(delay_s, range_m / SPEED_OF_LIGHT_MPS, rtol=1e-12)
        np.testing.assert_allclose(amplitude, array.gain(azimuth, elevation) / range_m, rtol=1e-9)


def test_ground_and_wall_reflect_with_image_lengths() -> None:
    paths = paths_between(ground_and_wall(), (6.0, 3.0, 1.5))
    on_plan_m = np.array([np.hypot(6, 3), np.hypot(6, 3), np.hypot(6 + 4, 3), np.hypot(6 + 4, 3)])
    np.testing.assert_allclose(paths.range_m, np.hypot(on_plan_m, [0.9, 2.1, 0.9, 2.1]), rtol=1e-14)
    np.testing.assert_allclose(np.abs(paths.factor), [1.0, 0.3, 0.8, 0.3 * 0.8], rtol=1e-4)
    np.testing.assert_allclose(paths.from_m, [[6, 3, 1.5], [6, 3, -1.5], [-10, 3, 1.5], [-10, 3, -1.5]])


def test_face_reflects_within_rim_and_to_front_only() -> None:
    surroundings = ground_and_wall(half_length=0.5)
    aside, ahead, behind = (6.0, 8.0, 1.5), (6.0, 0.5, 1.5), (-3.0, 0.0, 1.5)
    assert [paths_between(surroundings, at).factor.size for at in (aside, ahead, behind)] == [2, 4, 2]
    behind_the_wall = level_transform(np.array([-3.0, 0.0, 0.0]))
    assert paths_between(surroundings, ahead, behind_the_wall).factor.size == 2


def test_face_at_source_does_not_reflect() -> None:
    surroundings = ground_and_wall(ground=0.0)
    on_it, off_it = (paths_between(surroundings, (x, 1.0, 1.5)).factor.size for x in (-1.98, -1.9))
    assert (on_it, off_it) == (1, 2)


def test_obstacle_counts_on_every_segment() -> None:
    low = solids_at((0.0, 0.0), half_m=(20.0, 20.0), bottom_m=0.1, top_m=0.2)  # all over the ground
    surroundings = ground_and_wall(ground=0.5)._replace(obstacles=made_of(low, [lossy(6.0, 0.8)]))
    paths = paths_between(surroundings, (6.0, 3.0, 1.5))
    twice = 10 ** (-12.0 / 20)  # from the source, and on to the array
    np.testing.assert_allclose(np.abs(paths.factor), [1.0, 0.5 * twice, 0.8], rtol=1e-4)


def test_transmissions_of_pieces_multiply() -> None:
    surroundings = Surroundings.of_kinds(
        ["surge_arrester", "capacitor_bank"],
        solids_at((2.0, 0.0), (4.0, 0.0), radius_m=0.3, top_m=2.0),
    )
    passed = paths_between(surroundings, (6.0, 0.0, 0.6)).factor
    expected = KIND_MATERIALS["surge_arrester"].transmission * KIND_MATERIALS["capacitor_bank"].transmission
    assert abs(passed[0]) == pytest.approx(expected)


@pytest.mark.parametrize("name", GROUNDS)
@pytest.mark.parametrize("is_upright", [True, False])
def test_direct_and_ground_wave_follow_two_ray_law(is_upright: bool, name: GroundName) -> None:
    """Complex sum over 2 to 60 m, both polarisations, by Fresnel's formulas: within 0.1 dB."""
    ground = GROUNDS[name]
    permittivity = ground.permittivity - 1j * LOSS_FACTOR * ground.conductivity_spm / FREQUENCY_GHZ
    surroundings = Surroundings(ground=ground)
    k, up_m, down_m = 2 * np.pi / WAVELENGTH_M, 1.4, 0.6
    for distance_m in np.linspace(2.0, 60.0, 300):
        axis = (0.0, 0.0, 1.0) if is_upright else (0.0, 1.0, 0.0)
        paths = paths_between(surroundings, (distance_m, 0.0, up_m), axis=axis)
        level = abs((paths.factor / paths.range_m * np.exp(-1j * k * paths.range_m)).sum())
        direct_m, bounced_m = np.hypot(distance_m, up_m - down_m), np.hypot(distance_m, up_m + down_m)
        sine = (up_m + down_m) / bounced_m
        root = np.sqrt(permittivity - 1 + sine**2)
        horizontal = (sine - root) / (sine + root)
        vertical = (permittivity * sine - root) / (permittivity * sine + root)
        reflected = vertical if is_upright else horizontal
        expected = abs(np.exp(-1j * k * direct_m) / direct_m + reflected * np.exp(-1j * k * bounced_m) / bounced_m)
        assert 20 * np.log10(level / expected) == pytest.approx(0.0, abs=0.1)


def test_array_without_direction_receives() -> None:
    """A true pattern with equal gain in all directions is simulated, although no manifold can be made of it."""
    array = replace(NOMINAL, pattern=Isotropic())
    assert listen(source_at(5.0, 0.0), array=array, duration_s=0.05).pulses.n_pulses > 20
