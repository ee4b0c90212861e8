"""Scans along the route of a scenario, without physics: a robot that drives the shortest path at a constant speed."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from dirmusic.angles import azimuth_of, unit_vector
from dirmusic.arrays import FloatArray
from dirmusic.frame import turned
from pdpatrol.envs import Scenario
from pdpatrol.missions.driving.lidar_stop import BEAM_RAD
from pdpatrol.missions.driving.registration import SCAN_PERIOD_S, Outlines, Registration
from pdpatrol.missions.driving.site_map import SiteMap, distances_along
from pdpatrol.robot_models.sensors import LIDAR_RANGE_M

SPEED_MPS = 0.5


class ScannedRoute(NamedTuple):
    """True poses and true lidar ranges along the route of a scenario, one every `SCAN_PERIOD_S`.

    Attributes:
        scenario: The scenario.
        poses: x m, y m, yaw rad, shape (n, 3).
        ranges_m: Ranges, shape (n, n_beams), without noise.
    """

    scenario: Scenario
    poses: FloatArray
    ranges_m: FloatArray

    @classmethod
    def drive(cls, scenario: Scenario, duration_s: float) -> ScannedRoute:
        """Drive from the dock along the waypoints for at most a duration."""
        site_map, dock_m = SiteMap(scenario, scenario.yard), scenario.route.dock_m
        stops_m = [dock_m, *scenario.route.stops_m, dock_m]
        legs = [site_map.reach(a).path(site_map.cell(b)) for a, b in pairwise(stops_m)]
        path_m = np.concatenate(legs)
        along_m = distances_along(path_m)
        done_m = np.arange(0.0, min(along_m[-1], duration_s * SPEED_MPS), SCAN_PERIOD_S * SPEED_MPS)
        place_m, ahead_m = (
            np.stack([np.interp(done_m + by_m, along_m, values) for values in path_m.T], axis=-1) for by_m in (0.0, 0.5)
        )
        poses = np.column_stack([place_m, azimuth_of(ahead_m - place_m)])
        outlines = Outlines(scenario.yard, scenario.robot.description.lidar_height_m)
        ways = unit_vector(poses[:, 2:] + BEAM_RAD)
        ranges_m = np.zeros(ways.shape[:2])
        for _ in range(60):  # sphere tracing: no outline is nearer than the distance
            points_m = place_m[:, np.newaxis] + ranges_m[..., np.newaxis] * ways
            ranges_m += np.maximum(outlines.solids.horizontal_distance(points_m).min(axis=-1), 0.0)
        return cls(scenario, poses, np.minimum(ranges_m, LIDAR_RANGE_M))

    def localised(self, frame: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return the poses of a localisation with a frame and the pose error of the scenario, shape (n, 3)."""
        sensor, dock_m = self.scenario.pose_sensor, np.array(self.scenario.route.dock_m)
        rho = sensor.correlation(SCAN_PERIOD_S)
        error = sensor.std * rng.standard_normal(self.poses.shape)
        for before, now in pairwise(error):
            now *= np.sqrt(1.0 - rho**2)
            now += rho * before
        place_m = dock_m + turned(self.poses[:, :2] - dock_m, frame[2]) + frame[:2]
        return np.column_stack([place_m, self.poses[:, 2] + frame[2]]) + error

    def register(
        self, frame: FloatArray, rng: np.random.Generator, shown: Scenario | None = None
    ) -> Iterator[Registration]:
        """Register with the map of a scenario, and yield the estimator after each scan.

        Args:
            frame: Displacement x m, y m and rotation rad of the localisation.
            rng: Generator of the errors of poses and ranges.
            shown: Scenario with the map to use; by default the one that was driven.
        """
        scenario = shown or self.scenario
        registration = Registration(scenario, scenario.known_yard)
        noise_m = self.scenario.lidar.range_std_m * rng.standard_normal(self.ranges_m.shape)
        measured_m = np.where(self.ranges_m < LIDAR_RANGE_M, self.ranges_m + noise_m, LIDAR_RANGE_M)
        for k, pose in enumerate(self.localised(frame, rng)):
            assert registration.update(SCAN_PERIOD_S * k, pose, measured_m[k])
            yield registration


def with_wrong_map(
    scenario: Scenario, std_m: float, n_moved: int, n_missing: int, rng: np.random.Generator
) -> Scenario:
    """Return a scenario whose map shows pieces at wrong places: `n_moved` by 0.3 m, and some not at all."""
    names = rng.permutation([item.name for item in scenario.yard.equipment]).tolist()
    by_m = std_m * rng.standard_normal((len(names), 2))
    by_m[:n_moved] = 0.3 * unit_vector(rng.uniform(-np.pi, np.pi, n_moved))
    kept = range(len(names) - n_missing)
    wrong = {
        "accuracy_m": scenario.map.accuracy_m,
        "moved": [{"name": names[k], "by_m": tuple(by_m[k].tolist())} for k in kept],
        "missing": names[len(kept) :],
    }
    return Scenario.model_validate(scenario.model_dump() | {"map": wrong}, strict=False)
