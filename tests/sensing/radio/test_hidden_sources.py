"""Sources behind a tank: bearings to its edges, and a continuous field for a robot that drives into its shadow."""

import numpy as np
from numpy.typing import NDArray

from dirmusic.angles import difference
from dirmusic.array.element_errors import ElementSpread
from dirmusic.array.model import ArrayModel
from dirmusic.arrays import FloatArray
from dirmusic.bearing.maximum_likelihood import maximum_likelihood
from pdpatrol.sensing import (
    DischargeSource,
    Surroundings,
    level_transform,
)
from pdpatrol.sensing.radio.geometry import Vector
from pdpatrol.sensing.radio.materials import GRAVEL, METAL, WAVELENGTH_M
from pdpatrol.sensing.radio.ray_paths import RayPaths, find_ray_paths
from pdpatrol.sensing.radio.surroundings import faces_of, made_of
from tests.sensing.listening import NOMINAL, listen
from tests.sensing.scenes import origins_m, solids_at

KNOWN = ArrayModel(manifold=NOMINAL.manifold(), positions_m=NOMINAL.positions_m, spread=ElementSpread())
MIDDLE = np.array([12.0, 12.0])
K = 2 * np.pi / WAVELENGTH_M


def next_to_tank(length_m: float, width_m: float, height_m: float, yaw_rad: float) -> Surroundings:
    x, y = MIDDLE
    solids = solids_at((x, y), half_m=(0.5 * length_m, 0.5 * width_m), top_m=height_m, yaw_rad=yaw_rad)
    tank = made_of(solids, [METAL])
    return Surroundings(faces_of(tank), GRAVEL, tank)


def turned(angle_rad: float) -> FloatArray:
    return np.array([np.cos(angle_rad), np.sin(angle_rad)])


def lengths_m(paths: RayPaths, target: Vector) -> FloatArray:
    """Return the length of each path."""
    return paths.rows["extra_m"] + np.linalg.norm(origins_m(paths) - np.array(target), axis=1)


def levels(paths: RayPaths, target: Vector) -> FloatArray:
    """Return the amplitude of each path at the array."""
    return np.abs(paths.rows["coefficient"]) / lengths_m(paths, target)


def test_bearing_of_hidden_source_points_to_dominant_edge() -> None:
    """At random places where one edge is 10 dB stronger, the bearing is within 3 degrees of that edge."""
    rng, off_edge_rad, off_source_rad, by_geometry_rad = np.random.default_rng(7), [], [], []
    for seed in range(300):
        length_m, width_m, height_m = rng.uniform((2.0, 1.5, 3.0), (5.0, 3.0, 4.0))
        surroundings = next_to_tank(length_m, width_m, height_m, rng.uniform(0.0, np.pi))
        towards_robot = rng.uniform(-np.pi, np.pi)
        robot = MIDDLE + rng.uniform(3.5, 9.0) * turned(towards_robot)
        source = MIDDLE - rng.uniform(2.8, 5.0) * turned(towards_robot + rng.uniform(-0.5, 0.5))
        axis = rng.standard_normal(3)
        gun = DischargeSource(
            name="s",
            position_m=np.array([*source, rng.uniform(0.8, 1.6)]),
            amplitude_v=30.0,
            pulse_rate_hz=200.0,
            axis=axis / np.linalg.norm(axis),
        )
        target = Vector(robot[0], robot[1], 0.6)
        found = find_ray_paths(gun.position_m[np.newaxis], gun.axis[np.newaxis], np.zeros(1), target, surroundings)
        level, bearing = levels(found, target), np.arctan2(*(origins_m(found)[:, :2] - robot).T[::-1])
        if level.size == 0 or not found.rows["extra_m"][level.argmax()] > 0.0:
            continue  # direct or reflected
        strongest_rad = bearing[level.argmax()]
        is_edge = np.abs(difference(bearing, strongest_rad)) < np.radians(1.0)
        others = level[~is_edge].max(initial=0.0)
        if others > level.max() * 10 ** (-10.0 / 20):
            continue
        detected = listen(
            gun,
            seed=seed,
            duration_s=0.05,
            surroundings=surroundings,
            world_from_array=level_transform(np.array([*robot, 0.3])),
            noise_v=1e-6,
            bits=24,
            full_scale_v=50.0,
        )
        if detected.pulses.n_pulses == 0:
            continue
        azimuth = maximum_likelihood(detected.pulses, KNOWN).azimuth_rad[0] + 0.3
        to_source = np.arctan2(*(source - robot)[::-1])
        off_edge_rad.append(abs(difference(azimuth, strongest_rad)))
        off_source_rad.append(difference(azimuth, to_source))
        by_geometry_rad.append(difference(strongest_rad, to_source))
    assert len(off_edge_rad) > 40
    assert np.degrees(np.median(off_edge_rad)) < 3.0
    assert np.degrees(np.median(np.abs(np.subtract(off_source_rad, by_geometry_rad)))) < 3.0
    assert np.degrees(np.max(np.abs(by_geometry_rad))) > 20.0


def field_along(surroundings: Surroundings, source: FloatArray, at: FloatArray) -> NDArray[np.complex128]:
    """Return the sum of all paths in six antennas at points (n, 2), relative to the field 1 m from the source."""
    axis, found = np.array([[0.3, 0.4, 0.866]]), np.empty((len(at), 6), np.complex128)
    for i, (x, y) in enumerate(at):
        target = Vector(x, y, 0.6)
        paths = find_ray_paths(source[np.newaxis], axis, np.zeros(1), target, surroundings)
        to_image, length_m = origins_m(paths) - np.array(target), lengths_m(paths, target)
        azimuth = np.arctan2(to_image[:, 1], to_image[:, 0])
        gain = NOMINAL.cut()(azimuth[:, np.newaxis] - NOMINAL.boresights_rad)
        found[i] = (paths.rows["coefficient"] / length_m * np.exp(-1j * K * length_m)) @ gain
    return found


def test_field_is_continuous_into_shadow_and_out() -> None:
    """With steps a quarter as long, changes shrink to a quarter, or are below 1 % of the strongest field."""
    source, surroundings = np.array([8.0, 13.0, 1.4]), next_to_tank(3.0, 2.0, 3.2, 0.4)
    for start, end in (((13.0, 3.0), (18.0, 20.0)), ((19.0, 3.0), (16.5, 21.0)), ((8.0, 6.0), (21.0, 9.0))):
        share = np.arange(0.0, 1.0, 0.004 / np.hypot(end[0] - start[0], end[1] - start[1]))[:, np.newaxis]
        at = np.array(start) + share * (np.array(end) - np.array(start))
        received = field_along(surroundings, source, at)
        change = np.abs(np.diff(received, axis=0)).max(axis=1)
        for i in np.argsort(change)[-8:]:
            finer = at[i] + np.linspace(0.0, 1.0, 17)[:, np.newaxis] * (at[i + 1] - at[i])
            smaller = np.abs(np.diff(field_along(surroundings, source, finer), axis=0)).max()
            assert smaller < 0.25 * change[i] + 0.01 * np.abs(received[i]).max()
